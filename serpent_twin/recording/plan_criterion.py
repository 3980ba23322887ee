"""Compute how well logs tell an effect from nothing, or from a rival, to first order.

With the derivative J of the residual by the free parameters, their inverse prior variances Λ, the changes d
of the residual by effects of given strengths, and the weight w of the residual's numbers, the evidence is the
Gram matrix G = w V Vᵀ + diag(Λ, 0) of the rows V = [J; d]. Independent logs add: G = G_old + G_new. The
squared distance, in standard deviations, between an effect and whatever else could explain it is the Schur
complement of its row in G after the rows of the free parameters, and of the rival, are eliminated: the
T-optimal design criterion of Atkinson and Fedorov (Biometrika 62, 1975), with all declared parameters and the
rival's strength refitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from serpent_twin.arrays import Array

_LEAST_SHARE = 0.02
"""Share of a distance that is taken as confirmed where held-out logs confirm nothing"""
_HIDDEN = 2.0
"""Distance from nothing, in standard deviations, up to which logs hide an effect"""
_LEAST = 1e-12
"""Share of an effect's own change below which what is left is rounding"""


@dataclass(frozen=True)
class Question:
    """Whether an effect is told from nothing, or from a rival."""

    effect: str
    rival: str
    """Empty: nothing; then the effect's own standard error is asked for"""
    row: int
    """The effect's row in the Gram matrix"""
    against: tuple[tuple[int, ...], ...]
    """Rows that may explain it instead, for each variant of the rival"""
    free: tuple[int, ...] = ()
    """Rows of the free parameters"""
    share: float = 1.0
    """Share of the distance that counts [1]"""

    def __str__(self) -> str:
        name = self.effect.replace("_", " ")
        return f"{name} or {self.rival.replace('_', ' ')}" if self.rival else f"strength of {name}"

    def distance(self, gram: Array) -> float:
        """Between the effect and the best fit without it, in standard deviations."""
        squares = min(schur(gram, self.row, rows) for rows in self.against)
        return self.share * float(np.sqrt(squares))

    def confirmed(self, gram: Array, chance: float) -> "Question":
        """Question with the share of the distance at which these logs name the right one as surely as the
        held-out logs did: the rest is lost to what the twin is wrong about.
        """
        whole = self.distance(gram)
        seen = 2 * float(scipy.special.ndtri(1 - np.clip(chance, 1e-6, 0.5)))
        return replace(self, share=float(np.clip(seen / max(whole, 1e-9), _LEAST_SHARE, 1.0)))

    def hidden(self, gram: Array) -> "Question":
        """Question about an effect no stronger than these logs can hide: an effect that they show beyond
        doubt at its typical strength would otherwise ask for nothing.
        """
        shown = float(np.sqrt(schur(gram, self.row, self.free)))
        return replace(self, share=min(1.0, _HIDDEN / max(shown, 1e-9)))

    def probability(self, gram: Array) -> float:
        """Probability that the log-likelihood ratio names the right one of effect and rival, or of effect and
        nothing: the ratio is normal, with mean d²/2 and variance d² at the distance d, so Φ(d / 2).
        """
        return float(scipy.special.ndtr(self.distance(gram) / 2))

    def relative_error(self, gram: Array) -> float:
        """Expected standard error of the effect's strength, as a share of that strength: 1 / d."""
        distance = self.distance(gram)
        return 1 / distance if distance > 0 else np.inf


def gram(rows: Array, weight: float) -> Array:
    """The evidence of rows V, (R, N), whose numbers have a weight, (R, R)."""
    rows = rows.astype(float)
    return weight * (rows @ rows.T)


def schur(gram: Array, row: int, others: Sequence[int]) -> float:
    """What is left of a row's squared length beyond its projection on other rows."""
    own, at = float(gram[row, row]), list(others)
    if not at or own <= 0:
        return max(own, 0.0)
    size = np.sqrt(np.maximum(np.diag(gram)[at], 1e-300))
    scaled = gram[np.ix_(at, at)] / np.outer(size, size)
    along = gram[at, row] / size
    left = own - float(along @ np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) @ along)
    return left if left > _LEAST * own else 0.0


def chosen(
    known: Array, pieces: Sequence[Array], questions: Sequence[Question], count: int
) -> list[int]:
    """Which pieces of motion to run, one by one, each the one after which most questions are expected to be
    answered rightly; a piece may be run again, which adds the same again. A question that no piece answers
    takes none from the others.
    """
    out: list[int] = []
    for _ in range(count):
        after = [_expected(known + each, questions) for each in pieces]
        out.append(int(np.argmax(after)))
        known = known + pieces[out[-1]]
    return out


def _expected(gram: Array, questions: Sequence[Question]) -> float:
    """How many questions are expected to be answered rightly."""
    return sum(each.probability(gram) for each in questions)
