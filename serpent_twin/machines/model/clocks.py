"""Say when in its session each run begins."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.measured import Recording, Runs

_WHOLE = "session"


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


def part_of(run: Recording, rows: slice) -> Recording:
    """Some rows of a session, which know the whole of it."""
    columns = {name: values[rows].copy() for name, values in run.columns.items()}
    return Recording(run.path, {**run.metadata, _WHOLE: run}, columns, run.name)


def wholes_of(pieces: Runs) -> list[Recording]:
    """The whole sessions of runs that are parts of them."""
    return [about[_WHOLE] for about in pieces.metadata if _WHOLE in about]


def clocks_of(pieces: Runs) -> Clocks:
    """When runs begin."""
    wholes = wholes_of(pieces)
    if not wholes:  # each run is a session
        return Clocks(np.zeros(len(pieces)), pieces.time[:, 0])
    begun = np.array([each.time[0] for each in wholes])
    return Clocks(pieces.time[:, 0] - begun, begun)


def session_time(pieces: Runs) -> Array:
    """Times of the rows since their session began [s], (S, T)."""
    return pieces.time - pieces.time[:, :1] + clocks_of(pieces).begun[:, None]
