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
RATE, SECONDS, LOGS, STEP = 100.0, 10.0, 3, 0.25e-3  # [Hz], [s], files, [s]
COUNTS = 4096  # of the encoders in a turn
_LEG = 0.8  # from one corner of a command to the next [s]
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
    """Goals of both servos [rad], (T, 2): straight from one random corner to the next, from zero on."""
    corners = np.arange(0.0, SECONDS + _LEG, _LEG)
    goals = rng.uniform(-1, 1, (len(corners), 2)) * _SWING
    goals[0] = 0.0
    return np.stack([np.interp(time, corners, goals[:, k]) for k in range(2)], axis=-1)
