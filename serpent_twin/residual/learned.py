"""Learn a correction of the marker error from motor readings, without physics: the last resort.

Kept apart from the effects: it names no cause. It is on only where it reduces the error on held-out logs.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec.structs import asdict

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.size import marker_size
from serpent_twin.stored import Numbers, above, many, within

VERSION = 1
_AGAIN = "Trace the logs again."
_SIZED = ("mean", "phase", "offset")
FOLDS = 5
_TOO_LITTLE = 0.02  # of the error's square in training folds left out: not worth switching on


@dataclass(frozen=True)
class CorrectionOptions:
    """How the correction is learned."""

    lags: tuple[int, ...] = (0, 1, 2, 4)
    """Rows back whose motor readings are used, the present being 0"""
    waves: int = 200
    """Random Fourier features of the present readings, for what is not linear"""
    width: tuple[float, ...] = (0.7, 1.5)
    """Widths that are tried for them, in typical distances between readings"""
    ridge: tuple[float, ...] = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    """Penalties that are tried, per row"""


@dataclass(frozen=True, eq=False)
class Learned:
    """A correction of the predicted markers from motor angles, velocities and loads."""

    lags: tuple[int, ...]
    """Rows back that it reads"""
    period: float
    """Time between rows [s]"""
    arrays: dict[str, Array]
    """mean and scale of the readings, wave and phase of the features, weight and offset [m]"""
    on: bool = False
    """Whether it helps on held-out logs; if not, the correction is nought"""
    before: float = np.nan
    """Mean marker distance on the held-out logs without it, in the unit of the markers' measure"""
    after: float = np.nan
    """Mean marker distance on the held-out logs with it"""
    share: float = 0.0
    """Share of that distance which it removes; 0 if it is off"""
    interval: tuple[float, float] = (0.0, 0.0)
    """95 % interval of that share, by a paired bootstrap over segments"""
    dimension: int = 3
    """Coordinates of a marker"""

    def correction(self, *readings: Array) -> Array:
        """What to add to predicted markers [m], (S, T, M, 3), for motor angles, velocities and, where
        they are measured, loads, (S, T, N).
        """
        shape = (*readings[0].shape[:2], -1, self.dimension)
        size = self.arrays["offset"].size // self.dimension
        if not self.on:
            return np.zeros((*readings[0].shape[:2], size, self.dimension))
        x = _inputs(np.concatenate(readings, -1), self.lags, self.arrays)
        return (x @ self.arrays["weight"] + self.arrays["offset"]).reshape(shape)

    def corrected(self, comparison: Comparison) -> Comparison:
        """The comparison with the correction added to its prediction."""
        if abs(comparison.period - self.period) > 0.01 * self.period:
            found = (
                f"{comparison.period:g} s between rows, the learned correction {self.period:g} s"
            )
            raise SerpentError(f"The comparison has {found}. Learn it again at this rate.")
        return comparison.corrected(self.correction(*_readings(comparison)))

    def save(self, path: Path) -> None:
        """Write to an .npz file without pickles."""
        about: dict[str, Any] = {
            "version": VERSION,
            "lags": self.lags,
            "period": self.period,
            "on": self.on,
            "before_mm": self.before,
            "after_mm": self.after,
            "share": self.share,
            "interval": self.interval,
            "dimension": self.dimension,
        }
        with path.open("wb") as file:
            arrays: dict[str, Any] = {"about": np.array(json.dumps(about)), **self.arrays}
            np.savez(file, **arrays)


def load(path: Path) -> Learned:
    """The correction in a file that `save` wrote."""
    arrays = stored.read_arrays(path, _AGAIN)
    about = asdict(stored.json_in(arrays, "about", About, str(path), _AGAIN))
    del about["version"]
    learned = Learned(arrays=arrays, **about)
    stored.require_arrays(arrays, _wanted(learned), str(path), _AGAIN)
    return learned


class About(stored.Form, frozen=True):
    """What the file holds of a correction, see `Learned`."""

    version: Literal[1]
    lags: Annotated[tuple[Annotated[int, within(0, 10_000)], ...], many(1, 100)]
    period: Annotated[float, above(0.0, 1e4, "s")]
    on: bool
    before: float = msgspec.field(name="before_mm")
    """NaN where it was judged on nothing. The key is that of all files so far: of angles, it holds degrees"""
    after: float = msgspec.field(name="after_mm")
    share: float
    interval: tuple[float, float]
    dimension: Annotated[int, within(1, 3)]


def _wanted(learned: Learned) -> dict[str, Numbers]:
    """The arrays of a correction: as many readings, waves and coordinates as its first ones have."""
    count = {n: learned.arrays[n].size if n in learned.arrays else 0 for n in _SIZED}
    readings, waves, size = (count[name] for name in _SIZED)
    offset = {"offset": Numbers((size,))}
    if learned.arrays.keys() == offset.keys():  # nothing was found
        return offset
    return offset | {
        "mean": Numbers((readings,)),
        "scale": Numbers((readings,), divides=True),
        "wave": Numbers((readings, waves)),
        "phase": Numbers((waves,)),
        "weight": Numbers((len(learned.lags) * readings + waves, size)),
    }


