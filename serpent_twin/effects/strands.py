"""Say on which strands of the arm's cables an effect acts: all, one cable's, or one."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import Effect, Range, parameter
from serpent_twin.errors import SerpentError

ALL = -1.0
"""Value in place of a strand's number: all strands are alike."""
N_CABLES = 10
"""Cables of the arm, of which `strand` is a number"""
N_STRANDS = 2 * N_CABLES
_LAST = float(N_STRANDS + N_CABLES - 1)
ALIKE = Range("1", ALL, ALL, ALL, fitted=False)
"""The range in machines that have other cables than the arm"""


def within(strand: float) -> tuple[float, ...]:
    """What to try within all strands: cables 1 … 9; within a cable: its two strands. Cable 10 moves the jaw
    and is never pulled hard.
    """
    if strand == ALL:
        return tuple(float(N_STRANDS + j) for j in range(N_CABLES - 1))
    cable = int(strand) - N_STRANDS
    return (2.0 * cable, 2.0 * cable + 1) if cable >= 0 else ()


def on_strands(before: float | None = ALL) -> Any:
    """The parameter `strand` of an effect: −1 for all strands; 0 … 19 for one, in the order of
    `mjcf.STRANDS`; 20 … 29 for both of cable 1 … 10. `before` is as in `Range`.
    """
    return parameter(
        "1",
        low=ALL,
        high=_LAST,
        typical=ALL,
        default=ALL,
        fitted=False,
        before=before,
        within=within,
    )


@dataclass(frozen=True)
class OnStrands(Effect):
    """An effect that has the parameter `strand`."""

    def chosen(self, strands: int) -> NDArray[np.bool_]:
        """Which of a machine's strands are meant, (n, strands); at a place, the one that is there."""
        known = self.__dict__.setdefault("_chosen", {})
        if strands not in known:
            known[strands] = chosen(self.strand, strands)
        return known[strands]


def chosen(strand: Array | float, strands: int) -> NDArray[np.bool_]:
    """Which of a machine's strands are meant, (…, strands), by numbers (…, 1): −1 for all, from 0 on for one
    in the model's order, and after the last for two that follow each other, the loop of a cable; raises a
    `SerpentError` where there is no such strand.
    """
    which, each = np.asarray(strand), np.arange(strands)
    if (beyond := which >= strands + (strands + 1) // 2).any():
        raise SerpentError(
            f"this machine has {strands} strands, and strand {which[beyond].ravel()[0]:g} is neither one of "
            f"them nor the number of a cable, {strands} and more. Set strand to -1, which means all."
        )
    return (which == ALL) | (which == each) | (which == strands + each // 2)
