"""Compare the errors of two twins on logs that nothing was fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from serpent_twin.arrays import Array, known_mean
from serpent_twin.errors import SerpentError
from serpent_twin.residual import Comparison
from serpent_twin.residual.size import MOVING, is_moving

BLOCKS = 5
"""Parts of a segment in which errors are compared"""
CONFIRMED = 0.2
"""Most probability of chance on the held-out logs alone: few correlated blocks hardly show less"""
_FREEDOM = 0.7  # of the degrees of freedom, as the correlation of few blocks is itself uncertain


@dataclass(frozen=True)
class Errors:
    """Errors of one twin on held-out segments, by block, (S, B), in the rig's units."""

    marker_by_block: Array
    """Mean marker distance; NaN without markers"""
    load_by_block: Array
    """Root mean square of the moving motors' loads; NaN without loads"""
    of_markers: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    """Mean error of each marker, (S, B, M)"""
    of_loads: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    """Root mean square error of each load, (S, B, N)"""

    def at(self, markers: Sequence[int], loads: Sequence[int]) -> "Errors":
        """Errors of some markers and loads alone."""
        marker, load = self.of_markers[..., list(markers)], self.of_loads[..., list(loads)]
        mean, square = (known_mean(each, axis=-1) for each in (marker, load**2))
        return Errors(mean, np.sqrt(square), marker, load)

    @property
    def marker_by_segment(self) -> Array:
        """Mean of each segment, (S,)."""
        return known_mean(self.marker_by_block, axis=1)

    @property
    def marker(self) -> float:
        """Mean over segments."""
        return _mean(self.marker_by_segment)

    @property
    def load(self) -> float:
        """Root mean square in segments, in the mean over these."""
        return _mean(np.sqrt(known_mean(self.load_by_block**2, axis=1)))


def gave_up(before: Errors, after: Errors) -> bool:
    """Whether a twin has no error where another has one: its simulation became unstable."""
    each = ((before.marker, after.marker), (before.load, after.load))
    return any(np.isfinite(a) and not np.isfinite(b) for a, b in each)


def _mean(values: Array) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def blocks(values: Array) -> Array:
    """Means of rows (S, T, …) over what is known of each block, (S, B)."""
    return np.stack(
        [known_mean(part.reshape(len(part), -1), axis=1) for part in _parts(values)], axis=1
    )


def errors(comparison: Comparison) -> Errors:
    """The errors of a comparison, block by block."""
    told = comparison.load_counts is not None
    moving = True if told else is_moving(comparison, MOVING)
    load = np.where(moving, comparison.load.scale * comparison.load_residual, np.nan)
    distance = comparison.marker.scale * comparison.distance
    return Errors(
        blocks(distance), np.sqrt(blocks(load**2)), _each(distance), np.sqrt(_each(load**2))
    )


def _each(values: Array) -> Array:
    """Means of rows (S, T, K) over what is known of each block, (S, B, K)."""
    return np.stack([known_mean(part, axis=1) for part in _parts(values)], axis=1)


def _parts(values: Array) -> list[Array]:
    """Rows (S, T, …) in blocks."""
    return np.array_split(values, min(BLOCKS, values.shape[1]), axis=1)


@dataclass(frozen=True)
class Gain:
    """What one twin gains over another, on the same segments."""

    by_block: Array
    """Relative gain, markers and loads weighing alike; NaN in blocks that show none, (S, B) [1]"""
    marker_by_segment: Array
    """Gain of the mean marker distance, (S,)"""
    marker: float
    """Mean gain of the mean marker distance"""
    load: float
    """Gain of the load error"""
    probability_of_chance: float
    """Probability that the mean gain is not above zero, see `chance` and `together`"""
    everywhere: float = float("nan")
    """Mean relative gain in all that is measured of held-out logs, where the others are of less [1]"""
    of_one_sensor: bool = False
    """Whether the relative gain is of one sensor alone"""
    left_out: bool = False
    """Whether the relative gain and chance are of training segments, each predicted by a fit to the others"""

    @property
    def whole(self) -> float:
        """Mean relative gain in all that is measured [1], by which candidates are compared."""
        return self.relative if np.isnan(self.everywhere) else self.everywhere

    @property
    def relative(self) -> float:
        """Mean relative gain [1]."""
        return float(np.nanmean(self.by_block))

    def __str__(self) -> str:
        """The gain as text for a sentence."""
        return f"{better(self.relative)} on {self.where}"

    @property
    def where(self) -> str:
        """What the relative gain refers to, in words."""
        return "training segments that were left out" if self.left_out else "held-out logs"


