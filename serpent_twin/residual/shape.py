"""Find the shape of an error's dependence: beyond a threshold, in a window, or periodic."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from serpent_twin.residual.comparison import Array
from serpent_twin.residual.features import TURN_FRACTIONS, Feature

_GRID = 40


@dataclass(frozen=True, eq=False)
class Shape:
    """The simplest curve that follows an error over a quantity."""

    kind: str
    """linear, step, window, ramp, ripple, curve or none"""
    text: str
    """The shape in words, within a sentence"""
    edges: tuple[float, ...] = ()
    """Threshold or window [the quantity's unit]"""
    per_turn: int = 0
    """Periods per turn, of a ripple"""


def shape_of(feature: Feature, error: Array, effective_rows: float) -> Shape:
    """Shape of an error's (S, T) dependence on a feature, from `effective_rows` independent rows."""
    if feature.kind == "direction":
        return Shape("step", "with its sign")
    if feature.kind in ("reversal", "group", "past") or feature.name.startswith("time since"):
        return Shape("curve", "")
    if feature.kind == "directed" and feature.sign is not None:
        error = error * feature.sign
    x, y = feature.value.ravel(), error.ravel()
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good] - y[good].mean()
    total = float(np.sum(y**2)) or 1.0
    # A further parameter is penalised as in the Bayesian information criterion.
    price = np.log(max(effective_rows, 8)) / max(effective_rows, 8)
    found = [
        (np.log(max(left / total, 1e-6)) + p * price, s) for left, p, s in _tries(feature, x, y)
    ]
    return min(found, key=lambda pair: pair[0])[1]


def _tries(feature: Feature, x: Array, y: Array) -> Iterator[tuple[float, int, Shape]]:
    """Squared error left, number of parameters and shape for each kind of curve."""
    if feature.per_turn:
        fit = _fit(_wave(x, feature.per_turn), y)
        yield _left(fit, y), 2, _ripple(feature.per_turn)
        return
    yield _straight(feature, x, y)
    grid = np.unique(np.quantile(x, np.linspace(0.03, 0.97, _GRID)))
    yield _step(feature, x, y, grid)
    yield _ramp(feature, x, y, grid)
    if len(grid) > 1:  # else nearly all rows have one value
        yield _window(feature, x, y, grid)
    fit = _fit(np.stack([np.clip((x - g), 0, None) for g in grid[::6]] + [x], axis=1), y)
    yield _left(fit, y), 9, Shape("curve", _where_large(feature, x, fit))
    if feature.unit == "rad" and feature.kind == "angle":
        turns = [k for k in TURN_FRACTIONS if np.ptp(x) * k > 4 * np.pi]
        for fit, k in ((_fit(_wave(x, k), y), k) for k in turns):
            yield _left(fit, y), 3, _ripple(k)


def _ripple(k: int) -> Shape:
    period = np.degrees(2 * np.pi / k)
    text = f"{times(k)} per turn (every {period:.0f}°)"
    return Shape("ripple", text, per_turn=k)


def times(k: int) -> str:
    """How often, in words."""
    return {1: "once", 2: "twice"}.get(k, f"{k} times")


def _straight(feature: Feature, x: Array, y: Array) -> tuple[float, int, Shape]:
    fit = _fit(x[:, None], y)
    return _left(fit, y), 1, Shape("linear", "in proportion to it")


def _step(feature: Feature, x: Array, y: Array, grid: Array) -> tuple[float, int, Shape]:
    fits = [_fit((x > g)[:, None].astype(float), y) for g in grid]
    best = int(np.argmin([_left(fit, y) for fit in fits]))
    # Measured from the side with more rows, a threshold leaves the error where fewer rows are.
    side = "above" if np.mean(x > grid[best]) <= 0.5 or feature.unit == "s" else "below"
    side = "after" if feature.unit == "s" else side
    text = f"{side} {quantity(grid[best], feature.unit)}"
    if feature.kind == "velocity" and abs(grid[best]) < 0.2 * np.std(x):
        text = "with its sign"
    return _left(fits[best], y), 2, Shape("step", text, (grid[best],))


def _ramp(feature: Feature, x: Array, y: Array, grid: Array) -> tuple[float, int, Shape]:
    tries = [(s * np.clip(s * (x - g), 0, None), g, s) for g in grid for s in (1, -1)]
    fits = [_fit(column[:, None], y) for column, _, _ in tries]
    best = int(np.argmin([_left(fit, y) for fit in fits]))
    _, edge, side = tries[best]
    word = "above" if side > 0 else "below"
    text = f"growing {word} {quantity(edge, feature.unit)}"
    return _left(fits[best], y), 2, Shape("ramp", text, (float(edge),))


def _window(feature: Feature, x: Array, y: Array, grid: Array) -> tuple[float, int, Shape]:
    """Two thresholds by sums over sorted rows."""
    order = np.argsort(x)
    total = np.concatenate([[0.0], np.cumsum(y[order])])
    at = np.searchsorted(x[order], grid)
    low, high = np.triu_indices(len(grid), 1)
    inside, count = total[at[high]] - total[at[low]], at[high] - at[low]
    n = len(y)
    gain = np.where(count > 0, inside**2 * n / np.maximum(count * (n - count), 1), 0.0)
    best = int(np.argmax(gain))
    edges = float(grid[low[best]]), float(grid[high[best]])
    text = between(*edges, feature.unit)
    left = float(np.sum(y**2) - gain[best])
    return left, 3, Shape("window", text, edges)


def _where_large(feature: Feature, x: Array, fit: Array) -> str:
    """The range in which a curve is beyond half its greatest value."""
    large = np.abs(fit) > 0.5 * np.max(np.abs(fit))
    low, high = np.quantile(x[large], [0.02, 0.98])
    inside = (x >= low) & (x <= high)
    if not inside.any() or np.mean(inside) > 0.6 or np.mean(large[inside]) < 0.8:
        return "along a curve"
    return f"most {between(low, high, feature.unit)}"


def _wave(x: Array, k: int) -> Array:
    return np.stack([np.sin(k * x), np.cos(k * x)], axis=1)


def _fit(columns: Array, y: Array) -> Array:
    """Least squares curve through y, with an offset."""
    centred = columns - columns.mean(axis=0)
    return centred @ np.linalg.lstsq(centred, y, rcond=1e-8)[0]


def _left(fit: Array, y: Array) -> float:
    return float(np.sum((y - fit) ** 2))


def quantity(value: float, unit: str) -> str:
    """A number with its unit; angles in degrees besides."""
    if unit == "rad":
        return _minus(f"{value:.2f} rad ({np.degrees(value):.0f}°)")
    return _minus(f"{value:.3g} {unit}".strip())


def between(low: float, high: float, unit: str) -> str:
    """A range in words."""
    if unit == "rad":
        degrees = f"{np.degrees(low):.0f}° and {np.degrees(high):.0f}°"
        return _minus(f"between {low:.2f} and {high:.2f} rad ({degrees})")
    return _minus(f"between {low:.3g} and {high:.3g} {unit}".strip())


def _minus(text: str) -> str:
    return text.replace("-", "−")
