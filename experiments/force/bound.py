"""Compute what no estimator of a force can fall below, by its motors' loads alone."""

from functools import cache

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.estimators.force_filter import ALARM, SIZE, WALK

_TRIALS, _BEFORE = 4000, 100
"""Random courses, and their rows before something pushes"""
_NONE = np.eye(3) * SIZE**2


class Bound:
    """The covariance of a force's error for one who knows the arm, the link, and since when it is pushed.

    Only the noise of the loads is left, and a force that wanders as the filter takes it to. Motors that
    stand tell nothing: their gears' friction may take up any change. Source: Tichavsky et al., IEEE Trans.
    Signal Process. 46 (1998) 1386, of linear models.
    """

    def __init__(self, load_noise: float) -> None:
        """`load_noise` is a share of the stall torque."""
        self._noise, self._covariance = load_noise, _NONE
        self.worth = 0.0
        """Squared standard errors that the loads since the push began differ by from those of none"""

    def begin(self) -> None:
        """Nothing is known of the force, but its size."""
        self._covariance, self.worth = _NONE, 0.0

    def row(self, slope: Array, force: Array, interval: float) -> float:
        """Mean square of the error at least [N²], after a row of turning motors with slopes [1/N], (M, 3),
        by a force [N], (3,).
        """
        fade = np.exp(-(WALK**2) * interval / SIZE**2)
        before = fade * self._covariance + (1 - fade) * _NONE
        told = slope.T @ slope / self._noise**2
        self.worth += float(force @ told @ force)
        self._covariance = np.linalg.inv(np.linalg.inv(before) + told)
        return float(np.trace(self._covariance))


@cache
def found_by_one_who_knows(worth: float, rows: int, interval: float) -> float:
    """Probability that a push is reported in its first rows, [s] apart, whose loads differ by so many squared
    standard errors, by one who knows force and link but not when it begins, and whose false reports are at
    least `ALARM` apart on average. Simulated: the sum of Shiryaev and Roberts, as in `FeltForce.touched`.
    """
    if worth <= 0:
        return 0.0
    rng, each = np.random.default_rng(0), worth / rows
    likely = rng.normal(-0.5 * each, np.sqrt(each), (_BEFORE + rows, _TRIALS))
    likely[_BEFORE:] += each
    found, log_sum = np.zeros(_TRIALS, bool), np.full(_TRIALS, -np.inf)
    for n, more in enumerate(likely):
        log_sum = np.logaddexp(0.0, log_sum) + more
        reports = log_sum > np.log(ALARM / interval)
        found |= reports & (n >= _BEFORE)
        log_sum[reports] = -np.inf
    return float(found.mean())
