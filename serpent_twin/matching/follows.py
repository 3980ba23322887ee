"""Find which columns of logs follow which others, with what lag, and which are rates of which."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.matching.logged import Logged

LONGEST = 0.4
"""Lag of a reading behind its command [s]"""
_MOST_LAGS = 60
_SAME_LEAD = 0.2
"""Share of what a correlation lacks by which it must change with a lag of one row"""
_RATE = 0.97
"""Correlation of a column with the rate of another from which it is its velocity"""


@dataclass(frozen=True)
class Lagged:
    """Correlations of K columns with each other, the second one later by a lag."""

    columns: tuple[str, ...]
    lags: Array
    """Lags in rows, (L,), from 0 on"""
    period: float
    """[s]"""
    correlation: Array
    """(L, K, K): of column i with column j a lag later"""

    def best(self, first: str, second: str) -> tuple[float, float]:
        """The strongest correlation of a column with a later one, with its sign, and the lag [s]."""
        i, j = self.columns.index(first), self.columns.index(second)
        values = self.correlation[:, i, j]
        n = int(np.abs(values).argmax())
        return float(values[n]), float(self.lags[n]) * self.period

    def leads(self, first: str, second: str) -> bool | None:
        """Whether a column leads another; None where neither does."""
        i, j = self.columns.index(first), self.columns.index(second)
        ahead, behind = np.abs(self.correlation[:, i, j]), np.abs(self.correlation[:, j, i])
        if int(ahead.argmax()) == 0 == int(behind.argmax()):
            gain = float(ahead[1] - behind[1]) if len(ahead) > 1 else 0.0
            return None if abs(gain) < _SAME_LEAD * (1 - float(ahead[0]) + 1e-9) else gain > 0
        return bool(ahead.max() > behind.max())


def lagged(logged: Logged, columns: Sequence[str], rates: bool = False) -> Lagged:
    """Correlations of columns; with `rates`, of the rates of columns with columns at lags of 0 … 2 rows."""
    period = 1.0 / logged.rate_hz
    most = 2 if rates else round(LONGEST / period)
    lags = np.unique(np.linspace(0, most, min(most, _MOST_LAGS) + 1).round().astype(int))
    later = _standard([[p.values[c] for c in columns] for p in logged.pieces])
    first = later
    if rates:
        smooth = {c: logged.smoothed(c) for c in columns}
        logs = range(len(logged.pieces))
        first = _standard([[smooth[c][n][1] for c in columns] for n in logs])
    found = np.zeros((len(lags), len(columns), len(columns)))
    for n, lag in enumerate(lags):
        count = 0
        for a, b in zip(first, later, strict=True):
            if b.shape[1] > lag:
                found[n] += a[:, : b.shape[1] - lag] @ b[:, lag:].T
                count += b.shape[1] - int(lag)
        found[n] /= max(count, 1)
    return Lagged(tuple(columns), lags.astype(float), period, found)


def velocities(logged: Logged, columns: Sequence[str]) -> set[str]:
    """Columns that are the rate of another one."""
    if len(columns) < 2:
        return set()
    found = lagged(logged, columns, rates=True).correlation
    strongest = np.take_along_axis(found, np.abs(found).argmax(axis=0)[None], axis=0)[0]
    np.fill_diagonal(strongest, 0.0)
    return {own for own, of in zip(columns, strongest.T, strict=True) if of.max() > _RATE}


def _standard(several: Sequence[Sequence[Array]]) -> list[Array]:
    """Columns without their mean over all logs, in units of their standard deviation, (K, T) a log."""
    stacked = [np.array(each) for each in several]
    whole = np.concatenate(stacked, axis=1)
    mean, spread = whole.mean(axis=1, keepdims=True), whole.std(axis=1, keepdims=True)
    return [(each - mean) / np.where(spread > 0, spread, 1.0) for each in stacked]


def slope(logged: Logged, command: str, reading: str, lag: float, rate: bool = False) -> float:
    """Slope of a reading, or its rate, over the command a lag [s] before."""
    x, y = [], []
    for n, piece in enumerate(logged.pieces):
        late = round(lag / piece.period)
        of = logged.smoothed(reading)[n][1] if rate else piece.values[reading]
        x.append(piece.values[command][: len(of) - late])
        y.append(of[late:])
    a, b = np.concatenate(x), np.concatenate(y)
    spread = a.var()
    return float(((a - a.mean()) * (b - b.mean())).mean() / spread) if spread else 0.0