def better(share: float) -> str:
    """A relative gain in words: 4.9 % better, or worse where it is a loss."""
    size = f"{100 * abs(share):.1f}"
    return f"{size} % {'worse' if share < 0 and float(size) else 'better'}"


def chance(gains: Array) -> float:
    """Probability that the mean of gains, (S, B), is not above zero, by Student's t; NaN is left out.

    Blocks of a segment are correlated: their number is divided by 1 + 2 Σ (1 − k/B) ρ_k, the
    autocorrelations to the first that is not positive (Geyer), each taken one standard error larger than
    it is estimated. Segments are independent, as each starts from a measured pose.
    """
    known = np.isfinite(gains)
    count, length = int(known.sum()), gains.shape[1]
    if count < 2:
        return 1.0
    mean = float(gains[known].mean())
    apart = np.where(known, gains - mean, 0.0)
    variance = float((apart**2).sum()) / count
    inflation = 1.0
    for k in range(1, length):
        pairs = int((known[:, :-k] & known[:, k:]).sum())
        if not pairs or variance <= 0:
            break
        rho = float((apart[:, :-k] * apart[:, k:]).sum()) / pairs / variance
        rho = min(1.0, rho + count**-0.5)
        if rho <= 0:
            break
        inflation += 2 * (1 - k / length) * rho
    independent = max(count / inflation, 2.0)
    spread = max(np.sqrt(variance / (independent - 1)), 1e-12)
    return float(scipy.special.stdtr(max(1.0, _FREEDOM * (independent - 1)), -mean / spread))


def together(selected: float, confirmed: float) -> float:
    """Probability of chance of an effect that some logs selected and others confirm, by Fisher's method; at
    least that of the logs which confirm it, if these by themselves hardly show it.
    """
    least = 1e-300
    joint = float(
        scipy.special.chdtrc(4, -2 * (np.log(max(selected, least)) + np.log(max(confirmed, least))))
    )
    return joint if confirmed < CONFIRMED else max(joint, confirmed)


def _by_own_size(before: Errors, after: Errors) -> Array:
    """Differences of two twins' errors relative to the mean of both in each block, (S, B): what helps in some
    blocks alone, as at a session's beginning, would look like scatter relative to the mean of all.
    """
    pairs = (
        (before.marker_by_block, after.marker_by_block),
        (before.load_by_block, after.load_by_block),
    )
    return known_mean(np.array([2 * (a - b) / (a + b) for a, b in pairs]), axis=0)


def gain(before: Errors, after: Errors, selected: float | None = None) -> Gain:
    """Paired gain of `after` over `before`; `selected` is the probability of chance by the logs that chose
    `after` among others, if others chose it.
    """
    parts = [
        (a - b) / np.nanmean(a)
        for a, b in (
            (before.marker_by_block, after.marker_by_block),
            (before.load_by_block, after.load_by_block),
        )
        if np.isfinite(a).any()
    ]
    known = np.isfinite(parts).any(axis=0) if parts else np.zeros(1, bool)
    if not known.any():
        raise SerpentError(
            "no held-out segment has markers or moving motors, so nothing can be judged. Hold out "
            "other sessions: --held-out."
        )
    each = known_mean(np.array(parts), axis=0)
    by_chance = chance(_by_own_size(before, after))
    return Gain(
        each,
        before.marker_by_segment - after.marker_by_segment,
        before.marker - after.marker,
        before.load - after.load,
        by_chance if selected is None else together(selected, by_chance),
    )
