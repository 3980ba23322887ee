"""Place logged arms on the chart of the sweep, and measure their distance from the twin there."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.stiffness_sweep.cable_law import CableLaw, cable_laws
from experiments.stiffness_sweep.kinematic_calibration import Kinematics, calibrate
from experiments.stiffness_sweep.plan import SweepPlan
from serpent_twin import reservoir
from serpent_twin.arm.geometry import ARM, N_JOINTS, joint_from_motor
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import Estimator
from serpent_twin.numerals import counted
from serpent_twin.readouts.score import score
from serpent_twin.reservoir import channels, pose
from serpent_twin.reservoir.grid_point import DROP, WINDOW, GridPoint
from serpent_twin.sessions import Session
from serpent_twin.sim import twin_model
from serpent_twin.training.split import split
from serpent_twin.training.training_run import TrainingRun

HOLDS = 8
"""Greatest delay of the memory of logs, in holds of one target"""
_FEW = 600  # rows by which the kinematics are calibrated


@dataclass(frozen=True)
class Placed(GridPoint):
    """A twin with a logged arm's stiffness and slack, seen by cameras as good as that arm's."""

    marker_noise: float = NOMINAL.marker_noise
    """Noise of a marker's coordinate [m]"""

    @property
    def parameters(self) -> Parameters:
        """Parameters of the arm."""
        return replace(super().parameters, marker_noise=self.marker_noise)


@dataclass(frozen=True)
class ChartPosition:
    """Where an arm lies on the chart."""

    stiffness: float
    """Median over its strands [N/m]"""
    slack: float
    """[m]"""
    source: str
    """How it is known"""


def place(sessions: Sequence[Session], twin: Path | None) -> ChartPosition:
    """Out of a twin.json if there is one, else first guesses from logged poses and loads."""
    if twin:
        return _median(twin_model.read(twin), f"its trace: {twin.parent.name}/{twin.name}")
    training = sessions[:-1]
    found = [law for law in _cable_laws(training) if law]
    if not found:
        raise SerpentError(
            "no motor moves in these logs, so that no cable's law can be identified."
        )
    stiffness, slack = ([getattr(law, of) for law in found] for of in ("stiffness", "slack"))
    source = f"first guesses from {counted(len(training), 'session')}"
    return ChartPosition(float(np.median(stiffness)), float(max(0.0, np.median(slack))), source)


def _median(arm: twin_model.TwinModel, source: str) -> ChartPosition:
    told, parts = arm.parameters, arm.tolerances
    stiffness = told.strand_stiffness * np.exp(np.median(parts.strand_stiffness))
    slack = told.strand_slack + np.median(parts.strand_slack)
    return ChartPosition(float(stiffness), float(max(0.0, slack)), source)


def _cable_laws(sessions: Sequence[Session]) -> list[CableLaw | None]:
    """The law of every cable, by logged poses and loads."""
    marker, motor, velocity, load = (
        np.concatenate([getattr(session, name) for session in sessions])
        for name in ("marker", "motor_position", "motor_velocity", "motor_load")
    )
    start = joint_from_motor(motor[:, :N_JOINTS])
    built = _kinematics(marker, start).deviations.built(ARM)
    return cable_laws(joints_from_markers(marker, start, built), motor, velocity, load)


