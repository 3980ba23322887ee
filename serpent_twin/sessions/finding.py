"""State what was found in a session, in one sentence with the rows."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from serpent_twin.numerals import counted

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Finding:
    """One sentence about a session: an `error` spoils it, a `warning` may, a `note` does not."""

    level: Literal["error", "warning", "note"]
    text: str


def stretches(mask: Mask) -> NDArray[np.int64]:
    """First row and row after the last of each run of true in `mask` (T,), (n, 2)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges).reshape(-1, 2)


def longest(mask: Mask) -> tuple[int, int]:
    """First row and length of the longest run of true in `mask` (T,)."""
    runs = [(first, stop - first) for first, stop in stretches(mask).tolist()]
    return max(runs, key=lambda run: run[1], default=(0, 0))


def rows_text(mask: Mask, most: int = 4) -> str:
    """The rows where `mask` (T,) is true, as text."""
    runs = stretches(mask)
    named = [f"{a}" if b == a + 1 else f"{a}–{b - 1}" for a, b in runs[:most]]
    rest = len(runs) - most
    more = f" and {counted(rest, 'more stretch', 'more stretches')}" if rest > 0 else ""
    return f"row{'s' if mask.sum() > 1 else ''} {', '.join(named)}{more}"


def spans_text(rows: NDArray[np.int64], bridged: int) -> str:
    """Rows, sorted, as text, with short gaps filled."""
    mask = np.zeros(rows[-1] + 1, bool)
    mask[rows] = True
    for first, stop in stretches(~mask):
        mask[first:stop] = stop - first <= bridged and first > 0
    return rows_text(mask)
