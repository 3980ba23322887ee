"""Add a spring beside the cables to each joint, at rest when the joint is straight."""

from dataclasses import dataclass

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class JointElasticity(Effect):
    """A linear spring beside each hinge, −k q: wires along the arm, a sleeve, cables' bending.

    Source: Hooke's law. MJCF expresses all of it, as the hinge's stiffness. A bundle of wires makes
    0.01 … 0.3 N m/rad; gravity on the whole arm makes 0.8 N m/rad at joint 1.
    """

    stiffness: float = parameter("N m/rad", high=3.0, typical=0.05, adds_to="joint.stiffness.0")
    """k [N m/rad]"""

    places = ("joint",)
    shows_in = "joints that fall short in proportion to their angle, and their loads"
    confused_with = ("cable_stiffening", "payload")
