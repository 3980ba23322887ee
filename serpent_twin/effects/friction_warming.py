"""Let the friction of gears fall while they warm up in each session."""

from dataclasses import dataclass

from serpent_twin.effects.effect import LOSS, Effect, parameter


@dataclass(frozen=True)
class FrictionWarming(Effect):
    """Coulomb friction is greater by F exp(−t / τ) at a time t in the session: grease thins as it warms.

    Gears cool down between sessions. In prescribed motion it shows in the loads alone.
    Source: Newton's law of heating, with friction linear in the temperature; Bittencourt and Gunnarsson, J.
    Dyn. Sys. Meas. Control 134 (2012) 051013, on the friction of a robot's joint. At a joint of a model, it
    holds within two time steps.
    """

    extra: float = parameter("N m", high=0.3, typical=0.02)
    """F [N m]"""
    time: float = parameter("s", low=5.0, high=600.0, typical=40.0, default=40.0)
    """τ [s]"""

    shows_in = "loads that jump at each reversal by less and less, anew in each session"
    places = ("joint",)
    confused_with = ("gear_friction",)
    simplified = 0.05
    stage = LOSS
    law = "gear_friction: fading time"
