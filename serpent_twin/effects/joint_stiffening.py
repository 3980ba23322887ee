"""Let a joint's spring stiffen as it turns."""

from dataclasses import dataclass

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class JointStiffening(Effect):
    """A moment −k₃ q³ beside each hinge.

    Sleeves, hoses and flexures go tight near the ends of a range.
    Source: the cubic spring of Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, 1918. MJCF
    expresses all of it, as the hinge's stiffness.
    """

    cubic: float = parameter("N m/rad³", high=10.0, typical=0.1, adds_to="joint.stiffness.2")
    """k₃ [N m/rad³]"""

    places = ("joint",)
    shows_in = "joints that fall short far from the middle, and not near it"
    confused_with = ("joint_elasticity",)
