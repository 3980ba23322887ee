"""Propose motions of a machine: of all kinds in turn, those are kept that keep its limits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError

_TURNS = 3
"""Motions tried for each that is wanted"""
S = TypeVar("S")
K = TypeVar("K")


@dataclass(frozen=True)
class CommandColumn:
    """A column that commands a machine, and the limits that proposed motions keep in it."""

    name: str
    unit: str
    low: float
    high: float
    fastest: float = float("nan")
    """Most change per second; NaN where there is no such limit"""


@dataclass(frozen=True)
class Proposals(Generic[S]):
    """Motions that keep a machine's limits, each from and to the same pose, so that any order of them is a
    motion.
    """

    kinds: tuple[str, ...]
    """What each is, (M,)"""
    columns: tuple[CommandColumn, ...]
    """What commands the machine, (D,)"""
    targets: Array
    """Commands in the units of the columns, (M, T, D)"""
    pieces: S
    """What the machine's twin makes of the motions, in segments, each motion a session; in their order"""
    about: str
    """Which limits they keep, and how they begin and end, in sentences"""
    time: tuple[str, float] | None = None
    """Column of the time in a file of the motion, and its unit [s]"""


def kept_ones(
    kinds: Sequence[str],
    count: int,
    make: Callable[[str, int], Array],
    keep: Callable[[Sequence[Array], int], Sequence[tuple[K | None, str]]],
    whose: str,
) -> tuple[tuple[str, ...], Array, list[K]]:
    """Kinds, targets and what a twin made of up to `count` motions that keep the limits of `whose`. `make`
    makes one of a kind, in one of three turns of `count` tries; `keep` gives for each of some, counted from a
    number, what the twin made of it, or nothing and why not.
    """
    found: list[tuple[str, Array, K]] = []
    tried, why = 0, ""
    while len(found) < count and tried < _TURNS * count:
        ends = min(tried + count - len(found), _TURNS * count)
        names = [kinds[n % len(kinds)] for n in range(tried, ends)]
        targets = [make(name, n // count) for n, name in enumerate(names, tried)]
        for name, target, (done, reason) in zip(names, targets, keep(targets, tried), strict=True):
            why = reason or why
            if done is not None:
                found.append((name, target, done))
        tried = ends
    if not found:
        raise SerpentError(
            f"none of {tried} motions keeps {whose} limits. The last that was refused: {why}"
        )
    names, targets, done = zip(*found, strict=True)
    return names, np.array(targets), list(done)