def learn(
    training: Comparison,
    held_out: Comparison,
    rng: np.random.Generator,
    options: CorrectionOptions = CorrectionOptions(),
) -> Learned:
    """Fit to the training comparison, then switch on only if the gain on held-out segments is significant."""
    size, dimension = training.marker_residual[0, 0].size, training.marker.dimension
    best: tuple[float, dict[str, Array]] = (np.inf, {})
    for tried in _candidates(training, rng, options):
        best = min(best, tried, key=lambda pair: pair[0])
    left, arrays = best
    learned = Learned(
        options.lags, training.period, arrays or {"offset": np.zeros(size)}, dimension=dimension
    )
    learned = replace(learned, on=left < 1 - _TOO_LITTLE)
    return _judged(learned, held_out, rng)


def _judged(learned: Learned, held_out: Comparison, rng: np.random.Generator) -> Learned:
    """The correction with its gain on held-out segments; off where the interval holds zero."""
    before = marker_size(held_out)
    after = marker_size(learned.corrected(held_out))
    gain = before.by_segment - after.by_segment
    draws = rng.integers(len(gain), size=(2000, len(gain)))
    share = np.nanmean(gain[draws], axis=1) / before.mean
    low, high = (float(np.quantile(share, q)) for q in (0.025, 0.975))
    on = learned.on and low > 0
    mean = after.mean if on else before.mean
    return replace(
        learned,
        on=on,
        before=before.mean,
        after=mean,
        share=1 - mean / before.mean,
        interval=(low, high) if on else (0.0, 0.0),
    )


def _candidates(
    training: Comparison, rng: np.random.Generator, options: CorrectionOptions
) -> Iterator[tuple[float, dict[str, Array]]]:
    """Share of the squared error left in folds of segments, and the fit, for every choice."""
    readings = np.concatenate(_readings(training), axis=-1)
    y = training.marker_residual.reshape(*training.time.shape, -1)
    for width in (0.0, *options.width):
        arrays = _scales(readings, options.waves if width else 0, width, rng)
        x = _inputs(readings, options.lags, arrays)
        yield from (
            (left, arrays | {"weight": weight, "offset": offset})
            for left, weight, offset in _ridge_path(x, y, options.ridge)
        )


def _ridge_path(
    x: Array, y: Array, ridges: tuple[float, ...]
) -> Iterator[tuple[float, Array, Array]]:
    """Cross-validated share left, weights and offsets of y (S, T, K) by x (S, T, P) for each ridge."""
    known = np.isfinite(y).all(axis=-1) & np.isfinite(x).all(axis=-1)
    if not known.any():
        return
    fold = np.broadcast_to((np.arange(len(x)) * FOLDS // len(x))[:, None], known.shape)[known]
    x, y = x[known], y[known]
    middle, offset = x.mean(axis=0), y.mean(axis=0)
    x, y = x - middle, y - offset
    parts = [(x[fold == k], y[fold == k]) for k in np.unique(fold)]
    products = [(a.T @ a, a.T @ b) for a, b in parts]
    gram, right = sum(g for g, _ in products), sum(r for _, r in products)
    unit = len(x) * np.eye(x.shape[1])
    # The offset is a constant error, and counts as learned.
    total = float(np.sum((y + offset) ** 2)) or 1.0
    for ridge in ridges:
        left = 0.0
        for (a, b), (g, r) in zip(parts, products, strict=True):
            left += float(
                np.sum((b - a @ np.linalg.solve(gram - g + ridge * unit, right - r)) ** 2)
            )
        weight = np.linalg.solve(gram + ridge * unit, right)
        yield left / total, weight, offset - middle @ weight


def _readings(comparison: Comparison) -> tuple[Array, ...]:
    angle, velocity = comparison.motor_angle, comparison.motor_velocity
    loads = comparison.load_measured
    if angle is None or velocity is None:
        raise SerpentError(
            "A correction is learned from motor angles and velocities; the comparison lacks some."
        )
    return (angle, velocity) if loads is None else (angle, velocity, loads)


def _scales(
    readings: Array, waves: int, width: float, rng: np.random.Generator
) -> dict[str, Array]:
    """Mean and scale of the readings, and random waves over them."""
    columns = readings.shape[2]
    flat = readings.reshape(-1, columns)
    scale = np.nanstd(flat, axis=0)
    spread = width * np.sqrt(columns) if width else 1.0
    return {
        "mean": np.nanmean(flat, axis=0),
        "scale": np.where(scale > 1e-9, scale, 1.0),
        "wave": rng.normal(size=(columns, waves)) / spread,
        "phase": rng.uniform(0, 2 * np.pi, waves),
    }


def _inputs(readings: Array, lags: tuple[int, ...], arrays: dict[str, Array]) -> Array:
    """Scaled readings of several rows and waves of the present one, (S, T, P).

    Before a segment's first row, readings equal those of the first.
    """
    scaled = (readings - arrays["mean"]) / arrays["scale"]
    rows = np.arange(scaled.shape[1])
    past = [scaled[:, np.maximum(rows - lag, 0)] for lag in lags]
    waves = np.cos(scaled @ arrays["wave"] + arrays["phase"])
    return np.concatenate([*past, waves], axis=-1)