def _kinematics(marker: Array, start: Array) -> Kinematics:
    """An arm's kinematics by some of the rows of logged markers, (N, 9, 3), and joint angles, (N, 9)."""
    few = slice(None, None, max(1, len(marker) // _FEW))
    return calibrate(marker[few], start[few])


def placed(sessions: Sequence[Session], at: ChartPosition, plan: SweepPlan) -> dict[str, Any]:
    """Errors of readouts and memory of a logged arm, and of the twin at its place, in as many rows."""
    rows, rate = min(map(len, sessions)), sessions[0].rate_hz
    alike = replace(plan.measuring, sessions=len(sessions), session_steps=rows, session_rate=None)
    usual = vars(plan.point(at.stiffness, slack=at.slack, rate=rate))
    point = Placed(**usual, marker_noise=noise(sessions))
    readouts = (*plan.measuring.readouts, *plan.networks)
    twins = [pose.session(point, alike, n) for n in range(1, len(sessions) + 1)]
    logs = [session[:rows] for session in sessions]
    mm = {who: errors(of, readouts) for who, of in (("logs", logs), ("twin", twins))}
    return {
        "place": asdict(at),
        "marker_noise_mm": 1e3 * point.marker_noise,
        "rows": rows * len(logs),
        "pose_mm": mm["logs"],
        "twin_pose_mm": mm["twin"],
        "memory": memory(logs),
        "twin_memory": memory(twins),
        "refused": refused(logs),
    }


def noise(sessions: Sequence[Session]) -> float:
    """Standard deviation of a marker's coordinate [m]: what no pose of the arm explains."""
    marker = np.concatenate([session.marker for session in sessions])
    motor = np.concatenate([session.motor_position for session in sessions])
    return _kinematics(marker, joint_from_motor(motor[:, :N_JOINTS])).rms


def errors(sessions: Sequence[Session], names: Sequence[str]) -> dict[str, float]:
    """Mean marker distance [mm] of readouts on the last session, trained on the others."""
    test = split(sessions).windows(WINDOW, DROP)[2].sessions[0]
    estimates = {name: trained(name, sessions).follow(test).marker for name in names}
    return {name: score(each, test.marker).mean_mm for name, each in estimates.items()}


def trained(name: str, sessions: Sequence[Session]) -> Estimator:
    """An estimator that has learned from all sessions but the last."""
    train, steer, _ = split(sessions).windows(WINDOW, DROP)
    estimator = TrainingRun(name, WINDOW, Path()).untrained()
    estimator.trained.fit(train, steer, np.random.default_rng(0))
    return estimator


def refused(sessions: Sequence[Session]) -> str:
    """Why the commands of logs, row by row, measure no capacities, in the words of `check_inputs`."""
    rows = min(map(len, sessions))
    commands = np.stack([_scaled(session.joint_target[:rows]) for session in sessions])
    try:
        reservoir.check_inputs(commands, 3, (HOLDS, 3, 1))
    except SerpentError as error:
        return str(error)
    return ""


def memory(sessions: Sequence[Session]) -> dict[str, Any]:
    """Linear memory of targets, one row for each hold, by channel set; a sentence where there is none."""
    held = [_holds(session) for session in sessions]
    count = min(len(inputs) for inputs, _ in held)
    inputs, states = (np.stack([each[k][:count] for each in held]) for k in (0, 1))
    return {name: _memory(states[..., of], inputs) for name, of in channels.SETS.items()}


def _memory(states: Array, inputs: Array) -> dict[str, Any]:
    try:
        found = reservoir.memory(states, inputs, HOLDS)
    except SerpentError as error:
        return {"left_out": str(error)}
    mean = found.mean_delay if np.isfinite(found.mean_delay) else None
    return {
        "profile": found.profile.sum(axis=0).tolist(),
        "total": found.total,
        "mean_delay_holds": mean,
        "rows": found.T,
        "rank": found.r,
        "cut": found.cut,
    }


def _holds(session: Session) -> tuple[Array, Array]:
    """Targets on [−1, 1], (n, 9), and motor angles and loads at the end of each one's hold, (n, 20)."""
    change = np.any(np.diff(session.joint_target, axis=0) != 0, axis=1)
    starts = np.concatenate([[0], 1 + np.flatnonzero(change)])
    both = np.concatenate([session.motor_position, session.motor_load], axis=1)
    return _scaled(session.joint_target[starts[:-1]]), both[starts[1:]]


def _scaled(target: Array) -> Array:
    """Published targets [rad], (T, 9), on [−1, 1]: those of even joints are drawn from 0 up."""
    unit = target / ARM.target_range
    return np.where(np.arange(N_JOINTS) % 2 == 0, unit, 2 * unit - 1)


def disagreement(found: Mapping[str, Any]) -> str:
    """Differences between the twin at an arm's place and its logs, in a sentence."""
    pairs = [(name, mm, found["twin_pose_mm"][name]) for name, mm in found["pose_mm"].items()]
    told = ", ".join(f"{name} {mm:.1f} mm against {twin:.1f}" for name, mm, twin in pairs)
    delays = [
        (name, each["mean_delay_holds"], found["twin_memory"][name]["mean_delay_holds"])
        for name, each in found["memory"].items()
        if each.get("mean_delay_holds") and found["twin_memory"][name].get("mean_delay_holds")
    ]
    memory = ", ".join(f"{name} {a:.2f} holds against {b:.2f}" for name, a, b in delays)
    return f"logs against twin: {told}" + (f"; mean delay of {memory}" if memory else "")
