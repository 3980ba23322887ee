"""Search a take for the motion that a log holds.

Distances that a marker moves within a moment depend neither on the cameras' frame nor on labels.
"""

import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.sessions.film import Film

GRID_HZ = 20.0  # markers move slowly against it
MOMENT = 5  # grid steps over which a motion is measured: one control step at 4 Hz
COVER = 0.5  # share of a session that the take must hold
SHORTEST = 2.0  # s: a place is judged by a second of moments at least
STILL = 0.01  # m rms: less motion than this looks the same everywhere


def findable(time: Array, marker: Array, film: Film) -> None:
    """Raise if a session, of which `marker` (K, 9, 3) is predicted, can be found in no take, or the
    film holds nothing to compare it with.
    """
    lasts = float(time[-1] - time[0])
    if lasts < SHORTEST:
        raise SerpentError(
            f"this session of {counted(len(time), 'row')} lasts {lasts:.2f} s; one shorter than "
            f"{SHORTEST:g} s "
            "cannot be found by its motion. Leave it out, or record a longer one."
        )
    motion = float(np.sqrt(((marker - marker.mean(axis=0)) ** 2).sum(axis=-1).mean()))
    if motion < STILL:
        raise SerpentError(
            f"this session's motors move the markers by {1e3 * motion:.1f} mm rms, less than "
            f"{1e3 * STILL:.0f} mm, so it cannot be found by its motion. Leave it out, or record one "
            "in which the arm moves."
        )
    shown = int(np.isfinite(film.position).all(axis=-1).any(axis=0).sum())
    if shown == 0:
        raise SerpentError(
            "the take shows no marker in any frame: all its cells are blank. Check in Motive that the "
            "cameras see the markers, and export the take again."
        )
    if shown < 3:
        raise SerpentError(
            f"the take shows only {shown} marker{'s' if shown > 1 else ''}; three are needed to find "
            "the base frame. Make more of them visible and record again."
        )


def search(time: Array, marker: Array, film: Film) -> tuple[Array, Array]:
    """Offsets [s], (L,), and how well the film's motion there matches, −1 … 1, NaN if not covered.

    `marker` (K, 9, 3) is predicted at log times (K,). Each film column is compared with the
    prediction that suits it best, so labels are not needed.
    """
    grid = np.arange(0.0, time[-1] - time[0], 1 / GRID_HZ)
    expected = np.stack(
        [np.interp(grid, time - time[0], x) for x in marker.reshape(len(time), -1).T], axis=1
    ).reshape(len(grid), -1, 3)
    want, seen = moved(expected).T, moved(_binned(film)).T
    lags = np.arange(1 - want.shape[1], seen.shape[1])
    total, weight = np.zeros(len(lags)), np.zeros(len(lags))
    for column in seen:
        r, pairs = masked_correlation(want, column)
        usable = pairs > GRID_HZ
        total += np.where(usable, pairs * np.where(usable, r, 0.0).max(axis=0), 0.0)
        weight += np.where(usable, pairs, 0.0)
    visible = np.isfinite(seen).any(axis=0).astype(float)
    rows = _correlate(np.ones((1, want.shape[1])), visible)[0]
    held = (rows >= COVER * want.shape[1]) & (weight > 0)
    score = np.where(held, total / np.maximum(weight, 1.0), np.nan)
    return film.start - time[0] + lags / GRID_HZ, score


def peaks(offset: Array, score: Array, most: int = 6, apart: float = 0.5) -> list[int]:
    """Indices of the highest scores, best first, at least `apart` [s] from each other."""
    left, found = np.where(np.isnan(score), -np.inf, score), []
    while len(found) < most and np.isfinite(left).any():
        best = int(np.argmax(left))
        found.append(best)
        left[np.abs(offset - offset[best]) < apart] = -np.inf
    return found


def moved(position: Array) -> Array:
    """How far each marker went within a moment [m], (T − MOMENT, M), from (T, M, 3) on the grid."""
    return np.linalg.norm(position[MOMENT:] - position[:-MOMENT], axis=-1)


def masked_correlation(x: Array, y: Array) -> tuple[Array, Array]:
    """Pearson's r of x (m, N) with every stretch of y (T,), (m, L), and the pairs in each, (L,).

    Lag n − N + 1 compares x[i] with y[i + lag]; NaN in y are left out. Source: Padfield 2012.
    """
    seen = np.isfinite(y).astype(float)
    y = np.where(seen > 0, y - np.nanmean(y) if seen.any() else 0.0, 0.0)
    x = x - x.mean(axis=1, keepdims=True)
    one = np.ones((1, x.shape[1]))
    pairs = np.maximum(np.round(_correlate(one, seen)[0]), 0.0)
    n = np.maximum(pairs, 1.0)
    y_sum, y_square = _correlate(one, y)[0], _correlate(one, y * y)[0]
    x_sum, x_square = _correlate(x, seen), _correlate(x * x, seen)
    both = _correlate(x, y) - x_sum * y_sum / n
    spread = (x_square - x_sum**2 / n) * (y_square - y_sum**2 / n)
    floor = 1e-9 * (x * x).sum(axis=1, keepdims=True) * max((y * y).sum(), 1e-300)
    return np.where(spread > floor, both / np.sqrt(np.maximum(spread, floor)), 0.0), pairs


def _correlate(x: Array, y: Array) -> Array:
    """Σ x[i] y[i + lag] for all lags, (m, N + T − 1), of x (m, N) and y (T,)."""
    size = scipy.fft.next_fast_len(x.shape[1] + len(y) - 1, real=True)
    product = np.conj(np.fft.rfft(x, size, axis=1)) * np.fft.rfft(y, size)
    full = np.fft.irfft(product, size, axis=1)
    return np.concatenate([full[:, size - x.shape[1] + 1 :], full[:, : len(y)]], axis=1)


def _binned(film: Film) -> Array:
    """The film's mean over each grid step, (G, M, 3); NaN where nothing was seen."""
    step = np.floor(np.arange(len(film.position)) * (GRID_HZ / film.rate_hz)).astype(int)
    first = np.flatnonzero(np.diff(step, prepend=-1))
    seen = np.isfinite(film.position)
    total = np.add.reduceat(np.where(seen, film.position, 0.0), first, axis=0)
    count = np.add.reduceat(seen.astype(float), first, axis=0)
    means = np.where(count > 0, total / np.maximum(count, 1.0), np.nan)
    out = np.full((step[-1] + 1, *means.shape[1:]), np.nan)
    out[step[first]] = means
    return out
