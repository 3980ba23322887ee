"""Match a take's columns to the arm's markers."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import Rigid, fit_rigid
from serpent_twin.sessions.film import Film, bridged

SHOWN = 0.2  # share of the rows that a column must show to be identified
GATE = 0.08  # m: a predicted marker is never further off; neighbours are 65 mm apart
CLEARER = 0.7  # the nearest marker is nearer than this share of the second nearest
PAUSE = 0.1  # s: after a longer gap, a column may show another marker
JUMP = 0.025  # m: a longer step between frames means that the label went to another marker
FASTEST = 1.5  # m/s: markers of this arm are slower
LOOSE, SPARE = (
    1.5,
    0.01,
)  # a fragment may be this much further off than its marker's own columns, + m


def named(names: Sequence[str], wanted: Sequence[str] = ()) -> list[int] | None:
    """Columns of markers 1 … 9 by the names wanted, else by names that end in 1 … 9, else None."""
    if wanted:
        missing = [name for name in wanted if name not in names]
        if missing or len(wanted) != N_JOINTS or len(set(wanted)) != N_JOINTS:
            problem = f"the take has no {', '.join(missing)}" if missing else "they are not nine"
            raise SerpentError(
                f"--labels must name the nine markers, base to tip; {problem}. "
                f"The take's markers: {', '.join(names)}."
            )
        return [names.index(name) for name in wanted]
    groups: dict[str, dict[int, list[int]]] = {}
    for column, name in enumerate(names):
        match = re.fullmatch(r"(.*?)(?<!\d)0*([1-9])", name)
        if match and not name.lower().startswith("unlabel"):
            groups.setdefault(match[1], {}).setdefault(int(match[2]), []).append(column)
    whole = [
        g for g in groups.values() if len(g) == N_JOINTS and all(len(c) == 1 for c in g.values())
    ]
    return [whole[0][n][0] for n in range(1, N_JOINTS + 1)] if len(whole) == 1 else None


def assigned(marker: Array, seen: Array, stride: int) -> dict[int, int]:
    """Column → marker (0 … 8) for columns `seen` (K, M, 3) at the rows of a prediction (K, 9, 3).

    Markers move alike but not equally far, so motion over `stride` rows gives a first guess; then
    the distances that a rigid fit leaves decide, until they agree with themselves.
    """
    shown = np.flatnonzero(np.isfinite(seen).all(axis=-1).mean(axis=0) > SHOWN)
    if len(shown) < 3:
        return {}
    seen = seen[:, shown]
    rows, columns = scipy.optimize.linear_sum_assignment(_unlikeness(marker, seen, stride))
    for _ in range(10):
        before = tuple(zip(rows, columns, strict=True))
        try:
            rigid = trimmed_fit(seen[:, columns], marker[:, rows])
        except SerpentError:
            return {}
        far = np.linalg.norm(rigid.apply(seen)[:, None] - marker[:, :, None], axis=-1)
        far = np.nanmedian(far, axis=0)
        rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(far, 2 * GATE))
        near = far[rows, columns] < 2 * GATE
        if near.sum() >= 3:
            rows, columns = rows[near], columns[near]
        if tuple(zip(rows, columns, strict=True)) == before:
            break
    return {int(shown[c]): int(r) for r, c in zip(rows, columns, strict=True)}


def trimmed_fit(source: Array, target: Array) -> Rigid:
    """Rigid fit of points (..., 3) on their majority: pairs three times the median off are left out."""
    source, target = source.reshape(-1, 3), target.reshape(-1, 3)
    rigid = fit_rigid(source, target)
    for _ in range(5):
        far = np.linalg.norm(rigid.apply(source) - target, axis=-1)
        near = far <= 3 * np.nanmedian(far)
        rigid = fit_rigid(source[near], target[near])
    return rigid


def _unlikeness(marker: Array, seen: Array, stride: int) -> Array:
    """How differently each marker and column move, (9, M): 1 − r, and the log ratio of speeds."""
    want = np.linalg.norm(marker[stride:] - marker[:-stride], axis=-1)
    have = np.linalg.norm(seen[stride:] - seen[:-stride], axis=-1)
    out = np.empty((want.shape[1], have.shape[1]))
    for column, speed in enumerate(have.T):
        known = np.isfinite(speed)
        a, b = want[known], speed[known, None]
        a0, b0 = a - a.mean(axis=0), b - b.mean(axis=0)
        size = np.sqrt((a0**2).sum(axis=0) * (b0**2).sum(axis=0))
        r = (a0 * b0).sum(axis=0) / np.maximum(size, 1e-12)
        ratio = np.sqrt(((a**2).sum(axis=0) + 1e-12) / ((b**2).sum() + 1e-12))
        out[:, column] = 1 - r + np.abs(np.log(ratio))
    return out


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of a column in which its label stays with one marker."""

    column: int
    frames: np.ndarray
    """Indices of the frames that show it."""
    marker: int
    """0 … 8."""
    distance: float
    """Mean distance from the prediction [m]."""
    trusted: bool
    """True if the column was named, not guessed."""


