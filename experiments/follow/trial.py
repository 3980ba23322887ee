"""Let one bench arm follow all paths in all ways."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bench_arm.bus import BenchBus, BenchCameras
from experiments.follow.paths import PATHS
from experiments.result_rows import row_or_failure
from experiments.study_arms import StudyArm, observer_of
from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arrays import Array
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.observer import Observer
from serpent_twin.estimators.weighing_observer import WeighingObserver
from serpent_twin.hardware.limits import Limits
from serpent_twin.live.follower import Follower
from serpent_twin.live.path import PathToFollow
from serpent_twin.live.path_plan import PathPlan
from serpent_twin.live.path_plan import planned as path_planned
from serpent_twin.live.reaching import TIP, JointBounds
from serpent_twin.live.steering import PathSteering
from serpent_twin.recording.loop import record
from serpent_twin.runs.provenance import git_commit
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel
from serpent_twin.stored import within


@dataclass(frozen=True)
class FollowStudy(Checked):
    """Let traced bench arms follow paths, and measure where their tips truly were."""

    study: Path
    """A study of experiments.confusion --source bench --keep, whose arms and twins are taken."""
    out: Path = Path("follow_study")
    """Folder for results; the same command goes on where it stopped."""
    arms: Annotated[int, within(1, 1000)] = 8
    """Arms at most, the first ones of the study."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Arms side by side."""
    device: bool = False
    """Then let the first arm that could, by its own twin, follow the first path in real time, over the wire
    of the emulated motors, at each rate: some five minutes, with nothing beside it."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/follow.md."""


GEOMETRY, NOMINAL, MENDED, FEEDBACK = "geometry", "nominal twin", "its twin", "its twin, feedback"
WAYS = GEOMETRY, NOMINAL, MENDED, FEEDBACK
RATE = 20.0
"""Control steps per second"""
RATES = 4.0, RATE, 100.0
"""Control rates that are tried with feedback on the first path [Hz]"""
EACH = 5
"""The tip's place is kept every so many rows"""
LIMITS = Limits(joint_angle=np.pi / 2)
"""Limits of joint angles, as computed from motor angles on stiff cables; arm.toml has 60° unless changed"""
LOAD = 0.05
"""Taken up half-way along the first path [kg]"""
FIRST = next(iter(PATHS))
LOADED, LOADED_OPEN = "its twin, feedback, 50 g taken up", "its twin, 50 g taken up"
WEIGHED, WEIGHED_LOADED = "its twin, weighing", "its twin, weighing, 50 g taken up"


def run_arm(config: FollowStudy, arm: StudyArm) -> dict[str, Any]:
    """The row of an arm: how far its tip truly was from each path, by each way."""
    return row_or_failure(arm, {"git_commit": git_commit()}, lambda: _followed(arm, arm.twin))


def _followed(arm: StudyArm, twin: TwinModel) -> dict[str, Any]:
    found: dict[str, dict[str, Any]] = {}
    plans, refused = _plans(arm, twin)
    for name, (own, nominal) in plans.items():
        stiff = replace(own.rehearsal, motor_angle=on_stiff_cables(own.joint_angle))
        found[name] = {
            GEOMETRY: _error(arm, replace(own, rehearsal=stiff), twin, keep=name == FIRST),
            NOMINAL: _error(arm, nominal, NOMINAL_TWIN, keep=name == FIRST),
            MENDED: _error(arm, own, twin, keep=name == FIRST),
            FEEDBACK: _error(arm, own, twin, feedback=1.0),
        }
    (own, _), rates = plans[FIRST], {f"{RATE:g}": found[FIRST][FEEDBACK]}
    for rate in set(RATES) - {RATE}:
        plan = _planned(PATHS[FIRST], twin, arm, rate)
        rates[f"{rate:g}"] = _error(arm, plan, twin, feedback=1.0)
    weighing = observer_of(WeighingObserver, arm)
    loaded = {
        LOADED_OPEN: _error(arm, own, twin, load=LOAD),
        LOADED: _error(arm, own, twin, feedback=1.0, load=LOAD),
        WEIGHED_LOADED: _error(arm, own, twin, weighing, feedback=1.0, load=LOAD),
        WEIGHED: _error(arm, own, twin, weighing, feedback=1.0),
    }
    wanted = np.round(own.tip[own.begins :: EACH], 4).tolist()
    return {
        "paths": found,
        "refused": refused,
        "wanted": wanted,
        "rates": rates,
        "loaded": loaded,
    }


def _plans(
    arm: StudyArm, twin: TwinModel
) -> tuple[dict[str, tuple[PathPlan, PathPlan]], dict[str, str]]:
    """How each path is followed, by the arm's own twin and by the nominal one; and why others were refused.
    Without the first path there is nothing to compare.
    """
    plans: dict[str, tuple[PathPlan, PathPlan]] = {}
    refused: dict[str, str] = {}
    for name, path in PATHS.items():
        try:
            own, nominal = (_planned(path, each, arm, RATE) for each in (twin, NOMINAL_TWIN))
        except SerpentError as error:
            if name == FIRST:
                raise
            refused[name] = str(error)
        else:
            plans[name] = own, nominal
    return plans, refused


def _planned(path: PathToFollow, twin: TwinModel, arm: StudyArm, rate: float) -> PathPlan:
    return path_planned(path, twin, rate, JointBounds.usual(), LIMITS, arm.runtime)


def _error(
    arm: StudyArm,
    plan: PathPlan,
    twin: TwinModel,
    estimator: Observer | None = None,
    feedback: float = 0.0,
    load: float = 0.0,
    keep: bool = False,
) -> Mapping[str, Any]:
    """How far the tip truly was from the path [mm], at last in its last sixth, and how long a cycle took
    [ms]; where it was, if that is to be kept [m], (T, 3). The twin estimates, or an observer.
    """
    made, effects = arm.built()
    bus = BenchBus(made, effects, seed=arm.seed, prior_runtime=arm.runtime)
    estimator = estimator or Observer.of(twin)
    follower = Follower(estimator, plan.rows, prior_runtime=arm.runtime)
    steering = PathSteering(plan, twin, follower, feedback)
    tip: list[Array] = []
    half = (plan.begins + plan.rows) // 2
    with bus:
        for n, _ in enumerate(record(bus, BenchCameras(bus), steering, plan.period)):
            if load and n == half:
                bus.take_up(load)
            origin, rotation = bus.frames
            tip.append(origin[-1] + rotation[-1] @ TIP)
    rows = slice(half if load else plan.begins, None)
    off = 1e3 * np.linalg.norm(np.array(tip) - plan.tip, axis=1)[rows]
    last = off[-((plan.rows - plan.begins) // 6) :]
    took = follower.update_ms[np.isfinite(follower.update_ms)]
    return {
        "tip": np.round(np.array(tip)[plan.begins :: EACH], 4).tolist() if keep else None,
        "mean": float(off.mean()),
        "rms": float(np.sqrt((off**2).mean())),
        "last_rms": float(np.sqrt((last**2).mean())),
        "max": float(off.max()),
        "median_ms": float(np.median(took)),
        "p99_ms": float(np.quantile(took, 0.99)),
    }


def rms(rows: Sequence[Mapping[str, Any]], path: str, way: str) -> Array:
    """The rms error on a path [mm] of all arms that it was not refused, (A,)."""
    return np.array([row["paths"][path][way]["rms"] for row in rows if path in row["paths"]])
