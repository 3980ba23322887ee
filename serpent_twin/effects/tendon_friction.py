"""Let a tendon rub where it runs."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.effects.effect import Effect, parameter
from serpent_twin.effects.links import HELD, let_rub


@dataclass(frozen=True)
class TendonFriction(Effect):
    """Dry friction F along a tendon, whatever its tension: a seal, a liner, a sheath that grips.

    What grows with the tension, as at a capstan, is `cable_friction`.
    Source: Coulomb's law of friction. MJCF expresses all of it, as the tendon's frictionloss.
    """

    force: float = parameter("N", high=100.0, typical=0.5)
    """F [N]"""

    places: ClassVar[tuple[str, ...]] = ("tendon",)
    shows_in: ClassVar[str] = (
        "joints that start late after each reversal of a tendon, at every load"
    )
    confused_with: ClassVar[tuple[str, ...]] = ("cable_friction", "gear_backlash", "hinge_friction")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Let the tendons rub."""
        for tendon in spec.tendons:
            if tendon.name == (self.at or tendon.name):
                tendon.frictionloss += self.force
                tendon.solref_friction[0] = HELD
        let_rub(spec)
