"""Say when in its session each run begins."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

CLOCK_BEGAN = "clock_began_s"
"""Key in a session's metadata: clock of the session's log at the log's first row [s]"""
PRIOR = "prior_runtime_s"
"""Key in a session's metadata: how long the machine ran before the session [s]"""


@dataclass(frozen=True)
class Clocks:
    """When n runs begin [s], (n,) each."""

    begun: Array
    """Time from the beginning of its session to that of each run [s], (n,)"""
    prior_runtime: Array
    """Time from the beginning of the log to that of each run's session [s], (n,)"""

    def repeated(self, times: int) -> "Clocks":
        """Clocks of the same runs repeated so many times, one set after the other."""
        return Clocks.together([self] * times)

    @staticmethod
    def together(several: Sequence["Clocks"]) -> "Clocks":
        """Clocks of several sets of runs, one set after the other."""
        begun, prior = zip(*((each.begun, each.prior_runtime) for each in several), strict=True)
        return Clocks(np.concatenate(begun), np.concatenate(prior))


def in_sequence(sessions: Sequence[Log]) -> list[Log]:
    """Sessions that know when they began: by their clocks, if these could be one; else as they are listed,
    where a clock that begins anew goes on where the session before ended.
    """
    ends = [each.time[[0, -1]] + each.metadata[CLOCK_BEGAN] for each in sessions]
    if any(first[1] > second[0] for first, second in pairwise(sorted(ends, key=tuple))):
        ends = _one_after_the_other(ends)
    first = min(begins for begins, _ in ends)
    return [
        replace(each, metadata=each.metadata | {PRIOR: float(begins - first)})
        for each, (begins, _) in zip(sessions, ends, strict=True)
    ]


def _one_after_the_other(ends: Sequence[Array]) -> list[Array]:
    """Begins and ends of sessions, (2,) each, in the time of a clock that goes on."""
    found: list[Array] = []
    forward = 0.0
    for each in ends:
        if found:
            forward = max(forward, found[-1][1] - each[0])
        found.append(each + forward)
    return found


def clocks_of(pieces: Segments) -> Clocks:
    """When segments begin."""
    return Clocks(pieces.begun, pieces.prior_runtime)


def session_time(pieces: Segments) -> Array:
    """Times of the rows since their session began [s], (S, T)."""
    return pieces.time - pieces.time[:, :1] + pieces.begun[:, None]
