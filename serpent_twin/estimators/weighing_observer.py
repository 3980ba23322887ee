"""Estimate the mass in the gripper from the loads."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from serpent_twin import effects
from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Range, ranges, strengths
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.estimators.estimator import Weighed
from serpent_twin.estimators.observer import TURNING, LiveObserver, Observer
from serpent_twin.readouts import Progress
from serpent_twin.readouts.saved import Wanted, divisors, numbers
from serpent_twin.readouts.windows import Windows
from serpent_twin.sim.response import Response
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.stored import many, within

PRIOR = 1.0
"""Standard deviation at the start, in typical values of the parameter"""
WALK = 0.045
"""Standard deviation of its change in a second, in the same unit"""
NEAR = 0.05
"""How far neighbours are from the twin, in the same unit; where an arm buckles, far ones are in another
pose"""
FURTHEST = 5.0
"""How far it may be from the twin's value, in the same unit"""
COST = 1.1
"""Times the least error on the validation sessions that following faster may cost"""

_Caution = Annotated[float, within(1e-6, 1e9)]


@dataclass
class WeighingObserver(Observer):
    """Ours: the observer that identifies the payload's mass from the loads, and adds it to the twin.

    An extended Kalman filter of parameters of the twin: next to it run twins that differ a little in one
    parameter each, which give the derivatives of loads and pose. Validation sessions select the inflation of
    the loads' noise; of an arm that does not change its error is a little larger than the observer's, because
    it follows noise. Source: Anderson and Moore, Optimal Filtering (1979), chapter 8, with secants for
    derivatives.
    """

    name: ClassVar[str] = "weighing_observer"
    about: ClassVar[str] = (
        "ours: the observer, its twin's payload followed by loads (extended Kalman filter)"
    )

    unknown: Annotated[tuple[str, ...], many(1, 20)] = ("payload",)
    """Effects whose strengths are followed: of masses and gravity, such as payload and base_tilt"""
    cautions: Annotated[tuple[_Caution, ...], many(1, 100)] = (
        100.0,
        30.0,
        10.0,
        3.0,
        1.0,
    )
    """Inflations of the loads' variance to choose from: their noise is not white"""

    def wanted(self) -> Wanted:
        """The loads' noise, and the error with each inflation [mm], none first."""
        chosen = {"noise": divisors(N_MOTORS), "tried_mm": numbers(1 + len(self.cautions), low=0.0)}
        return super().wanted() | chosen

    def live(self, prior_runtime: float = 0.0) -> LiveObserver:
        """An estimator for one session of an arm after `prior_runtime` in earlier sessions [s]."""
        if "noise" not in self.learned:
            return LiveObserver(self, prior_runtime)
        return LiveWeighing(self, prior_runtime)

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        super()._learn(train, validate, rng, lambda *_: None)
        load, errors = self.learned["load"], [self._rms_mm()]
        tried = list[dict[str, Array]]()
        for caution in self.cautions:
            self.learned = {"noise": np.sqrt(caution) * load}
            super()._learn(train, validate, rng, lambda *_: None)
            tried.append(self.learned)
            errors.append(self._rms_mm())
            progress(len(tried), len(self.cautions), errors[-1])
        fastest = int(np.flatnonzero(errors[1:] <= COST * np.min(errors[1:]))[-1])
        self.learned = tried[fastest] | {"tried_mm": np.array(errors)}


@dataclass(frozen=True)
class Followed:
    """A parameter of an effect."""

    kind: type[Effect]
    name: str
    within: Range
    value: float
    """The twin's value"""

    @property
    def typical(self) -> float:
        """The unit in which it is followed."""
        return self.within.typical

    @property
    def bounds(self) -> tuple[float, float]:
        """Its greatest change from the twin's value, in typical values."""
        low, high = self.within.low - self.value, self.within.high - self.value
        return max(-FURTHEST, low / self.typical), min(FURTHEST, high / self.typical)

    def added(self, arm: TwinModel, more: float) -> TwinModel:
        """The arm with the parameter increased."""
        held = arm.effect_of(self.kind)
        return arm.with_effect(replace(held, **{self.name: getattr(held, self.name) + more}))


def followed(arm: TwinModel, unknown: Sequence[str]) -> list[Followed]:
    """The strengths of those effects, with an arm's values of them."""
    found = []
    for kind in map(effects.by_name, unknown):
        held, known = arm.effect_of(kind), ranges(kind)
        found += [
            Followed(kind, name, known[name], getattr(held, name)) for name in strengths(known)
        ]
    return found


class LiveWeighing(LiveObserver):
    """The twin of one session with the parameters it follows, and its neighbours in each parameter."""

    def __init__(self, observer: WeighingObserver, prior_runtime: float) -> None:
        self.followed = followed(observer.arm, observer.unknown)
        base = observer.arm
        for each in self.followed:  # above zero, so that all models have one structure
            base = each.added(base, 1e-6 * each.typical)
        further = [each.added(base, NEAR * each.typical) for each in self.followed]
        super().__init__(observer, prior_runtime, [base, *further])
        try:
            self._variation = self.arms.variation()
        except SerpentError as error:
            raise SerpentError(
                f"{', '.join(observer.unknown)} cannot be followed by loads: {error} Follow "
                "payload or base_tilt."
            ) from None
        count = len(self.followed)
        self.amount, self.covariance = np.zeros(count), PRIOR**2 * np.eye(count)
        """What is known of the parameters beyond the twin's own, in typical values, (K,) and (K, K)"""
        self._bounds = np.transpose([each.bounds for each in self.followed])
        self._news = np.zeros(count)
        self._noise: Array = observer.learned["noise"] ** 2

    def step(self, now: BusReading) -> None:
        """Simulate the twins to this reading, and update the parameters from its loads."""
        super().step(now)
        self.covariance = self.covariance + WALK**2 * self._interval * np.eye(len(self.amount))
        turning = np.abs(now.velocity) > TURNING
        turning[-1] = False  # the gripper's cable pulls at the jaw
        before = self.amount
        if turning.any():
            load = self.members.load[:, turning]
            slope = (load[1:] - load[0]).T / NEAR
            seen = slope @ self.covariance
            among = seen @ slope.T + np.diag(self._noise[turning])
            gain = np.linalg.solve(among, seen).T
            self.amount = np.clip(before + gain @ (now.load[turning] - load[0]), *self._bounds)
            self.covariance = self.covariance - gain @ seen
        self._news = self.amount - before
        self._variation.set(self.amount / NEAR + np.vstack([0 * before, np.eye(len(before))]))

    def weighed(self) -> Weighed:
        """The parameters identified so far: each one's value, standard deviation and unit, JSON-ready."""
        spread = np.sqrt(np.diag(self.covariance))
        return {
            f"{effects.name_of(each.kind)}.{each.name}": {
                "value": each.value + each.typical * float(amount),
                "std": each.typical * float(std),
                "unit": each.within.unit,
            }
            for each, amount, std in zip(self.followed, self.amount, spread, strict=True)
        }

    @property
    def sensed(self) -> Response:
        """The twin's readings, after the update from this reading's loads, (1,)."""
        share = self._news / NEAR
        return self.members.each(lambda v: (v[0] + np.tensordot(share, v[1:] - v[0], 1))[None])

    def belief(self, now: BusReading) -> Belief:
        """The twin's estimate of the markers, with a covariance that includes that of the parameters."""
        marker = self.members.marker
        known, moved = super().belief(now), (marker[1:] - marker[0]) / NEAR
        unknown = np.einsum("kmi,kl,lmj->mij", moved, self.covariance, moved)
        return Belief(known.marker, known.covariance + unknown)
