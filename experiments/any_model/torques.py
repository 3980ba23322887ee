"""Make a log of a machine's torques: a controller closes the motion, and drives say what they gave.

MuJoCo moves rigid bodies by the classical Runge-Kutta method in steps of 0.25 ms; the controller, with the
torques that the model without a fault needs, runs at 1 kHz. The fault is a force that is computed here, or an
inertia.
"""

from pathlib import Path

import mujoco
import numpy as np

from experiments.any_model.models import PublicModel
from experiments.any_model.record import STEP, FaultyRun, write_table
from serpent_twin.arrays import Array

RATE, SECONDS, CONTROL = 200, 20, 1000  # [Hz], [s], [Hz]
_STIFFNESS, _DAMPING = 400.0, 40.0  # of the controller [1/s²], [1/s]
_COUNTS, _JITTER = 2**16, 2e-5  # encoder's steps in a turn, and its noise [rad]
_NOISE, _STEPS = 0.01, 1000
"""Noise of a logged torque, as a share of the drive's greatest; number of steps up to that"""
_AT_MOST = 3.0
"""Greatest torque of a drive, in rms values of what it gives"""


def with_motors(model: PublicModel) -> mujoco.MjSpec:
    """The model with a motor at each joint, and nothing else that drives it."""
    spec = model.spec()
    for each in [*spec.actuators, *spec.sensors]:
        spec.delete(each)
    for joint in list(spec.joints):
        motor = spec.add_actuator(name=f"motor_{joint.name}", target=joint.name)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gear[0] = 1.0
        motor.ctrllimited = motor.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
    return spec


def record(path: Path, model: PublicModel, fault: str, strength: float, seed: int) -> None:
    """Write a session as CSV: time, what the joints' encoders read, what the drives say that they gave."""
    rng = np.random.default_rng(seed)
    machine = FaultyRun(model, fault, strength, 1)
    moved, data = machine.model, machine.data
    moved.actuator_gainprm[:] = moved.actuator_biasprm[:] = 0.0
    nominal = with_motors(model).compile()
    needed = mujoco.MjData(nominal)
    size, phase = rng.uniform(0.3, 1, (4, moved.nv)), rng.uniform(0, 2 * np.pi, (4, moved.nv))
    turning = 2 * np.pi * rng.uniform(0.1, 0.8, (4, moved.nv))
    size *= model.swing / size.sum(axis=0)

    def goal(time: float) -> tuple[Array, Array, Array]:
        at, along = size * np.sin(turning * time + phase), turning * time + phase
        return (
            np.array(model.middle) + at.sum(axis=0),
            (size * turning * np.cos(along)).sum(axis=0),
            -(turning**2 * at).sum(axis=0),
        )

    data.qpos[:], data.qvel[:], _ = goal(0.0)
    rows = []
    for n in range(SECONDS * CONTROL):
        angle, rate, faster = goal(n / CONTROL)
        needed.qpos[:], needed.qvel[:] = data.qpos, data.qvel
        needed.qacc[:] = faster + _STIFFNESS * (angle - data.qpos) + _DAMPING * (rate - data.qvel)
        mujoco.mj_inverse(nominal, needed)
        torque = needed.qfrc_inverse.copy()
        if n % (CONTROL // RATE) == 0:
            rows.append([n / CONTROL, *data.qpos, *torque])
        for _ in range(round(1 / CONTROL / STEP)):
            machine.push(torque)
    table = np.array(rows)
    angles, torques = table[:, 1 : 1 + moved.nv], table[:, 1 + moved.nv :]
    angles += _JITTER * rng.standard_normal(angles.shape)
    angles[:] = 2 * np.pi / _COUNTS * np.round(angles * _COUNTS / (2 * np.pi))
    most = _AT_MOST * np.sqrt((torques**2).mean(axis=0))
    torques += _NOISE * most * rng.standard_normal(torques.shape)
    torques[:] = most / _STEPS * np.round(torques / most * _STEPS)
    joints = [moved.joint(n).name for n in range(moved.njnt)]
    names = ["t", *(f"q_{each}" for each in joints), *(f"tau_{each}" for each in joints)]
    write_table(path, names, table)


def describe(folder: Path, model: PublicModel) -> Path:
    """Write the model and its machine.toml as a user would; returns the latter's path."""
    spec = with_motors(model)
    joints = [each.name for each in spec.joints]
    spec.compile()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.xml").write_text(spec.to_xml())
    lines = ['schema_version = 1\nmodel = "model.xml"\nrows = "torque"']
    lines.append('time = { column = "t", unit = "s" }\nmeasured = [')
    lines += [f'    {{ joint = "{n}", columns = ["q_{n}"], unit = "rad" }},' for n in joints]
    lines += [
        f'    {{ actuator = "motor_{n}", columns = ["tau_{n}"], unit = "N m" }},' for n in joints
    ]
    (folder / "machine.toml").write_text("\n".join([*lines, "]\n"]))
    return folder / "machine.toml"
