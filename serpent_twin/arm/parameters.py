"""Store the parameters of the nominal arm that are not published."""

from dataclasses import dataclass
from typing import Annotated

from serpent_twin.stored import require_fields, within


@dataclass(frozen=True)
class Parameters:
    """Free parameters of the nominal twin, fitted to the paper's results table.

    `experiments/paper_table` made these numbers; `model/README.md` grades them. Beyond the bounds no arm
    of this size is: 1.4 mm of a steel rod as thick as the axles has 1e9 N/m; a strand with 0.2 m of slack
    pulls at no angle that a joint can have; a servo gives 1.5 N m, turns 6.4 rad/s at most and moves a
    marker by half a metre.
    """

    strand_stiffness: Annotated[float, within(0.0, 1e9, "N/m")] = 18.8e3
    """Stiffness of each strand, + or − [N/m]"""
    strand_slack: Annotated[float, within(0.0, 0.2, "m")] = 3.89e-4
    """Length that a loop's stretch must take up before a strand pulls, either way [m]"""
    joint_friction: Annotated[float, within(0.0, 10.0, "N m")] = 0.00661
    """Coulomb friction of each arm hinge and of the jaw [N m]"""
    joint_damping: Annotated[float, within(0.0, 10.0, "N m s/rad")] = 0.000996
    """Viscous damping of each arm hinge and of the jaw [N m s/rad]"""
    transition_velocity: Annotated[float, within(0.0, 10.0, "rad/s")] = 0.0
    """Speed below which an arm hinge's Coulomb friction is in proportion to its speed, so that a loaded
    hinge creeps [rad/s]; at zero it sticks"""
    gear_friction: Annotated[float, within(0.0, 10.0, "N m")] = 0.0269
    """Coulomb friction of each servo's gearbox, at the horn [N m]"""
    servo_lag: Annotated[float, within(0.0, 10.0, "s")] = 0.0
    """Time constant with which a servo takes up a new goal velocity [s], beside the millisecond of its PI
    control
    """
    controller_gain: Annotated[float, within(0.0, 1e3, "1/s")] = 2.29
    """Gain of the P controller of the joint angles [1/s]"""
    marker_noise: Annotated[float, within(0.0, 1.0, "m")] = 1.4e-3
    """Standard deviation of each marker coordinate [m]: cameras, and all that moves a marker and no
    motor feels; a camera alone is better"""
    load_noise: Annotated[float, within(0.0, 1.0, "of the stall torque")] = 0.015
    """Standard deviation of the load reading, as a fraction of the stall torque [1]"""

    def __post_init__(self) -> None:
        require_fields(self, "the parameter")


NOMINAL = Parameters()
