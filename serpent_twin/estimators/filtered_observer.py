"""Correct the simulated twin by the measured loads."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.estimators.observer import TURNING, LiveObserver, Observer
from serpent_twin.readouts import Progress
from serpent_twin.readouts.saved import Wanted, numbers
from serpent_twin.readouts.windows import Windows
from serpent_twin.stored import many, within

_Scatter = Annotated[float, within(0.0, 1.0, "rad")]


@dataclass
class FilteredObserver(Observer):
    """Ours: the observer as an ensemble Kalman filter of the joint angles, corrected by the loads.

    Its members' joints are scattered before each correction, by the amount with the least validation error:
    with none it is the observer. Source: Evensen, J. Geophys. Res. 99 (1994) 10143, with perturbed
    observations (Burgers, Mon. Weather Rev. 126 (1998) 1719).
    """

    name: ClassVar[str] = "filtered_observer"
    about: ClassVar[str] = "ours: the observer, corrected by loads (ensemble Kalman filter)"

    members: Annotated[int, within(2, 1000)] = 24
    """Runs of the twin side by side"""
    scatters: Annotated[tuple[_Scatter, ...], many(1, 100)] = (
        0.0,
        5e-4,
        1e-3,
        2e-3,
        4e-3,
    )
    """Standard deviations of each joint's scatter in a control step, to choose from [rad]"""

    def wanted(self) -> Wanted:
        """The chosen scatter [rad], and the error with each scatter tried [mm]."""
        chosen = {"scatter": numbers(low=0.0), "tried_mm": numbers(len(self.scatters), low=0.0)}
        return super().wanted() | chosen

    def live(self, prior_runtime: float = 0.0) -> LiveObserver:
        """An estimator for one session of an arm after `prior_runtime` in earlier sessions [s]."""
        scatter = float(self.learned.get("scatter", 0.0))
        if not scatter:
            return LiveObserver(self, prior_runtime)
        return LiveFilter(self, scatter, prior_runtime)

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        best: dict[str, Array] = {}
        load, tried_mm = None, list[float]()  # the rms error with each scatter
        for done, scatter in enumerate(self.scatters, 1):
            self.learned = {"scatter": np.array(scatter)} | ({} if load is None else {"load": load})
            super()._learn(train, validate, rng, lambda *_: None)
            load = self.learned["load"] if load is None else load
            error = self._rms_mm()
            if error < min(tried_mm, default=np.inf):
                best = self.learned
            tried_mm.append(error)
            progress(done, len(self.scatters), error)
        self.learned = best | {"tried_mm": np.array(tried_mm)}


class LiveFilter(LiveObserver):
    """Members of one session, corrected together row by row."""

    def __init__(self, observer: FilteredObserver, scatter: float, prior_runtime: float) -> None:
        super().__init__(observer, prior_runtime, [observer.arm] * observer.members)
        self._scatter, self._rng = scatter, np.random.default_rng(0)
        self._noise: Any = observer.learned["load"]

    def step(self, now: BusReading) -> None:
        """Simulate the members to this reading, and correct their joints by its loads."""
        super().step(now)
        turning = np.abs(now.velocity) > TURNING
        turning[-1] = False  # the gripper's cable pulls at the jaw
        if not turning.any():
            return
        joint = self.members.joint_angle
        joint = joint + self._scatter * self._rng.standard_normal(joint.shape)
        self.arms.nudge(joint)
        predicted, noise = self.arms.read().load[:, turning], self._noise[turning]
        seen = now.load[turning] + noise * self._rng.standard_normal(predicted.shape)
        off_joint, off_load = joint - joint.mean(axis=0), predicted - predicted.mean(axis=0)
        among = off_load.T @ off_load / (len(joint) - 1) + np.diag(noise**2)
        gain = np.linalg.solve(among, off_load.T @ off_joint / (len(joint) - 1)).T
        self.arms.nudge(joint + (seen - predicted) @ gain.T)
        self.members = self.arms.read()
