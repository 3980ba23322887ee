"""Find effects that logs cannot tell apart, and effects that help only together.

To first order an effect is what it changes of the residual beyond the free parameters. The cosine of two such
changes says how alike two effects look; their Gram matrix, what two of them remove together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.score_test import EXCITED, Score, strengths
from serpent_twin.machines.candidate import Candidate

ALIKE = 0.8
"""Cosine from which one effect is another's rival"""
APART = 0.05
"""Most probability that the accepted effect is no better than a rival, for the logs to tell them apart"""
_TOGETHER = 1.5
"""Times what the better of two effects removes alone, that a pair must remove to be tried"""
_WORTH_A_FIT = 0.03
"""Share of the residual's squares that a pair must remove to be tried"""
_PAIRS = 2


@dataclass(frozen=True)
class Rival:
    """An effect that looks like an accepted one."""

    name: str
    cosine: float
    """Cosine between what both change of the residual beyond the free parameters [1]"""
    gap: float | None
    """Held-out error of the rival less that of the accepted effect, in the measure's unit; None if not
    fitted
    """
    probability: float | None
    """Probability that it is not less [1]"""
    hardly: bool = False
    """Whether both are composed laws, and the accepted one's held-out error is less by next to nothing"""

    @property
    def told_apart(self) -> bool:
        """Whether the logs tell the two apart."""
        return self.probability is not None and self.probability < APART and not self.hardly

    def numbers(self, unit: str) -> dict[str, Any]:
        """Entries of diagnosis.json."""
        return {
            "name": self.name,
            "cosine": self.cosine,
            f"gap_{unit}": self.gap,
            "probability_of_chance": self.probability,
            "told_apart": self.told_apart,
        }


@dataclass(frozen=True)
class Pair:
    """Two effects, and what they remove together to first order."""

    names: tuple[str, str]
    share: float
    """Share of the residual's squares [1]"""
    alone: float
    """What the better of the two removes alone [1]"""
    size: tuple[float, float]
    """Size of each effect's change, with its sign [1]"""


def cosine(one: Score, other: Score) -> float:
    """Absolute cosine between what two effects change of the residual beyond the free parameters."""
    return along_one_line(one.beyond, other.beyond)


def along_one_line(one: Array, other: Array) -> float:
    """The cosine of two changes, (N,), without its sign; 0 if one of them is nothing."""
    length = np.linalg.norm(one) * np.linalg.norm(other)
    return float(abs(np.dot(one, other)) / length) if length > 0 else 0.0


def rivals(
    winner: str, scores: Mapping[str, Score], candidates: Mapping[str, Candidate]
) -> dict[str, float]:
    """Effects that look like the winner, the most alike first, with the cosine; not those that look like its
    opposite, where neither can have another sign.
    """
    one_way = {name for name in scores if not _signed(candidates[name])}
    others = {
        name: cosine(scores[winner], each)
        for name, each in scores.items()
        if name != winner
        and (not {winner, name} <= one_way or np.dot(each.beyond, scores[winner].beyond) >= 0)
    }
    order = sorted(others, key=lambda name: -others[name])
    return {name: others[name] for name in order if others[name] > ALIKE}


def pairs(
    scores: Sequence[Score], residual: Array, candidates: Mapping[str, Candidate]
) -> list[Pair]:
    """The pairs that remove more than either effect alone, the best first; each strength with a sign that it
    may have.
    """
    seen = [each for each in scores if each.excitation > EXCITED and each.beyond.any()]
    total = float((residual.astype(float) ** 2).sum())
    found = []
    for one, other in combinations(seen, 2):
        both = np.array([one.beyond, other.beyond], float)
        gram, pull = both @ both.T, both @ residual.ravel()
        if np.linalg.cond(gram) > 1e6:
            continue
        size = -np.linalg.solve(gram, pull)
        signed = [_signed(candidates[each.name]) for each in (one, other)]
        if any(value <= 0 and not both for value, both in zip(size, signed, strict=True)):
            continue
        share, alone = float(-size @ pull) / total, max(one.share, other.share)
        if share > max(_WORTH_A_FIT, _TOGETHER * alone):
            names = (one.name, other.name)
            found.append(Pair(names, share, alone, (float(size[0]), float(size[1]))))
    return sorted(found, key=lambda each: -each.share)[:_PAIRS]


def _signed(candidate: Candidate) -> bool:
    ranges = list(candidate.ranges.values())
    return ranges[strengths(candidate)[0]].low < 0
