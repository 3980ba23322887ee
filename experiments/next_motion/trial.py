"""Record one arm, trace it, plan its next motion, and trace it with that and with more random targets."""

import shutil
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

import bench_arm
from bench_arm.record import SUBSTEPS
from bench_arm.session import RATE, session
from experiments.result_rows import row_or_failure, said_to
from serpent_twin.arrays import Array
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.recording import motion
from serpent_twin.recording.plan import Plan, plan
from serpent_twin.sessions import write_session
from serpent_twin.stored import within

GROUPS = (
    ("gear_backlash", "cable_friction"),
    ("payload", "base_tilt", "link_flex"),
    ("cable_creep", "clamp_slip", "stiffness_drift"),
    ("mocap_latency", "motor_latency"),
)
"""Effects of the independent arm that can be confused with each other"""
EFFECTS = tuple(name for group in GROUPS for name in group)


@dataclass(frozen=True)
class NextMotion(Checked):
    """Measure what a planned motion is worth, beside as many random targets.

    Each arm has one effect that can be confused with others. It is traced from one recording of random
    targets; from two; and from one and a recording of the motion that `plan` makes of the first trace.
    """

    out: Path = Path("next_motion")
    """Folder for results; the same command goes on where it stopped."""
    only: tuple[str, ...] = ()
    """Only arms with these effects; without, with all ten."""
    arms: Annotated[int, within(1, 1000)] = 2
    """Arms for each of the ten effects."""
    minutes: Annotated[float, within(1.0, 60.0, "min")] = 2.0
    """Length of a session; a recording is two sessions, and its second one judges."""
    level: Annotated[float, within(0.01, 10.0)] = 0.15
    """Strengths of effects, in strengths that an arm of this size shows clearly; each is drawn near it."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Arms side by side; with several, set OMP_NUM_THREADS=1."""
    budget_minutes: Annotated[float, within(0, 1e6, "min")] = 0.0
    """Begin no arm after this time; 0 for no limit."""
    seed: Seed = 0
    """Seed of all random draws."""
    keep: bool = False
    """Keep every arm's logs and fits: tens of megabytes each."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/next-motion.md."""


BEFORE, RANDOM, PLANNED = "before", "random", "planned"
STAGES = (BEFORE, RANDOM, PLANNED)
"""Traces of the first recording alone, and with a second one of random targets or of the planned motion"""
SESSIONS = 2  # of a recording
_SPREAD = 0.3  # log: of the strengths of effects


@dataclass(frozen=True)
class TracedArm:
    """One arm with one effect."""

    id: str
    name: str
    """Name of its effect"""


@dataclass(frozen=True)
class _Arm:
    built: bench_arm.BenchArm
    effects: bench_arm.Effects
    seed: int


def trials(arms: int, only: Sequence[str] = ()) -> list[TracedArm]:
    """Each effect once, then each again, so that the table is balanced whenever it ends."""
    if unknown := [name for name in only if name not in EFFECTS]:
        raise SerpentError(
            f"--only {' '.join(unknown)}: there is no such effect here. There are {', '.join(EFFECTS)}."
        )
    names = only or EFFECTS
    return [TracedArm(f"{name}-{n:02d}", name) for n in range(arms) for name in names]


def run_trial(config: NextMotion, trial: TracedArm) -> dict[str, Any]:
    """Trace one arm three times; returns what was injected and what was found each time."""
    folder = config.out / "arms" / trial.id
    folder.mkdir(parents=True, exist_ok=True)
    arm = _draw(config, trial)

    def found() -> dict[str, Any]:
        with said_to(folder / "said.log"):
            answers = _traced(config, arm, folder)
        if not config.keep:
            for each in folder.iterdir():
                shutil.rmtree(each / "stages", ignore_errors=True)
        return {"answers": answers}

    strength = float(getattr(arm.effects, trial.name))
    return row_or_failure(trial, {"strength": strength}, found)


def _draw(config: NextMotion, trial: TracedArm) -> _Arm:
    rng = np.random.default_rng([config.seed, zlib.crc32(trial.id.encode())])
    built = replace(
        bench_arm.draw(rng),
        marker_noise=rng.uniform(0.15e-3, 0.5e-3),
        load_noise=rng.uniform(0.004, 0.010),
    )
    level = config.level * float(np.exp(rng.uniform(-_SPREAD, _SPREAD)))
    strength = level * bench_arm.TYPICAL[trial.name]
    effects = bench_arm.inject(trial.name, strength, rng)
    return _Arm(built, effects, int(rng.integers(1 << 31)))


def _traced(config: NextMotion, arm: _Arm, folder: Path) -> dict[str, Any]:
    """What each of the three traces found."""
    logs = {stage: folder / f"logs_{stage}" for stage in STAGES}
    _record(logs[BEFORE], arm, config.minutes, 1)
    found = {BEFORE: _trace((logs[BEFORE],), folder / BEFORE)}
    path = folder / "motion.parquet"
    if not path.exists():
        plan(Plan(folder / BEFORE, path, minutes=config.minutes))
    targets = motion.read(path).targets
    _record(logs[RANDOM], arm, config.minutes, 1 + SESSIONS)
    _record(logs[PLANNED], arm, config.minutes, 1 + SESSIONS, targets)
    for stage in (RANDOM, PLANNED):
        found[stage] = _trace((logs[BEFORE], logs[stage]), folder / stage)
    return found


def _trace(logs: tuple[Path, ...], out: Path) -> dict[str, Any]:
    found = trace(Trace(logs, out))
    return {
        "named": [each["name"] for each in found["effects"]],
        "stand_ins": [each["name"] for each in found["stand_ins"]],
        "unexplained": bool(found["unexplained"]["is"]),
        "not_told_apart": sorted(
            each["name"]
            for several in found["rivals"].values()
            for each in several
            if not each["told_apart"]
        ),
        "error_mm": found["error_mm"],
        "seconds": found["seconds"],
    }


def _record(
    folder: Path, arm: _Arm, minutes: float, first: int, targets: Array | None = None
) -> None:
    """Record two sessions of random targets, or of a motion's, unless they are there."""
    steps = len(targets) if targets is not None else int(minutes * 60 * RATE)
    numbers = range(first, first + SESSIONS)
    paths = [folder / f"session_{n:02d}.parquet" for n in numbers]
    if all(path.exists() for path in paths):
        return
    folder.mkdir(exist_ok=True)
    specs = [bench_arm.SessionSpec(arm.built, arm.effects, n, arm.seed, targets) for n in numbers]
    for path, n, arrays in zip(
        paths, numbers, bench_arm.simulate(specs, steps, SUBSTEPS), strict=True
    ):
        write_session(path, session(arrays, folder.parent.name, n))
