"""Measure what a trace of any model costs: a chain of elastic joints, in poses at rest.

The chain bends under its weight and by position servos at every fifth joint; its tip is measured, and the
machine carries a load there that its model lacks. Printed: a whole trace, how its simulation grows with rows
and joints, a candidate's share, and memory.
"""

import contextlib
import io
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
import pyarrow as pa
import pyarrow.csv as csv

from benchmarks.rows import BenchmarkRows, ratio, seconds
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.identification import Trace, trace
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.stored import within

_EVERY, _SESSIONS, _LOAD, _NOISE = 5, 4, 0.1, 2e-4  # joints, files, [kg], [m]
_LIMIT = 900.0  # [s] on two cores
_TOML = """schema_version = 1
model = "chain.xml"
rows = "poses"
measured = [{ site = "tip", columns = ["x", "y", "z"], unit = "m", cameras = false, noise = 2e-4 }]
"""


@dataclass(frozen=True)
class AnyModelSpeed(Checked):
    """Measure a trace of a chain of elastic joints."""

    joints: Annotated[int, within(10, 1000)] = 30
    """Joints of the chain."""
    poses: Annotated[int, within(100, 100_000)] = 2000
    """Poses at rest, in four sessions."""
    rounds: Annotated[int, within(1, 1000)] = 3
    """Times that each pair is measured; the median ratio counts."""
    out: Path | None = None
    """JSON file for the rows."""


def chain(joints: int) -> str:
    """The MJCF: axes in turn y and z, 2 cm apart, 10 g each, at its servos' ends stiff enough to stand."""
    bodies = ""
    for n in range(joints):
        axis = "0 1 0" if n % 2 == 0 else "0 0 1"
        stiffness = 4.0 * (1 - n / joints) ** 2 + 0.2
        bodies += (
            f'<body name="b{n}" pos="{0.02 if n else 0} 0 0"><joint name="j{n}" axis="{axis}" '
            f'stiffness="{stiffness:.3f}" damping="0.01"/><geom size="0.004" pos="0.01 0 0" mass="0.01"/>'
        )
    servos = "".join(
        f'<position name="s{n}" joint="j{n}" kp="2" ctrlrange="-1 1"/>'
        for n in range(0, joints, _EVERY)
    )
    tip = '<site name="tip" pos="0.02 0 0"/>'
    return (
        '<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>'
        f"{bodies}{tip}{'</body>' * joints}</worldbody><actuator>{servos}</actuator></mujoco>"
    )


def describe(folder: Path, joints: int, poses: int) -> Path:
    """Write a chain, its machine.toml and its logs; returns the second's path."""
    text = chain(joints)
    folder.mkdir(parents=True)
    (folder / "chain.xml").write_text(text)
    drives = [f"s{n}" for n in range(0, joints, _EVERY)]
    blocks = "".join(
        f'[[drive]]\nactuator = "{name}"\ncolumn = "{name}"\nunit = "rad"\n' for name in drives
    )
    (folder / "machine.toml").write_text(_TOML + blocks)
    rng = np.random.default_rng(0)
    told = np.cumsum(rng.normal(0, 0.2, (poses, len(drives))), axis=0)
    told = np.sin(told)
    seen = _settled(text, told) + _NOISE * rng.standard_normal((poses, 3))
    (folder / "logs").mkdir()
    for n, rows in enumerate(np.array_split(np.arange(poses), _SESSIONS)):
        columns = dict(zip([*drives, "x", "y", "z"], np.c_[told, seen][rows].T, strict=True))
        csv.write_csv(pa.table(columns), folder / "logs" / f"session_{n + 1}.csv")
    return folder / "machine.toml"


def _settled(text: str, told: np.ndarray) -> np.ndarray:
    """The tip of a chain that carries a load, by letting it swing out."""
    spec = mujoco.MjSpec.from_string(text)
    tip = spec.site("tip")
    tip.parent.add_geom(size=[0.001, 0, 0], mass=_LOAD, pos=tip.pos)
    spec.option.timestep, spec.option.integrator = 0.005, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for joint in spec.joints:
        joint.damping[0] = 0.1
    model = spec.compile()
    data, seen = mujoco.MjData(model), []
    for row in told:
        data.ctrl[:] = row
        for _ in range(2000):
            mujoco.mj_step(model, data)
            if np.abs(data.qvel).max() < 1e-5:
                break
        seen.append(data.site("tip").xpos.copy())
    return np.array(seen)


def opened(path: Path) -> tuple[Case, list]:
    """A machine's case and its logs."""
    rig = open_machine(path)
    logs = rig.read(path.parent / "logs")
    return rig.open(logs), logs


def simulated(case: Case, logs: list) -> Callable[[], float]:
    """Simulates a twin that is a little off, from the poses of the nominal one."""
    pieces, rng = case.pieces(logs), np.random.default_rng(1)
    case.residual([ParameterVector.nominal(case.declared)], pieces)

    def run() -> float:
        off = 0.01 * rng.standard_normal(len(case.declared))
        return seconds(lambda: case.residual([ParameterVector(off)], pieces))

    return run


def main(config: AnyModelSpeed) -> None:
    """Print a trace's time, and how its cost grows."""
    rows = BenchmarkRows()
    with tempfile.TemporaryDirectory() as folder:
        of = {
            (joints, poses): describe(Path(folder) / f"{joints}_{poses}", joints, poses)
            for joints, poses in {
                (config.joints, config.poses),
                (config.joints, config.poses // 2),
                (config.joints // 2, config.poses // 2),
            }
        }
        whole = of[config.joints, config.poses]
        case, logs = opened(whole)
        run = {key: simulated(*opened(path)) for key, path in of.items()}
        half = run[config.joints, config.poses // 2]
        small = run[config.joints // 2, config.poses // 2]

        rows.add(
            "twice the poses to half of them",
            ratio(simulated(case, logs), half, config.rounds),
            "",
            "2",
        )
        rows.add(
            "twice the joints to half of them", ratio(half, small, config.rounds), "", "at most 8"
        )
        rows.add("candidates", len(case.candidates))
        began = time.perf_counter()
        with contextlib.redirect_stdout(io.StringIO()):
            found = trace(Trace((whole.parent / "logs",), whole.parent / "trace", machine=whole))
        took = time.perf_counter() - began
        rows.add(
            f"trace of {config.joints} joints, {config.poses} poses", took, "s", f"{_LIMIT:.0f}"
        )
        rows.add("trace to its limit", took / _LIMIT, "", "at most 1")
        rows.add("a candidate's share of it", took / len(case.candidates), "s")
        rows.add("effects named", len(found["effects"]))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rows.add("peak memory", peak, "MB")
    rows.write(config.out)


if __name__ == "__main__":
    cli.run(main)