def track(
    film: Film, expected: Array, owner: Mapping[int, int], trusted: bool
) -> tuple[Film, list[dict[int, int]]]:
    """A film of markers 1 … 9 put together from all columns, and the source of each marker's frames.

    `expected` (T, 9, 3) is the prediction in the cameras' frame, NaN outside of the session;
    `owner` maps columns to markers, fixed if trusted. Where labels break off or swap, stretches
    of other columns step in; what is near no marker, such as a reflection, stays out. The second
    result has, for each marker, the number of frames by column.
    """
    pieces = [
        piece
        for column in range(film.position.shape[1])
        for piece in _pieces(film, expected, column, owner.get(column) if trusted else None)
    ]
    pieces = _plausible(pieces)
    position = np.full((len(expected), N_JOINTS, 3), np.nan)
    giver = np.full((len(expected), N_JOINTS), -1)
    for piece in sorted(pieces, key=lambda p: (p.trusted, -p.distance)):
        position[piece.frames, piece.marker] = film.position[piece.frames, piece.column]
        giver[piece.frames, piece.marker] = piece.column
    shares = [dict(zip(*np.unique(g[g >= 0], return_counts=True), strict=True)) for g in giver.T]
    return Film(film.start, film.rate_hz, bridged(position)), [
        {int(c): int(n) for c, n in sorted(share.items(), key=lambda item: -item[1])}
        for share in shares
    ]


def stretches(film: Film, expected: Array, column: int) -> tuple[list[np.ndarray], Array]:
    """Frames of each stretch in which a column's label stays, and its mean distances from the nine
    predicted markers [m], (S, 9).
    """
    known = np.isfinite(expected).all(axis=(-1, -2))
    position = film.position[:, column]
    frames = np.flatnonzero(np.isfinite(position).all(axis=-1) & known)
    if not len(frames):
        return [], np.empty((0, N_JOINTS))
    far = np.linalg.norm(position[frames, None] - expected[frames], axis=-1)
    gap = np.diff(frames) / film.rate_hz
    step = np.linalg.norm(np.diff(position[frames], axis=0), axis=-1)
    first = np.r_[0, 1 + np.flatnonzero((gap > PAUSE) | (step > JUMP + FASTEST * gap))]
    mean = np.add.reduceat(far, first) / np.diff(np.r_[first, len(frames)])[:, None]
    return np.split(frames, first[1:]), mean


def _pieces(film: Film, expected: Array, column: int, marker: int | None) -> list[Piece]:
    """The stretches of a column that belong to a marker: the one given, else the nearest."""
    parts, mean = stretches(film, expected, column)
    if not parts:
        return []
    if marker is not None:
        return [
            Piece(column, f, marker, float(d[marker]), True)
            for f, d in zip(parts, mean, strict=True)
        ]
    best = mean.argmin(axis=1)
    nearest, second = np.sort(mean, axis=1)[:, :2].T
    good = (nearest < GATE) & (nearest < CLEARER * second)
    return [
        Piece(column, parts[n], int(best[n]), float(nearest[n]), False)
        for n in np.flatnonzero(good)
    ]


def _plausible(pieces: list[Piece]) -> list[Piece]:
    """Pieces without those that are much further from the prediction than most of their marker's."""
    kept = []
    for marker in range(N_JOINTS):
        own = [p for p in pieces if p.marker == marker]
        if own:
            judges = [p for p in own if p.trusted] or own
            order = sorted(judges, key=lambda p: p.distance)
            frames = np.cumsum([len(p.frames) for p in order])
            typical = order[int(np.searchsorted(frames, frames[-1] / 2))].distance
            kept += [p for p in own if p.trusted or p.distance < LOOSE * typical + SPARE]
    return kept


def expected_on(log_time: Array, time: Array, marker: Array, rigid: Rigid) -> Array:
    """A prediction (K, 9, 3) at log times `time` in the cameras' frame at each frame, (T, 9, 3).

    `log_time` (T,) are the frames' times on the log's clock; `rigid` goes from cameras to base.
    """
    flat = marker.reshape(len(time), -1).T
    there = np.stack([np.interp(log_time, time, x, np.nan, np.nan) for x in flat], axis=1)
    return rigid.inverse().apply(there.reshape(len(log_time), -1, 3))
