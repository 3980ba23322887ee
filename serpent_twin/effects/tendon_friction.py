"""Let a tendon rub where it runs."""

from dataclasses import dataclass

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class TendonFriction(Effect):
    """Dry friction F along a tendon, whatever its tension: a seal, a liner, a sheath that grips.

    What grows with the tension, as at a capstan, is `cable_friction`.
    Source: Coulomb's law of friction. MJCF expresses all of it, as the tendon's frictionloss.
    """

    force: float = parameter("N", high=100.0, typical=0.5, adds_to="tendon.frictionloss")
    """F [N]"""

    places = ("tendon",)
    shows_in = "joints that start late after each reversal of a tendon, at every load"
    confused_with = ("cable_friction", "gear_backlash", "hinge_friction")
