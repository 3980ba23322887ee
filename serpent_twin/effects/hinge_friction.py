"""Give the hinges of a machine friction that its twin leaves out."""

from dataclasses import dataclass

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class HingeFriction(Effect):
    """Coulomb friction F sign(q̇) and viscous friction b q̇ of every hinge.

    Source: Coulomb's and Newton's laws of friction. MJCF expresses all of it, as frictionloss and
    damping; at a joint of any model, it holds within two time steps. Small servos lose 2 … 10 % of their
    stall torque to it.
    """

    coulomb: float = parameter("N m", high=0.5, typical=0.03, adds_to="joint.frictionloss")
    """F [N m]"""
    viscous: float = parameter("N m s/rad", high=0.2, typical=0.005, adds_to="joint.damping.0")
    """b [N m s/rad]"""

    places = ("joint",)
    shows_in = "swings that die away, and lag by the same at every load"
    confused_with = ("gear_friction", "gear_backlash")
