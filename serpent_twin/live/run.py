"""Run an estimator along with the moving arm."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from serpent_twin.errors import SerpentError
from serpent_twin.estimators import Estimator
from serpent_twin.estimators.feeling import Feeling
from serpent_twin.extras import require
from serpent_twin.hardware.cameras import NoMocap
from serpent_twin.live.arm import Drive
from serpent_twin.live.figures import Course, figures
from serpent_twin.live.follower import COLUMNS, Follower
from serpent_twin.live.sample import Page
from serpent_twin.live.stream import RerunStream
from serpent_twin.recording import lost_markers, run_settings, simulated
from serpent_twin.recording.ending import sealed, stopped_by_signals, why
from serpent_twin.recording.loop import NOTHING, Beside, Row, Steering, TargetSteering, record
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sim import twin_model


@dataclass(frozen=True)
class LivePlan:
    """An estimator and what it follows, checked."""

    estimator: Estimator
    """What estimates"""
    drive: Drive
    """What moves, and where its log goes"""
    note: str = ""
    """Which arm is simulated; empty for the real one"""
    trained_on_it: bool | None = None
    """Whether the estimator was trained on the simulated arm; None if that is not known"""
    steering: Steering | None = None
    """What moves the arm; None for random joint targets"""
    beside: Beside = NOTHING
    """What is logged besides the estimates, and what sees each row"""

    @property
    def session(self) -> Path:
        """The log."""
        return run_settings.session_path(self.drive, 1)


def readout_hashes(model: Path) -> dict[str, str]:
    """Hashes of the files of a trained readout, by name."""
    return {name: file_hash(model / name) for name in ("readout.json", "learned.npz")}


def _refuse_second(plan: LivePlan, results: str) -> None:
    """Refuse a folder that holds a run already."""
    out, names = plan.drive.out, (f"{plan.session.stem}.*", results)
    if found := [path for name in names for path in sorted(out.glob(name))]:
        raise SerpentError(
            f"{out} holds a run already ({', '.join(path.name for path in found)}), and an arm that moved is "
            "not gone on with. Nothing was changed: choose another --out."
        )


def run_and_state(
    plan: LivePlan,
    follower: Follower,
    course: Course,
    names: tuple[str, str],
    settings: dict[str, Any],
    found: Callable[[], dict[str, Any]],
    tell: Callable[[Mapping[str, Any]], None],
) -> dict[str, Any]:
    """Run in a folder of its own; returns what its results hold, also of a run that is stopped.

    `names` are those of the files of settings and results. If there are rows, `found` gives the figures of
    the run, and `tell` shows the results.
    """
    if plan.drive.record or plan.drive.view:
        require("rerun", "view", "A recording for rerun", ", or leave it out: --no-record")
    out, (settings_name, results_name) = plan.drive.out, names
    with claimed(out, settings_name, settings):
        _refuse_second(plan, results_name)
        ended = None
        try:
            run(plan, follower, course)
        except BaseException as error:
            ended = why(error)
            raise
        finally:
            results: dict[str, Any] = {"complete": ended is None, "ended": ended}
            results["rate_hz"] = plan.drive.rate_hz
            if course.rows:
                results |= found() | figures(course, follower, 1 / plan.drive.rate_hz)
                results |= {"seed": plan.drive.seed, "settings": settings} | provenance()
                write_json(out / results_name, results)
                tell(results)
        lost_markers.say([plan.session])
    return results


def run(plan: LivePlan, follower: Follower, course: Course) -> None:
    """Drive the arm, let the estimator follow it, log both, and show them."""
    drive, model = plan.drive, plan.drive.readout
    about: dict[str, Any] = {
        "estimate": {"readout": plan.estimator.name} | ({"model": str(model)} if model else {})
    }
    if drive.prior_runtime:
        about["prior_runtime_s"] = drive.prior_runtime
    with ExitStack() as stack:
        stream = _stream(plan, stack) if drive.record or drive.view else None

        def see(row: Row) -> None:
            follower.learn(row["marker"])
            course.see(row)
            if stream:
                stream.see(row, follower.covariance[follower.rows - 1], follower.force())

        estimates = Beside(COLUMNS, follower.columns, about, see, course.end)
        beside = estimates.and_then(plan.beside)
        if drive.backend == "real":
            from serpent_twin.recording import real  # not before its port is checked

            real.record_all(drive, [1], beside, plan.steering)
        else:
            _simulate(plan, beside)


def _simulate(plan: LivePlan, beside: Beside) -> None:
    drive = plan.drive
    arm, targets = simulated.simulated_arm(drive, 1, drive.prior_runtime)
    cameras = arm.cameras if drive.markers else NoMocap()
    markers = "simulated" if drive.markers else "none"
    about = run_settings.metadata(drive, 1) | {"markers": markers} | dict(beside.about)
    if drive.own and drive.readout:
        path = str(drive.readout / "readout.json")
        about["twin"] = {"path": path, "design": twin_model.to_dict(drive.own)}
    beside = beside.and_then(simulated.pushes(drive, arm))
    with (
        stopped_by_signals(),
        tqdm(total=drive.steps, unit="row") as bar,
        sealed(plan.session, about, beside.columns, dict) as journal,
        arm.bus,
    ):
        period = 1 / drive.rate_hz
        steering = plan.steering or TargetSteering(targets, arm.gain)
        for row in record(arm.bus, cameras, steering, period, beside.further):
            journal.append(row)
            beside.see(row)
            bar.update()


def _stream(plan: LivePlan, stack: ExitStack) -> RerunStream:
    drive = plan.drive
    about = f"{drive.arm_name}, backend `{drive.backend}`, {drive.rate_hz:g} Hz"
    file = plan.session.with_suffix(".rrd") if drive.record else None
    page = Page(plan.estimator.name, about, file, drive.view, isinstance(plan.estimator, Feeling))
    return stack.enter_context(RerunStream(page))
