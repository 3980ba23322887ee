"""Test whether the error changes during a session, slowly or at once."""

from dataclasses import dataclass

import numpy as np
import scipy

from serpent_twin.residual.comparison import Array
from serpent_twin.residual.spectrum import autocorrelation_rows, known


@dataclass(frozen=True, eq=False)
class Drift:
    """A straight trend over the session, the same in all sessions."""

    per_minute: Array
    """Slope of each channel [unit/min], (C,)"""
    interval: Array
    """Half width of its 99 % interval, all channels together (Bonferroni), (C,)"""
    share: float
    """Share of the variance that the trend takes away"""

    @property
    def seen(self) -> bool:
        """Whether the trend of any channel is significant."""
        return bool((np.abs(self.per_minute) > self.interval).any())

    @property
    def strongest(self) -> int:
        """The channel whose slope is largest among those beyond chance, or of all."""
        beyond = np.abs(self.per_minute) > self.interval
        size = np.where(beyond | (not beyond.any()), np.abs(self.per_minute), 0.0)
        return int(np.argmax(size))


@dataclass(frozen=True, eq=False)
class Jump:
    """A change at one time of one session."""

    session: str
    """Name of the session"""
    time_s: float
    """Time within the session"""
    size: Array
    """Mean after − mean before of each channel, (C,)"""
    share: float
    """Share of that session's variance that it takes away"""


def drift(values: Array, time: Array, session: tuple[str, ...]) -> Drift:
    """Trend of values (S, T, C) over time (S, T) [s] by least squares on means of blocks.

    A block is four autocorrelation times long or more, so that blocks are nearly independent.
    """
    rows = known(values)
    length = _block_rows(rows)
    y, t, name = _block_means(rows, time, session, length)
    y, t = _without_session_means(y, name), _without_session_means(t[:, None], name)[:, 0]
    spread = t @ t
    C, free = y.shape[1], len(t) - len(set(session)) - 1
    if free < 2 or spread <= 0:
        return Drift(np.zeros(C), np.full(C, np.inf), 0.0)
    slope = t @ y / spread
    left = np.sum((y - t[:, None] * slope) ** 2, axis=0)
    half = scipy.special.stdtrit(free, 1 - 0.005 / C) * np.sqrt(left / free / spread)
    share = np.sum((t[:, None] * slope) ** 2) * length / max(np.sum(rows**2), 1e-300)
    return Drift(60 * slope, 60 * half, float(min(1.0, share)))


def jump(
    values: Array,
    time: Array,
    session: tuple[str, ...],
    rng: np.random.Generator,
    permutations: int = 199,
) -> Jump | None:
    """The greatest change of the mean of values (S, T, C) at one time, if beyond chance (1 %); sessions too
    short for one do not count.

    The chance level is found by shuffling blocks of rows within their session.
    """
    rows = known(values)
    length = _block_rows(rows)
    best, chance = None, np.zeros(permutations)
    for name in dict.fromkeys(session):
        of = [i for i, s in enumerate(session) if s == name]
        of.sort(key=lambda i: time[i, 0])
        y, t = rows[of].reshape(-1, rows.shape[2]), time[of].reshape(-1)
        if len(y) <= 2 * _EDGE:
            continue
        gain, at = _split(y - y.mean(axis=0))
        if best is None or gain > best[0]:
            best = gain, name, y, t, at
        shuffled = [_split(_shuffled(y - y.mean(axis=0), length, rng))[0] for _ in chance]
        chance = np.maximum(chance, shuffled)
    if best is None:
        return None
    gain, name, y, t, at = best
    probability = float((1 + np.sum(chance >= gain)) / (permutations + 1))
    if probability > 0.01:
        return None
    size = y[at:].mean(axis=0) - y[:at].mean(axis=0)
    return Jump(name, float(t[at]), size, float(gain))


def step_at(values: Array, time: Array, session: tuple[str, ...], where: Jump) -> Array:
    """Mean after − mean before a jump's time in its session of values (S, T, C), (C,)."""
    own = np.array(session) == where.session
    rows, then = known(values)[own].reshape(-1, values.shape[2]), time[own].reshape(-1)
    after = then >= where.time_s
    return rows[after].mean(axis=0) - rows[~after].mean(axis=0)


_EDGE = 4
"""Rows before and after a jump at least"""


def _split(y: Array) -> tuple[float, int]:
    """Share of |y|² that two means take away at the best row, and that row; y (N, C) has mean zero."""
    n, edge = len(y), max(_EDGE, len(y) // 25)
    after = np.arange(edge, n - edge)
    total = np.cumsum(y, axis=0)[after - 1]
    gain = (total**2).sum(axis=1) * n / (after * (n - after))
    best = int(np.argmax(gain))
    return float(gain[best] / max(np.sum(y**2), 1e-300)), int(after[best])


def _shuffled(y: Array, length: int, rng: np.random.Generator) -> Array:
    """Rows in shuffled blocks, turned by a random number of rows first."""
    turned = np.roll(y, rng.integers(len(y)), axis=0)
    blocks = np.array_split(np.arange(len(y)), max(2, len(y) // length))
    order = rng.permutation(len(blocks))
    return turned[np.concatenate([blocks[i] for i in order])]


def _block_rows(rows: Array) -> int:
    """Rows of a block: four autocorrelation times, but three blocks of a segment at least."""
    return int(np.clip(4 * autocorrelation_rows(rows), 4, max(4, rows.shape[1] // 3)))


def _block_means(
    rows: Array, time: Array, session: tuple[str, ...], length: int
) -> tuple[Array, Array, np.ndarray]:
    S, T, C = rows.shape
    n = T // length
    y = rows[:, : n * length].reshape(S, n, length, C).mean(axis=2).reshape(S * n, C)
    t = time[:, : n * length].reshape(S, n, length).mean(axis=2).reshape(S * n)
    return y, t, np.repeat(np.array(session), n)


def _without_session_means(values: Array, name: np.ndarray) -> Array:
    out = values.astype(float)
    for one in np.unique(name):
        out[name == one] -= out[name == one].mean(axis=0)
    return out
