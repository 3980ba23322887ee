"""Follow a path: plan, drive, and state how near the gripper's end was."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from serpent_twin import estimators
from serpent_twin.arrays import Array
from serpent_twin.command_line.program import as_started
from serpent_twin.estimators import Estimator
from serpent_twin.estimators.observer import Observer
from serpent_twin.hardware.limits import Limits
from serpent_twin.live import path as paths
from serpent_twin.live.arm import Drive
from serpent_twin.live.figures import Course
from serpent_twin.live.follow_options import Follow
from serpent_twin.live.follower import Follower
from serpent_twin.live.path import PathToFollow
from serpent_twin.live.path_picture import drawn
from serpent_twin.live.path_plan import PathPlan, planned, slack_cables
from serpent_twin.live.reaching import JointBounds
from serpent_twin.live.run import LivePlan, readout_hashes, run_and_state
from serpent_twin.live.steering import COLUMNS, PathSteering
from serpent_twin.numerals import listed
from serpent_twin.recording import collect, run_settings
from serpent_twin.recording.loop import Beside
from serpent_twin.runs.files import write_whole
from serpent_twin.runs.provenance import file_hash
from serpent_twin.runs.report import as_png
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN

SETTINGS = "follow.json"
RESULTS = "results.json"
PICTURE = "path.png"
_BY_NOMINAL = (
    "No --twin: the nominal twin plans and estimates. So an arm that was built misses its path by "
    "centimetres; with its own twin.json, of python -m serpent_twin.trace, by millimetres."
)  # docs/results/follow.md: 45 … 75 mm and 1.3 … 2.1 mm


def follow(config: Follow) -> dict[str, Any]:
    """Plan, drive and log; returns what results.json holds, also of a run that is stopped."""
    twin = twin_model.read(config.twin) if config.twin else NOMINAL_TWIN
    way = paths.read(config.path)
    if config.twin is None:
        print(as_started(_BY_NOMINAL))
    estimator = _estimator(config, twin)
    estimator.require_rate(config.rate_hz)
    plan = _rehearsed(config, way, twin)
    print(_said(plan))
    drive = _drive(config, plan)
    follower = Follower(estimator, plan.rows, prior_runtime=config.prior_runtime_s)
    steering = PathSteering(plan, twin, follower, config.feedback)
    beside = Beside(COLUMNS, steering.columns, {"path": _about(config)})
    live = LivePlan(estimator, drive, steering=steering, beside=beside)
    course = Course(plan.rows)
    said = run_settings.settings(drive) | _about(config)

    def tell(results: Mapping[str, Any]) -> None:
        print(_told(results))
        write_whole(config.out / PICTURE, as_png(_drawn(plan, steering, course)))

    def found() -> dict[str, Any]:
        return _errors(plan, steering, course)

    return run_and_state(live, follower, course, (SETTINGS, RESULTS), said, found, tell)


def _rehearsed(config: Follow, way: PathToFollow, twin: twin_model.TwinModel) -> PathPlan:
    bounds, limits = JointBounds.usual(config.wider), _limits(config)
    with tqdm(desc="on the twin", unit="rehearsal") as bar:

        def tell(missed: float) -> None:
            bar.set_postfix_str(
                f"joints miss their angles by {1e3 * missed:.2f} mrad", refresh=False
            )
            bar.update()

        return planned(way, twin, config.rate_hz, bounds, limits, config.prior_runtime_s, tell)


def _on_path(plan: PathPlan, steering: PathSteering, course: Course) -> NDArray[np.intp]:
    """The control steps that were driven on the path itself."""
    return np.flatnonzero(steering.planned[: course.rows] >= plan.begins)


def _drawn(plan: PathPlan, steering: PathSteering, course: Course) -> Any:
    rows = _on_path(plan, steering, course)
    time = (steering.planned[rows] - plan.begins) * plan.period
    tips = {"as estimated": steering.estimated[rows]}
    return drawn(time, steering.tip_wanted[rows], tips)


def _estimator(config: Follow, twin: twin_model.TwinModel) -> Estimator:
    """What estimates: a trained readout, of an observer with this twin, or the twin itself."""
    if config.model is None:
        return Observer.of(twin)
    trained = estimators.load(config.model)
    return trained.with_twin(twin) if trained.takes_twin else trained


def _limits(config: Follow) -> Limits:
    if config.backend == "sim":
        return Limits()
    from serpent_twin.recording.real_arm import arm_of

    return arm_of(Drive.of(config)).limits


def _drive(config: Follow, plan: PathPlan) -> Drive:
    """What moves, checked."""
    simulated = (config.simulate or config.twin) if config.backend == "sim" else None
    drive = Drive.of(config, steps=plan.rows, twin=simulated)
    collect.check(drive)
    return drive


def _about(config: Follow) -> dict[str, Any]:
    """What decides on the motion, with the hashes of its files."""
    about: dict[str, Any] = {
        "path_sha256": file_hash(config.path),
        "twin_sha256": file_hash(config.twin) if config.twin else None,
    }
    about |= {"feedback": config.feedback, "wider": config.wider}
    if config.model:
        about["readout_sha256"] = readout_hashes(config.model)
    return about


def _errors(plan: PathPlan, steering: PathSteering, course: Course) -> dict[str, Any]:
    """How far the gripper's end was from the path: as estimated, and the last marker as measured."""
    rows = _on_path(plan, steering, course)
    off = steering.estimated[rows] - steering.tip_wanted[rows]
    estimated = np.linalg.norm(off, axis=1)
    wanted = steering.markers_wanted[rows, -1]
    marker = np.linalg.norm(course.measured[rows, -1] - wanted, axis=1)
    return {
        "path_rows": len(estimated),
        "tip_error_as_estimated_mm": _summary(estimated),
        "marker9_error_mm": _summary(marker),
        "tip_error_rehearsed_mm": _summary(plan.short[plan.begins :]),
        "most_feedback_rad": float(np.abs(steering.most_added).max()),
    }


def _summary(error: Array) -> dict[str, float] | None:
    """Mean, rms and maximum of the finite errors [m], in mm; None if there are none."""
    known = 1e3 * error[np.isfinite(error)]
    if not known.size:
        return None
    return {
        "mean": float(known.mean()),
        "rms": float(np.sqrt((known**2).mean())),
        "max": float(known.max()),
    }


def _said(plan: PathPlan) -> str:
    found, lost = _summary(plan.short[plan.begins :]), slack_cables(plan)
    assert found
    told = (
        f"{plan.begins * plan.period:.1f} s to where the path begins, "
        f"{(plan.rows - plan.begins) * plan.period:.1f} s along it; the twin's tip is "
        f"{found['mean']:.1f} mm from it on average, {found['max']:.1f} mm at most."
    )
    if lost:
        told += (
            f" No strand of cable {listed([str(each) for each in lost])} pulls on the whole path: friction "
            "alone holds what it drives, and no motor feels it."
        )
    return told


def _told(results: Mapping[str, Any]) -> str:
    lines = []
    for key, what in (
        ("tip_error_as_estimated_mm", "The gripper's end as estimated"),
        ("marker9_error_mm", "Marker 9 as measured"),
    ):
        if found := results[key]:
            lines.append(
                f"{what}: {found['rms']:.1f} mm rms from the path, {found['max']:.1f} mm at most."
            )
    late, missed = results["latency_ms"], results["missed_deadlines"]
    if late:
        lines.append(
            f"From reading to estimate: median {late['median']:.2f} ms, p99 {late['p99']:.2f} ms."
        )
    if missed is not None:
        lines.append(f"Missed deadlines of the loop: {missed}.")
    return "\n".join(lines)
