"""Give a hinge more friction near rest than in motion."""

from dataclasses import dataclass

from serpent_twin.effects.effect import LOSS, Effect, parameter


@dataclass(frozen=True)
class Stribeck(Effect):
    """Coulomb friction is greater by F exp(−|q̇| / v) near rest: a film of grease wears thin.

    Source: Stribeck, Die wesentlichen Eigenschaften der Gleit- und Rollenlager, 1902; Bo and Pavelescu's
    exponential. At a joint of a model, it holds within two time steps.
    """

    extra: float = parameter("N m", high=0.3, typical=0.02)
    """F [N m]"""
    velocity: float = parameter("rad/s", low=0.01, high=2.0, typical=0.2, default=0.2)
    """v [rad/s]"""

    shows_in = "jerks out of rest, and rest where a slow motion should go on"
    places = ("joint",)
    confused_with = ("gear_friction", "hinge_friction")
    stage = LOSS
    law = "gear_friction: near_rest joint_velocity"
