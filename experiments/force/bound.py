"""Compute what no estimator of a force can fall below, by its motors' loads alone."""

import numpy as np
from scipy.special import logsumexp

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.estimators.force_filter import ALARM, SIZE, WALK

_TRIALS, _BEFORE = 1000, 60
"""Random courses, and their rows before something pushes"""
_NONE = np.eye(3) * SIZE**2


class Bound:
    """The covariance of a force's error for one who knows the arm, the link, and since when it is pushed.

    Only the noise of the loads is left, and a force that wanders as the filter takes it to. Motors that
    stand tell nothing: their gears' friction may take up any change. Source: Tichavsky et al., IEEE Trans.
    Signal Process. 46 (1998) 1386, of linear models.

    What the loads since the push began tell of its force is `told`, the inverse of a covariance [1/N²],
    (3, 3); `pull` is that times the force [1/N], (3,), and `worth` by how many squared standard errors the
    loads differ from those of none.
    """

    def __init__(self, load_noise: float) -> None:
        """`load_noise` is a share of the stall torque."""
        self._noise = load_noise
        self.begin()

    def begin(self) -> None:
        """Nothing is known of the force, but its size."""
        self._covariance = _NONE
        self.told, self.pull, self.worth = np.zeros((3, 3)), np.zeros(3), 0.0

    def row(self, slope: Array, force: Array, interval: float) -> float:
        """Mean square of the error at least [N²], after a row of turning motors with slopes [1/N], (M, 3),
        by a force [N], (3,).
        """
        fade = np.exp(-(WALK**2) * interval / SIZE**2)
        before = fade * self._covariance + (1 - fade) * _NONE
        told = slope.T @ slope / self._noise**2
        self.told, self.pull = self.told + told, self.pull + told @ force
        self.worth += float(force @ told @ force)
        self._covariance = np.linalg.inv(np.linalg.inv(before) + told)
        return float(np.trace(self._covariance))


def found_by_ideal(told: Array, pull: Array, rows: int, interval: float) -> float:
    """Probability that the ideal detector reports a push in its first rows, which are `interval` [s] apart.
    `told` and `pull` are what `Bound` has of these rows.

    The detector knows the arm, but not when something pushes, where, or with which force. Its false reports
    are at least `ALARM` apart on average. It sums likelihood ratios over all rows in which the push may have
    begun (Shiryaev and Roberts, as in `FeltForce.touched`), each averaged over forces as the filter expects
    them. All links are equally probable; what the loads seem to say of the other links is left out.
    Simulated.
    """
    size, axes = np.linalg.eigh(told / rows)
    each = np.clip(size, 0.0, None)  # information of a row along each axis
    rng, begins = np.random.default_rng(0), _BEFORE + rows
    score = np.sqrt(each) * rng.standard_normal((_TRIALS, begins, 3))
    score[:, _BEFORE:] += axes.T @ pull / rows
    found = np.zeros(_TRIALS, bool)
    for seen in range(_BEFORE + 1, begins + 1):
        since = np.cumsum(score[:, :seen][:, ::-1], axis=1)
        known = np.arange(1, seen + 1)[:, None] * each
        likely = 0.5 * (since**2 / (known + SIZE**-2) - np.log1p(SIZE**2 * known)).sum(axis=-1)
        found |= logsumexp(likely, axis=1) - np.log(N_JOINTS) > np.log(ALARM / interval)
    return float(found.mean())
