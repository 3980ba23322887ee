"""Estimate the markers after each reading, and time each estimate."""

import time

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.estimators import Estimator
from serpent_twin.estimators.belief import Belief, require_finite
from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.estimators.estimator import Weighed
from serpent_twin.estimators.force_filter import FeltForce
from serpent_twin.estimators.online import Online
from serpent_twin.recording.loop import Step, StepReading

MARKERS = tuple(f"estimate{i}_{axis}" for i in range(1, N_JOINTS + 1) for axis in "xyz")
SPREADS = tuple(f"estimate{i}_spread" for i in range(1, N_JOINTS + 1))
LATENCY = "estimate_latency_ms"
COLUMNS = (*MARKERS, *SPREADS, LATENCY)
"""Further columns of a log: markers [m], the root mean square of the error to expect of each [m], and the
time from the reading to its estimate [ms], in which the command is sent, too. NaN where there is no estimate.
"""


class Follower:
    """An estimator that follows one session, and keeps all its estimates: one row a step, NaN where none."""

    def __init__(
        self, estimator: Estimator, rows: int, learns: bool = False, prior_runtime: float = 0.0
    ) -> None:
        """`learns`: markers given to `learn` correct later estimates. `prior_runtime` is how long the arm
        ran before this session [s], for effects of wear in the estimator's twin.
        """
        self._name, self._states_covariance = estimator.name, estimator.states_covariance
        self._warm_up(estimator)
        live = estimator.live(prior_runtime)
        self._live = Online(live) if learns else live
        self.rows = 0
        self.marker = np.full((rows, N_JOINTS, 3), np.nan)
        self.covariance = np.full((rows, N_JOINTS, 3, 3), np.nan)
        self.update_ms = np.full(rows, np.nan)
        self._belief: Belief | None = None
        self._latency = np.nan

    def update(self, now: StepReading) -> Belief | None:
        """The estimate of a step; the present markers are not used."""
        reading = BusReading(
            now.time, now.state.position, now.state.velocity, now.state.load, now.before
        )
        began, k = time.perf_counter(), self.rows
        self._belief = belief = self._live.update(reading)
        self.rows += 1
        self._latency = 1e3 * (time.perf_counter() - now.read_at)
        if belief is not None:
            self.update_ms[k] = 1e3 * (time.perf_counter() - began)
            self._require_finite(belief, f"{now.time:.3g} s after the first row")
            self.marker[k], self.covariance[k] = belief.marker[0], belief.covariance[0]
        return belief

    def columns(self, step: Step) -> dict[str, float]:
        """The log's columns of a step, which may be estimated already."""
        belief = self.update(step) if self.rows == step.number else self._belief
        if belief is None:
            return dict.fromkeys(COLUMNS, np.nan)
        values = [*belief.marker.ravel(), *belief.spread.ravel(), self._latency]
        return dict(zip(COLUMNS, values, strict=True))

    def learn(self, marker: Array) -> None:
        """Take the markers of the step that was estimated last [m], (9, 3), NaN where lost."""
        self._live.correct(marker)

    def force(self) -> FeltForce | None:
        """The force on the arm in the step that was estimated last, if the estimator feels one."""
        return self._live.force()

    def weighed(self) -> Weighed:
        """Parameters of the arm identified from the loads, if the estimator does so."""
        return self._live.weighed()

    def belief(self, where: NDArray[np.intp]) -> Belief:
        """The estimates of these rows."""
        return Belief(self.marker[where], self.covariance[where])

    def _warm_up(self, estimator: Estimator) -> None:
        """Let the estimator load all that it needs before a motor turns, and check that its estimates are
        finite.
        """
        live, still = estimator.live(), np.zeros(N_MOTORS)
        for k in range(estimator.warm_up_rows):
            now = BusReading(k / (estimator.trained.rate_hz or 4.0), still, still, still, still)
            if (belief := live.update(now)) is not None:
                self._require_finite(belief, "of an arm that hangs straight")

    def _require_finite(self, belief: Belief, when: str) -> None:
        require_finite(belief, self._name, when, self._states_covariance)
