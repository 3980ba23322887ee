"""What of the nominal arm did nobody publish?"""

from dataclasses import dataclass, fields
from math import isfinite

from serpent_twin.errors import SerpentError


@dataclass(frozen=True)
class Parameters:
    """Free parameters of the nominal twin, fitted to the paper's results table.

    `experiments/paper_table.py` made these numbers; `model/README.md` grades them.
    """

    strand_stiffness: float = 18.8e3
    """Stiffness of each strand, + or − [N/m]"""
    strand_slack: float = 3.89e-4
    """Length that a loop's stretch must take up before a strand pulls, either way [m]"""
    joint_friction: float = 0.00661
    """Coulomb friction of each arm hinge and of the jaw [N m]"""
    joint_damping: float = 0.000996
    """Viscous damping of each arm hinge and of the jaw [N m s/rad]"""
    transition_velocity: float = 0.0
    """Speed below which an arm hinge's Coulomb friction is in proportion to its speed, so that a loaded
    hinge creeps [rad/s]; at zero it sticks"""
    gear_friction: float = 0.0269
    """Coulomb friction of each servo's gearbox, at the horn [N m]"""
    servo_lag: float = 0.0
    """Time constant with which a servo takes up a new goal velocity [s], beside the millisecond of its PI
    control
    """
    controller_gain: float = 2.29
    """Gain of the P controller of the joint angles [1/s]"""
    marker_noise: float = 1.4e-3
    """Standard deviation of each marker coordinate [m]: cameras, and all that moves a marker and no
    motor feels; a camera alone is better"""
    load_noise: float = 0.015
    """Standard deviation of the load reading, as a fraction of the stall torque [1]"""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (isfinite(value) and value >= 0):
                raise SerpentError(
                    f"the parameter {each.name} is {value}; it must be a number of at least 0."
                )


NOMINAL = Parameters()
