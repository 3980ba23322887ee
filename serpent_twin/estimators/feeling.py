"""Feel the force on the arm: the observer's twin, and what its loads lack."""

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS, markers
from serpent_twin.arm.inverse_kinematics import marker_jacobian
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.estimators.estimator import Estimator
from serpent_twin.estimators.force_filter import FeltForce, ForceFilter, LoadErrors
from serpent_twin.estimators.observer import STILL, TURNING, LiveObserver, Observer
from serpent_twin.readouts.trainable import Trainable
from serpent_twin.sim.twin_model import TwinModel

PERIOD = 0.25
"""Rows that are nearer in time than this weigh no more in all [s]: a twin's errors in them are alike"""
UNSURE = 0.25
"""Relative standard error of a load's change by a force in statics: hinges rub, and the arm is moving"""


class Feeling(Estimator):
    """An observer that feels: its twin is driven by the motors' angles, what loads differ from its own is
    taken for a force on a link, and the pose gives way to that force.
    """

    def __init__(self, observer: Observer) -> None:
        """The observer must be trained, so that the error of its twin's loads is known."""
        self._observer = observer

    @property
    def trained(self) -> Trainable:
        """The observer."""
        return self._observer

    @property
    def own_twin(self) -> TwinModel:
        """The observer's twin."""
        return self._observer.arm

    def live(self, prior_runtime: float = 0.0) -> "LiveFeeling":
        """An estimator for one session of an arm after `prior_runtime` in earlier sessions [s]."""
        return LiveFeeling(self._observer, prior_runtime)


def feeling(estimator: Estimator) -> Feeling:
    """The estimator, feeling; raises a `SerpentError` if it is no trained observer."""
    observer = estimator.trained
    if type(observer) is not Observer or not np.isfinite(observer.learned["load"][:-1]).any():
        raise SerpentError(
            f"the readout {estimator.name} feels no force: that takes an observer, which knows by how much "
            "its twin's loads err. Give one as --model, trained by python -m serpent_twin.train --readout "
            "observer."
        )
    return Feeling(observer)


class LiveFeeling(LiveObserver):
    """The twin of one session, a row at a time, and the force on it."""

    def __init__(self, observer: Observer, prior_runtime: float = 0.0) -> None:
        super().__init__(observer, prior_runtime)
        coloured = observer.coloured_noise
        self._filter, self._friction = ForceFilter(coloured), observer.gear_friction
        load, slow = (observer.learned[name] for name in ("load", "load_slow"))
        self._noise = np.sqrt(load**2 - coloured.variance)
        self._noise_slow = np.sqrt(np.maximum(slow**2 - coloured.variance, self._noise**2))
        self._known = np.isfinite(self._noise) & (np.arange(N_MOTORS) < N_MOTORS - 1)
        """Motor 10's cable pulls at the jaw alone"""

    def step(self, now: BusReading) -> None:
        """Simulate the twin to this reading, and take its loads for what pushes."""
        super().step(now)
        link, force = self._filter.predict(self._interval)
        self._pushed = pushed = self.arms.pushed(link, force)
        free = now.load - self.members.load[0]
        speed = np.abs(now.velocity)
        noise = np.where(speed > TURNING, self._noise, self._noise_slow)
        wider = np.sqrt(max(1.0, PERIOD / self._interval))
        self._felt = self._filter.update(
            LoadErrors(
                free=free,
                pushed=free - pushed.load + pushed.slope[link - 1] @ force,
                slope=pushed.slope,
                noise=np.where(self._known, np.hypot(wider * noise, UNSURE * pushed.load), 1.0),
                friction=np.where(speed > STILL, 0.0, self._friction),
                known=self._known,
            )
        )
        self._about = link, force

    def force(self) -> FeltForce:
        """The force on the arm with the last reading."""
        return self._felt

    def belief(self, now: BusReading) -> Belief:
        """The twin's markers as the force moves them, with a covariance that includes the force's."""
        known, felt, (link, force) = super().belief(now), self._felt, self._about
        share, turning = felt.contact * felt.links, self._pushed.turning
        first = self._pushed.turned - turning[link - 1] @ force
        by_link = first + np.einsum("ljx,lx->lj", turning, felt.on_link)
        turned = share @ by_link
        apart = by_link - turned
        each = turning @ felt.on_link_covariance @ np.swapaxes(turning, -1, -2)
        spread = np.einsum("l,ljk->jk", share, each + apart[:, :, None] * apart[:, None, :])
        spread += (1 - felt.contact) * np.outer(turned, turned)
        angle = self.members.joint_angle + turned
        built = self._observer.arm.built
        before = markers(self.members.joint_angle, built)
        after, slope, _ = marker_jacobian(angle, built)
        by_joint = slope.reshape(-1, 3, len(turned))
        unknown = by_joint @ spread @ np.swapaxes(by_joint, -1, -2)
        return Belief(known.marker + after - before, known.covariance + unknown)
