"""Compute how well logs tell an effect from nothing, or from a rival, to first order.

With the derivative J of the residual by the free parameters, their inverse prior variances Λ, the changes d
of the residual by effects of given strengths, and the weight w of the residual's numbers, the evidence is the
Gram matrix G = w V Vᵀ + diag(Λ, 0) of the rows V = [J; d]. Independent logs add: G = G_old + G_new. The
squared distance, in standard deviations, between an effect and whatever else could explain it is the Schur
complement of its row in G after the rows of the free parameters, and of the rival, are eliminated: the
T-optimal design criterion of Atkinson and Fedorov (Biometrika 62, 1975), with all declared parameters and the
rival's strength refitted.

A trace asks for more than a distance: an effect must also lessen the error of held-out logs by a least
share, and in most of their blocks: if it shows in one piece of motion only, that may be chance. Longer logs
do not make that share larger, and at usual noise it is the higher bar. It depends on the squares that an
effect changes of each measure, beyond what the parameters take up, beside those that the twin leaves. Both
bars together give a detection limit, the least strength that is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from serpent_twin.arrays import Array
from serpent_twin.identification.acceptance import SURE, WORTH_IT
from serpent_twin.identification.held_out import CONFIRMED, chance

_LEAST_SHARE = 0.02
"""Of a distance, what is taken as confirmed where held-out logs confirm nothing"""
_HIDDEN = 2.0
"""Distance from nothing, in standard deviations, up to which logs hide an effect"""
_LEAST = 1e-12
"""Share of an effect's own change below which what is left is rounding"""


_USUAL, _FACTOR = 0.5, 2.0
"""Of an effect that logs hide: the strength's median as a share of their detection limit, and the factor by
which it is one standard deviation larger"""
_CHANCE = CONFIRMED / 2
"""Most probability of chance of the gains that are expected, which noise will scatter"""
_TIMES = np.geomspace(0.05, 20.0, 13)
"""Strengths, in those that change as much as the twin leaves, between which a detection limit is sought"""
_HALVINGS = 8


@dataclass(frozen=True)
class Evidence:
    """What S segments of logs or motions tell of R rows: of parameters and effects."""

    gram: Array
    """Their Gram matrix, weighed as a fit weighs it, (R, R)"""
    changed: Array
    """Their Gram matrices in B blocks of each segment, by measure, the pose's and the others', each in its
    unit, (S, B, 2, R, R)"""
    left: Array
    """Squares that the twin leaves there, (S, B, 2)"""


def added(several: Sequence[Evidence]) -> Evidence:
    """Of several together."""
    return Evidence(
        np.sum([each.gram for each in several], axis=0),
        np.concatenate([each.changed for each in several]),
        np.concatenate([each.left for each in several]),
    )


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
    """Of the distance, what counts [1]"""
    limit_before: float = 0.0
    """Detection limit of the logs, in times the effect's strength, of an effect that they did not show; 0 for
    other questions"""
    weight: float = 1.0
    """How much its answer counts beside those of others [1]"""
    strength: float = 1.0
    """The effect's, in `unit`"""
    unit: str = "1"

    def __str__(self) -> str:
        name = self.effect.replace("_", " ")
        return f"{name} or {self.rival.replace('_', ' ')}" if self.rival else f"strength of {name}"

    def distance(self, gram: Array) -> float:
        """Between the effect and the best fit without it, in standard deviations."""
        squares = min(schur(gram, self.row, rows) for rows in self.against)
        return self.share * float(np.sqrt(squares))

    def confirmed(self, gram: Array, chance: float) -> "Question":
        """The same with the share of the distance at which these logs name the right one as surely as the
        held-out logs did: the rest is lost to what the twin is wrong about.
        """
        whole = self.distance(gram)
        seen = 2 * float(ndtri(1 - np.clip(chance, 1e-6, 0.5)))
        return replace(self, share=float(np.clip(seen / max(whole, 1e-9), _LEAST_SHARE, 1.0)))

    def hidden(self, known: Evidence) -> "Question":
        """The same about an effect no stronger than these logs can hide: one that they show beyond doubt at
        its typical strength would otherwise ask for nothing.
        """
        shown = float(np.sqrt(schur(known.gram, self.row, self.free)))
        share = min(1.0, _HIDDEN / max(shown, 1e-9))
        limit = 0.0 if self.rival else self.limit(known.gram, known)
        return replace(self, share=share, limit_before=limit)

    def limit(self, gram: Array, judged: Evidence) -> float:
        """Detection limit, in times the effect's strength: the least at which it is `SURE` standard errors
        from zero by all that is known, and worth its parameters, beyond chance, in the logs that are judged.
        """
        left = np.zeros(len(gram))
        left[self.row], free = 1.0, list(self.free)
        left[free] = -projection(gram, self.row, free)
        changed = np.maximum(
            np.einsum("i,sbmij,j->sbm", left, judged.changed, left, optimize=True), 0
        )
        scatter = SURE / max(np.sqrt(schur(gram, self.row, free)), 1e-9)
        return max(float(scatter), least_worth(changed, judged.left))

    def answered(self, known: Evidence, motion: Evidence) -> float:
        """Probability that logs and a motion answer it rightly. Of an effect that the logs hid, it is that of
        a strength beyond the detection limit; the strength's logarithm is normal.
        """
        both = known.gram + motion.gram
        if not self.limit_before:
            return self.probability(both)
        limit = self.limit(both, motion)
        if not np.isfinite(limit):
            return 0.0
        return float(ndtr(np.log(_USUAL * self.limit_before / limit) / np.log(_FACTOR)))

    def probability(self, gram: Array) -> float:
        """That the log-likelihood ratio names the right one of effect and rival, or of effect and nothing: it
        is normal, with mean d²/2 and variance d² at the distance d, so Φ(d / 2).
        """
        return float(ndtr(self.distance(gram) / 2))

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
    left = own - float(gram[at, row] @ projection(gram, row, at))
    return left if left > _LEAST * own else 0.0


