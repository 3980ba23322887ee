"""Hold estimated markers and their covariance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.readouts.covariance import SHARE, reach2


@dataclass(frozen=True)
class Belief:
    """Marker positions of N rows, and the covariance of each one's error."""

    marker: Array
    """[m], (N, 9, 3)"""
    covariance: Array
    """Covariance of measured markers about the estimate, the cameras' noise included [m²], (N, 9, 3, 3); NaN
    where a readout states none
    """

    @property
    def spread(self) -> Array:
        """Root mean square of the expected error of each marker [m], (N, 9)."""
        return np.sqrt(np.trace(self.covariance, axis1=-2, axis2=-1))

    def distance2(self, measured: Array) -> Array:
        """Squared Mahalanobis distances of measured markers [m], (N, 9, 3); (N, 9), NaN where lost."""
        off = (measured - self.marker)[..., None]
        return (np.swapaxes(off, -1, -2) @ np.linalg.solve(self.covariance, off))[..., 0, 0]

    def coverage(self, measured: Array, share: float = SHARE) -> float:
        """Share of the measured markers that lie within their ellipsoids of that share."""
        far = self.distance2(measured)
        return float((far[np.isfinite(far)] <= reach2(share)).mean())

    def scale_to(self, measured: Array) -> Array:
        """Factor of each marker's covariance with which its ellipsoids hold it in 95 %, (9,)."""
        return np.nanquantile(self.distance2(measured), SHARE, axis=0) / reach2()


def unknown() -> Belief:
    """One row of NaN: nothing is known."""
    return Belief(np.full((1, N_JOINTS, 3), np.nan), np.full((1, N_JOINTS, 3, 3), np.nan))


def joined(beliefs: Sequence[Belief]) -> Belief:
    """Beliefs of several sessions one after the other."""
    return Belief(
        np.concatenate([each.marker for each in beliefs]),
        np.concatenate([each.covariance for each in beliefs]),
    )


def require_finite(
    belief: Belief, readout: str, when: str, states_covariance: bool = False
) -> None:
    """Raise a `SerpentError` if an estimate of a readout, by name, or a covariance that it states is not a
    number.
    """
    found = {"an estimate": belief.marker}
    if states_covariance:
        found["a covariance"] = belief.covariance
    for what, values in found.items():
        if not np.isfinite(values).all():
            raise SerpentError(
                f"the readout {readout} gives {what} that is not a number, {when}: its weights are damaged, "
                "or the readings are far from all that it was trained on. Train it again, or leave it out."
            )
