"""Say when in its session each run begins."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.measured import Recording, Runs

_WHOLE = "session"
CLOCK_BEGAN = "clock_began_s"
"""In a session's metadata, the clock of its log at the log's first row [s]"""
_PRIOR = "prior_runtime_s"


@dataclass(frozen=True)
class Clocks:
    """When n runs begin [s], (n,) each."""

    begun: Array
    """Since the session began"""
    prior_runtime: Array
    """From the beginning of the log to that of the session"""

    def repeated(self, times: int) -> "Clocks":
        """Those of the same runs so many times, one set after the other."""
        return Clocks.together([self] * times)

    @staticmethod
    def together(several: Sequence["Clocks"]) -> "Clocks":
        """Those of some sets of runs, one set after the other."""
        begun, prior = zip(*((each.begun, each.prior_runtime) for each in several), strict=True)
        return Clocks(np.concatenate(begun), np.concatenate(prior))


def in_sequence(sessions: Sequence[Recording]) -> list[Recording]:
    """Sessions that know when they began: by their clocks, if these could be one; else as they are listed,
    where a clock that begins anew goes on where the session before ended.
    """
    ends = [each.time[[0, -1]] + each.metadata[CLOCK_BEGAN] for each in sessions]
    if any(first[1] > second[0] for first, second in pairwise(sorted(ends, key=tuple))):
        ends = _one_after_the_other(ends)
    first = min(begins for begins, _ in ends)
    return [
        replace(each, metadata=each.metadata | {_PRIOR: float(begins - first)})
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


def part_of(run: Recording, rows: slice) -> Recording:
    """Some rows of a session, which know the whole of it."""
    columns = {name: values[rows].copy() for name, values in run.columns.items()}
    return Recording(run.path, {**run.metadata, _WHOLE: run}, columns, run.name)


def wholes_of(pieces: Runs) -> list[Recording]:
    """The whole sessions of runs that are parts of them."""
    return [about[_WHOLE] for about in pieces.metadata if _WHOLE in about]


def sessions_of(pieces: Runs) -> list[Recording]:
    """The whole sessions of runs that are parts of them, each once."""
    return list({id(each): each for each in wholes_of(pieces)}.values())


def clocks_of(pieces: Runs) -> Clocks:
    """When runs begin."""
    first = pieces.time[:, 0]
    wholes = wholes_of(pieces)  # if there are none, each run is a session
    begun = np.array([each.time[0] for each in wholes]) if wholes else first
    about = zip(pieces.metadata, begun, strict=True)
    prior = np.array([each.get(_PRIOR, otherwise) for each, otherwise in about])
    return Clocks(first - begun, prior)


def session_time(pieces: Runs) -> Array:
    """Times of the rows since their session began [s], (S, T)."""
    return pieces.time - pieces.time[:, :1] + clocks_of(pieces).begun[:, None]
