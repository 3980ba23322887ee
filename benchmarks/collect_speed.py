"""Measure what everything around the physics costs when sessions are collected.

The peer is MuJoCo's own multi-threaded rollout of the same model over the same number of steps, in
the same run. Printed besides: cost against the number of sessions, and memory against their length.
"""

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from mujoco import rollout

from benchmarks.rows import BenchmarkRows
from serpent_twin.arm import mjcf
from serpent_twin.arm.control import joint_p_control, random_targets
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.numerals import counted
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sim.twin import Twin
from serpent_twin.stored import within

PERIOD = 0.25  # [s]
SUBSTEPS = round(PERIOD / mjcf.TIMESTEP)
THREADS = os.cpu_count() or 1


@dataclass(frozen=True)
class CollectSpeed(Checked):
    """Measure collection against bare MuJoCo."""

    sessions: Annotated[int, within(2, 10_000)] = 8
    """Sessions of the largest run."""
    steps: Annotated[int, within(4, 10_000_000)] = 2100
    """Control steps a session."""
    rounds: Annotated[int, within(1, 1000)] = 3
    """Times that the pair is measured; the median ratio counts."""
    out: Path | None = None
    """JSON file for the rows."""


def motion(steps: int) -> np.ndarray:
    """Controls of a driven arm, (steps × substeps, 20), so that the peer simulates the same motion."""
    twin, rows = Twin(), []
    for target in random_targets(steps, np.random.default_rng(0)):
        velocity = joint_p_control(target, twin.motor_angle[0], NOMINAL.controller_gain)
        elapsed = mjcf.TIMESTEP * np.arange(SUBSTEPS)[:, None]
        control = np.empty((SUBSTEPS, 20))
        control[:, 0::2] = twin.motor_angle[0] + velocity * elapsed
        control[:, 1::2] = velocity
        rows.append(control)
        twin.advance(velocity, PERIOD)
    return np.concatenate(rows)


def bare(sessions: int, control: np.ndarray) -> float:
    """Seconds that MuJoCo's rollout on all cores takes for these sessions."""
    model = mjcf.build().compile()
    data = [mujoco.MjData(model) for _ in range(THREADS)]
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.zeros(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data[0], state, full)
    start = time.perf_counter()
    with rollout.Rollout(nthread=THREADS) as pool:
        states = np.repeat(state[None], sessions, axis=0)
        for part in np.array_split(control, max(1, len(control) // 12_500)):
            found, _ = pool.rollout(model, data, states, np.repeat(part[None], sessions, axis=0))
            states = found[:, -1]
    return time.perf_counter() - start


def collected(sessions: int, steps: int) -> float:
    """Seconds that `collect` takes, worker processes, journal and Parquet included."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        collect(Collect(Path(folder) / "logs", sessions=sessions, steps=steps))
        return time.perf_counter() - start


def peak_memory(steps: int) -> float:
    """Peak resident memory of one collecting process [MB] for a session of `steps` steps."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "serpent_twin.collect", "--out", f"{folder}/logs"]
        command += ["--sessions", "1", "--steps", str(steps)]
        pid = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL).pid
        usage = os.wait4(pid, 0)[2]
    scale = 1024 if sys.platform != "darwin" else 1
    return usage.ru_maxrss * scale / 1e6


def main(config: CollectSpeed) -> None:
    """Print steps per second, the ratio to bare MuJoCo, and how cost and memory grow."""
    print(
        f"{THREADS} cores, {counted(config.sessions, 'session')} × {counted(config.steps, 'step')} "
        f"of {SUBSTEPS} substeps"
    )
    rows = BenchmarkRows()
    control, ratios, speeds = motion(config.steps), [], []
    physics = config.sessions * config.steps * SUBSTEPS
    for _ in range(config.rounds):
        ours, theirs = collected(config.sessions, config.steps), bare(config.sessions, control)
        ratios.append(theirs / ours)
        speeds.append(physics / ours)
    speed = float(np.median(speeds))
    rows.add("collecting, journal and Parquet included", speed, "steps/s")
    rows.add("simulated to elapsed time", speed * mjcf.TIMESTEP, "×")
    rows.add(
        "its speed to that of a bare rollout on all cores", np.median(ratios), "", "at least 0.80"
    )
    small = config.sessions // 2
    half, whole = collected(small, config.steps), collected(config.sessions, config.steps)
    text = f"time of a session in a run of {config.sessions} to that in a run of {small}"
    rows.add(text, whole / half / 2, "", "1")
    quarter = config.steps // 4
    short, long = peak_memory(quarter), peak_memory(config.steps)
    rows.add(f"peak memory of a session of {config.steps} steps", long, "MB")
    rows.add(f"the same to that of a session of {quarter} steps", long / short, "", "1")
    rows.write(config.out)


if __name__ == "__main__":
    cli.run(main)