def projection(gram: Array, row: int, others: Sequence[int]) -> Array:
    """By how much of each of some other rows a row is explained best, (len(others),)."""
    at = list(others)
    size = np.sqrt(np.maximum(np.diag(gram)[at], 1e-300))
    scaled = gram[np.ix_(at, at)] / np.outer(size, size)
    found: Array = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) @ (gram[at, row] / size)
    return found / size


def chosen(
    known: Evidence,
    pieces: Sequence[Evidence],
    questions: Sequence[Question],
    count: int,
    kinds: Sequence[str] = (),
) -> list[int]:
    """Which pieces of motion to run, one by one, each the one after which most questions are expected to be
    answered rightly; a piece may be run again, which adds the same again. A question that no piece answers
    takes none from the others.

    With the pieces' kinds, all are of one kind, the best: what a twin leaves differs between kinds by more
    than is known beforehand, and to a trace, gains that differ between blocks may be chance.
    """
    each = dict.fromkeys(kinds) or ("",)
    groups = [[n for n in range(len(pieces)) if not kinds or kinds[n] == kind] for kind in each]
    found = [_one_by_one(known, pieces, questions, count, group) for group in groups]
    return max(found, key=lambda pair: pair[0])[1]


def _one_by_one(
    known: Evidence,
    pieces: Sequence[Evidence],
    questions: Sequence[Question],
    count: int,
    among: Sequence[int],
) -> tuple[float, list[int]]:
    """How many questions some of the pieces are expected to answer, and which they are."""
    out: list[int] = []
    most = 0.0
    for _ in range(count):
        motions = [added([pieces[k] for k in (*out, n)]) for n in among]
        after = [_expected(known, each, questions) for each in motions]
        most = max(after)
        out.append(among[after.index(most)])
    return most, out


def _expected(known: Evidence, motion: Evidence, questions: Sequence[Question]) -> float:
    """How many questions are expected to be answered rightly."""
    return sum(each.weight * each.answered(known, motion) for each in questions)


def least_worth(changed: Array, left: Array) -> float:
    """Times its strength that an effect must have to better the error of held-out logs by `WORTH_IT`, and
    evenly enough for the test of the gains of blocks; infinite if none does.

    `changed` are squares that it changes of each measure in each block, (S, B, M), `left` what a twin with it
    leaves: a twin without it leaves √(left + x² changed). Measures weigh alike.
    """
    there = left.sum(axis=(0, 1)) > 0
    changed, left = changed[..., there], left[..., there]

    def worth(times: float) -> bool:
        before, after = np.sqrt(left + times**2 * changed), np.sqrt(left)
        gains = ((before - after) / before.mean(axis=(0, 1))).mean(axis=-1)
        return bool(gains.mean() > WORTH_IT and chance(gains) < _CHANCE)

    if not there.any() or not changed.any():
        return np.inf
    tried = np.sqrt(left.sum() / changed.sum()) * _TIMES
    passed = np.flatnonzero([worth(times) for times in tried])
    if not len(passed):
        return np.inf
    high = tried[passed[0]]
    low = tried[passed[0] - 1] if passed[0] else 0.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if worth(middle) else (middle, high)
    return float(high)
