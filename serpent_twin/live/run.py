"""Run an estimator along with the moving arm."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from serpent_twin.estimators import Estimator
from serpent_twin.hardware.cameras import NoMocap
from serpent_twin.live.arm import Drive
from serpent_twin.live.figures import Course
from serpent_twin.live.follower import COLUMNS, Follower
from serpent_twin.live.options import Estimate
from serpent_twin.live.sample import Page
from serpent_twin.live.stream import RerunStream
from serpent_twin.recording import run_settings, simulated
from serpent_twin.recording.ending import sealed, stopped_by_signals
from serpent_twin.recording.loop import Beside, Row, record
from serpent_twin.sim import twin_model


@dataclass(frozen=True)
class LivePlan:
    """A config with its estimator and its drive, checked."""

    config: Estimate
    """The config"""
    estimator: Estimator
    """What estimates"""
    drive: Drive
    """What moves, and where its log goes"""
    note: str = ""
    """Which arm is simulated; empty for the real one"""
    trained_on_it: bool | None = None
    """Whether the estimator was trained on the simulated arm; None if that is not known"""

    @property
    def session(self) -> Path:
        """The log."""
        return run_settings.session_path(self.drive, 1)


def run(plan: LivePlan, follower: Follower, course: Course) -> None:
    """Drive the arm, let the estimator follow it, log both, and show them."""
    about: dict[str, Any] = {
        "estimate": {"readout": plan.estimator.name, "model": str(plan.config.model)}
    }
    if plan.config.prior_runtime_h:
        about["prior_runtime_s"] = plan.config.prior_runtime_s
    with ExitStack() as stack:
        stream = _stream(plan, stack) if plan.config.record or plan.config.view else None

        def see(row: Row) -> None:
            follower.learn(row["marker"])
            course.see(row)
            if stream:
                stream.see(row, follower.covariance[follower.rows - 1])

        beside = Beside(COLUMNS, follower.columns, about, see, course.end)
        if plan.config.backend == "real":
            from serpent_twin.recording import real  # not before its port is checked

            real.record_all(plan.drive, [1], beside)
        else:
            _simulate(plan, beside)


def _simulate(plan: LivePlan, beside: Beside) -> None:
    drive = plan.drive
    arm, targets = simulated.simulated_arm(drive, 1, drive.prior_runtime)
    cameras = arm.cameras if plan.config.markers else NoMocap()
    markers = "simulated" if plan.config.markers else "none"
    about = run_settings.metadata(drive, 1) | {"markers": markers} | dict(beside.about)
    if drive.own:
        path = str(plan.config.model / "readout.json")
        about["twin"] = {"path": path, "design": twin_model.to_dict(drive.own)}
    with (
        stopped_by_signals(),
        tqdm(total=drive.steps, unit="row") as bar,
        sealed(plan.session, about, beside.columns, dict) as journal,
        arm.bus,
    ):
        period = 1 / drive.rate_hz
        for row in record(arm.bus, cameras, targets, arm.gain, period, beside.further):
            journal.append(row)
            beside.see(row)
            bar.update()


def _stream(plan: LivePlan, stack: ExitStack) -> RerunStream:
    config, drive = plan.config, plan.drive
    about = f"{drive.arm_name}, backend `{config.backend}`, {config.rate_hz:g} Hz"
    file = plan.session.with_suffix(".rrd") if config.record else None
    return stack.enter_context(RerunStream(Page(plan.estimator.name, about, file, config.view)))
