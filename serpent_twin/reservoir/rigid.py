"""Simulate the arm on cables that neither stretch nor slacken.

The control of a sweep: joints follow the motors exactly, loads are the weight of the present pose, so
there is no memory, and products of inputs come from the arm's geometry alone.
"""

from dataclasses import replace

import mujoco
import numpy as np

from serpent_twin.arm import mjcf
from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arm.geometry import ARM, markers
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import addresses
from serpent_twin.reservoir.drive import HeldResponse
from serpent_twin.sim.twin_model import TwinModel


def move(targets: Array) -> HeldResponse:
    """Response to joint targets [rad], (B, K + 1, 9), at any rate: the arm rests in each hold."""
    joint = targets[:, 1:]
    load = loads(joint.reshape(-1, joint.shape[-1])).reshape(*joint.shape[:-1], -1)
    return HeldResponse(on_stiff_cables(joint), load, joint, markers(joint))


def loads(joint_angle: Array) -> Array:
    """Loads [1], (T, 10), that hold the arm at rest at joint angles [rad], (T, 9), by inverse dynamics.

    Cable j pulls at joints 1 … j alike, the gripper's at all and the jaw: so motor j carries the torque of
    joint j minus that of joint j + 1.
    """
    free = replace(NOMINAL, strand_stiffness=0.0, joint_friction=0.0)
    model = TwinModel(free).spec(motors=False).compile()
    data = mujoco.MjData(model)
    at, dof = addresses(model, (*mjcf.JOINTS, "jaw"))
    torque = np.empty((len(joint_angle), len(dof)))
    for row, angle in enumerate(joint_angle):
        data.qpos[at[:-1]] = angle
        mujoco.mj_inverse(model, data)
        torque[row] = data.qfrc_inverse[dof]
    return -np.diff(torque, axis=1, append=0.0) / ARM.servo.stall_torque
