"""Make the logs of a pan-tilt head that is not as its model says.

MuJoCo simulates the head in steps of 0.25 ms. Its commands come late, and one joint has dry friction as
MuJoCo solves it; the effects of the package have no part in it.
"""

from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import pyarrow.csv as csv

from serpent_twin.arrays import Array

MODEL = Path(__file__).with_name("robot.xml")
JOINTS = ("pan", "tilt")
LATE, FRICTION, AT = 0.03, 0.1, "tilt"  # [s], [N m], joint: what the model lacks
RATE, SECONDS, LOGS, STEP = 50.0, 12.0, 3, 0.25e-3  # [Hz], [s], files, [s]
COUNTS = 4096  # of the encoders in a turn
_WAVES, _HIGHEST = 6, 0.9  # of a command, and their highest frequency [Hz]
_SWING = (0.9, 0.6)  # of the commands [rad]


def write(folder: Path, seed: int = 0) -> list[Path]:
    """Write the model and its logs as a laboratory would: a CSV a run, in ms and degrees."""
    (folder / "logs").mkdir(parents=True, exist_ok=True)
    (folder / MODEL.name).write_bytes(MODEL.read_bytes())
    files = [folder / "logs" / f"run_{n + 1}.csv" for n in range(LOGS)]
    for n, path in enumerate(files):
        time, command, angle = run(np.random.default_rng([seed, n]))
        columns = {"time_ms": 1e3 * time}
        for k, joint in enumerate(JOINTS):
            columns[f"{joint}_goal_deg"] = np.degrees(command[:, k])
            columns[f"{joint}_deg"] = np.degrees(angle[:, k])
        table = {name: pa.array(np.round(values, 4)) for name, values in columns.items()}
        csv.write_csv(pa.table(table), path)
    return files


def run(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Times [s], (T,), commands [rad], (T, 2), and the encoders' readings [rad], (T, 2)."""
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    model.opt.timestep = STEP
    model.dof_frictionloss[model.joint(AT).dofadr] = FRICTION
    data = mujoco.MjData(model)
    time = np.arange(0.0, SECONDS, 1 / RATE)
    command = commands(time, rng)
    angle = np.empty_like(command)
    every, late = round(1 / RATE / STEP), round(LATE / STEP)
    for step in range(len(time) * every):
        row, rest = divmod(step, every)
        if not rest:
            angle[row] = np.round(data.qpos * COUNTS / (2 * np.pi)) * (2 * np.pi / COUNTS)
        data.ctrl[:] = command[max(step - late, 0) // every]
        mujoco.mj_step(model, data)
    return time, command, angle


def commands(time: Array, rng: np.random.Generator) -> Array:
    """Goals of both servos [rad], (T, 2): a sum of sines that begins at zero."""
    frequency = rng.uniform(0.1, _HIGHEST, (_WAVES, 2))
    phase = rng.uniform(0, 2 * np.pi, (_WAVES, 2))
    wave = np.sin(2 * np.pi * frequency * time[:, None, None] + phase) - np.sin(phase)
    total = wave.sum(axis=1)
    return total / np.abs(total).max(axis=0) * _SWING
