"""Compute what no estimator of a force can fall below, by its motors' loads alone."""

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.estimators.force_filter import SIZE, WALK

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
