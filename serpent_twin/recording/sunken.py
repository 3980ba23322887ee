"""Bring back a simulated arm that sank while its torque was off.

A limp arm pulls at its motors, and the jaw's motor does not follow: session by session the jaw opens, until
it stands beyond its limit. A person turns the real one back by hand; here the motors do it.
"""

import numpy as np

from serpent_twin.arm.control import joint_p_control
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.hardware.dynamixel.bus import DynamixelBus
from serpent_twin.hardware.limits import joint_beyond

NEAR, HOME = 0.75, 0.25
"""The arm is brought back from beyond NEAR to within HOME of the limit of its joints [1]."""
LONGEST = 20.0
"""Time that this may take [s]; then the limit stops the arm."""


def bring_back(bus: DynamixelBus, gain: float, period: float) -> None:
    """Drive the joints and the jaw of a connected arm towards straight, if they may be and are far from it.

    `gain` is the controller's [1/s], `period` its time step [s].
    """
    limit = bus.setup.limits.joint_angle
    far = joint_beyond(bus.read_state().position, NEAR * limit) is not None
    if not (far and bus.turns.may_be_brought_back):
        return
    with bus.beyond_limits():
        bus.enable_torque()
        for _ in range(int(LONGEST / period) + 1):
            position = bus.read_state().position
            if joint_beyond(position, HOME * limit) is None:
                break
            bus.write_velocity(_towards_straight(position, gain))
            bus.wait(period)
        bus.write_velocity(np.zeros(N_MOTORS))
        bus.wait(period)


def _towards_straight(motor: Array, gain: float) -> Array:
    velocity = joint_p_control(np.zeros(N_JOINTS), motor, gain)
    velocity[-1] += gain * (motor[-2] - motor[-1])
    return velocity
