"""Score candidate effects to first order, and select those that are fitted fully."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Range, place_of
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import steadied
from serpent_twin.identification.fitting.information import Information
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

EXCITED = 0.02
"""An effect whose typical strength changes the residual by less than this share of its rms is not excited"""
WORTH_A_FIT, BESIDE_OTHERS = 0.015, 0.03
"""Share of the residual's squares that a candidate must remove in the score test, and beside effects that
left little. A full fit removes a few times as much, where calibration has absorbed an effect or its law
bends; acceptance asks for about 0.08."""
_BESIDE_THE_BEST = 0.1
"""A candidate is fitted only if it removes at least this fraction of what the best candidate removes"""
_LIKE_THE_BEST, _AT_LEAST = 0.03, 0.005
"""A candidate that can be confused with the best is fitted if it removes at least the first fraction of
what the best removes, and the second of the residual's squares: what removes less would not be accepted in
its place
"""
_AT_ONE_PLACE = 0.8
"""A candidate is fitted if it removes at least this fraction of what a candidate at the same place removes
with which it can be confused
"""
_SHOWS = 0.003
"""Share of the residual's squares from which a candidate's places are tried: one cable of ten shows by about
a tenth in what all change"""
_PLACED = 3
"""Candidates whose places are tried, and those alike: 11 simulations each, of some 28,000 steps on the arm"""
_CLEARLY = 1.05
"""Times the share of a place that one within it must remove: where only one strand of a cable pulls, it and
the cable look alike
"""
_NEARLY = 0.7
"""Share of what its place removes that one within it must remove to be fitted fully as well: where a law
bends, first order cannot say which of the two it is
"""


@dataclass(frozen=True)
class Score:
    """The share that one candidate would remove at the calibrated optimum, to first order."""

    name: str
    share: float
    """Share of the residual's squares that free parameters leave to first order [1]"""
    excitation: float
    """How much its typical strength changes the residual, as a share of the residual's rms [1]"""
    start: Array
    """Parameters of the effect at which a full fit should begin"""
    unstable: bool = False
    """Whether no strength of it could be simulated"""
    change: Array = field(default_factory=lambda: np.zeros(0, np.float32))
    """What its best variant changes of the residual, (N,); 0 where none could be simulated"""
    beyond: Array = field(default_factory=lambda: np.zeros(0, np.float32))
    """The change beyond the free parameters of the base, (N,)"""
    tried: Array = field(default_factory=lambda: np.zeros(0))
    """The parameters of that variant"""
    within: Array = field(default_factory=lambda: np.zeros(0))
    """Its parameters at the best place within its own, if that removes nearly as much; else nothing"""

    def sized(self, candidate: Candidate, size: float) -> Array:
        """The parameters of that variant with its strengths times a size, within their ranges."""
        values = _scaled(candidate, self.tried, size)
        return self.start if values is None else values


def scores(case: Case[Any], pieces: Any, base: Fit, candidates: Sequence[Candidate]) -> list[Score]:
    """The score tests of candidates: one simulation per variant, side by side, with the base's Jacobian."""
    return list(
        _tested(case, pieces, base, {c.name: (c, _columns(c)) for c in candidates}).values()
    )


def placed(case: Case[Any], pieces: Any, base: Fit, found: Mapping[str, Score]) -> list[Score]:
    """New scores, at a better place, of the best few candidates that show and may be at many places: each
    place is tried within the best one so far.
    """
    now, better = dict(found), set[str]()
    nearer = _nearer([case.candidates[name] for name in found], now)
    while nearer:
        tested = _tested(case, pieces, base, nearer)
        several = {n: s for n, s in tested.items() if s.share > _CLEARLY * now[n].share}
        near = {n: s for n, s in tested.items() if s.share > _NEARLY * now[n].share}
        now |= {n: replace(now[n], within=s.start) for n, s in near.items()}
        now |= {n: replace(s, excitation=now[n].excitation) for n, s in several.items()}
        better |= {*several, *near}
        nearer = _nearer([nearer[n][0] for n in several], now)
    return [score for name, score in now.items() if name in better]


_Tried = Mapping[str, tuple[Candidate, Sequence[Array]]]
"""Candidates by name, each with values of all its parameters"""


def _tested(case: Case[Any], pieces: Any, base: Fit, tried: _Tried) -> dict[str, Score]:
    """The score of each candidate on top of a base, by the best of the values tried."""
    some, known = case.take(pieces, base.used), Information.of(case, base)
    points = {n: [base.point.having(n, v) for v in columns] for n, (_, columns) in tried.items()}
    every = [base.point, *(point for several in points.values() for point in several)]
    without, *changed = case.residual(every, some, case.coarse_step(every))
    flat, out = base.residual.ravel().astype(float), {}
    left = known.left(flat)
    for name, (candidate, _) in tried.items():
        changes = np.array([changed.pop(0) - without for _ in points[name]])
        weaker = partial(_weaker_point, base, candidate, points[name])
        changes = steadied(case, some, base.point, changes, weaker)
        out[name] = _score(known, flat, left, candidate, points[name], changes)
    return out


def _nearer(candidates: Sequence[Candidate], found: Mapping[str, Score]) -> _Tried:
    """The places within each candidate's best one, of the best few candidates that show and have some, and of
    those that these can be confused with.
    """
    tried = {c.name: (c, _places(c, found[c.name].tried)) for c in candidates}
    shown = [n for n, (_, places) in tried.items() if places and found[n].share > _SHOWS]
    best = sorted(shown, key=lambda n: -found[n].share)[:_PLACED]
    alike = [like for name in best for like in tried[name][0].confused_with if like in shown]
    return {name: tried[name] for name in dict.fromkeys([*best, *alike])}


def _places(candidate: Candidate, values: Array) -> list[Array]:
    """Values at the places within the one that they have, by all variants that are alike in what is not
    fitted: a threshold that suits all places need not suit one.
    """
    ranges, out = list(candidate.ranges.values()), []
    for n, allowed in enumerate(ranges):
        if not allowed.within:
            continue
        given = [k for k, each in enumerate(ranges) if not each.fitted and k != n]
        several = [each for each in candidate.variants if (each[given] == values[given]).all()]
        for place in allowed.within(values[n]):
            out += [np.where(np.arange(len(ranges)) == n, place, each) for each in several]
    return out


def _score(
    known: Information,
    flat: Array,
    remains: float,
    candidate: Candidate,
    points: Sequence[ParameterVector],
    changes: Array,
) -> Score:
    """The best variant of a candidate, from what each changes, (k, S, n), of the residual, (N,), of whose
    squares free parameters leave what `remains`.
    """
    none = np.zeros(flat.size, np.float32)
    start, most = candidate.variants[0], 0.0
    best = Score(candidate.name, 0.0, 0.0, start, change=none, beyond=none, tried=start)
    for change, point in zip(changes.reshape(len(changes), -1), points, strict=True):
        if not np.isfinite(change).all():
            continue
        left, removed, size = known.projected(change.astype(float), flat)
        most = max(most, float(np.linalg.norm(change) / max(np.linalg.norm(flat), 1e-15)))
        tried = point.effects[candidate.name]
        start = _scaled(candidate, tried, size)
        share = min(removed / max(remains, 1e-30), 1.0) if start is not None else 0.0
        start = tried if start is None else start
        if share > best.share or not best.beyond.any():
            left = left.astype(np.float32)
            best = Score(candidate.name, share, 0.0, start, False, change, left, tried)
    unstable = not np.isfinite(changes).all(axis=(1, 2)).any()
    return replace(best, excitation=most, unstable=unstable)


def _weaker_point(
    base: Fit, candidate: Candidate, points: Sequence[ParameterVector], k: int, share: float
) -> ParameterVector:
    """Parameter vector number k with a share of the candidate's strengths."""
    values = points[k].effects[candidate.name]
    return base.point.having(candidate.name, times_strength(candidate, values, share))


def _columns(candidate: Candidate) -> list[Array]:
    """Parameter values to try: every variant; of several strengths, each alone."""
    if candidate.whole:
        return list(candidate.variants)
    strong = strengths(candidate)
    tried = []
    for values in candidate.variants:
        for k in strong:
            alone = values.copy()
            alone[[n for n in strong if n != k]] = 0.0
            tried.append(alone)
    return tried


def strengths(candidate: Candidate) -> list[int]:
    """Indices of a candidate's parameters that are its strength."""
    return [list(candidate.ranges).index(name) for name in effects.strengths(candidate.ranges)]


def _scaled(candidate: Candidate, values: Array, size: float) -> Array | None:
    """Values with their strengths times a size; None where that leaves the range."""
    out = values.copy()
    ranges = list(candidate.ranges.values())
    for k in strengths(candidate):
        if ranges[k].low >= 0 and size <= 0:
            return None
        out[k] = np.clip(size * values[k], ranges[k].low, 0.8 * ranges[k].high)
    return out


def at_bound(candidate: Candidate, values: Array) -> list[str]:
    """Names of fitted parameters that lie at an end of their range other than absence, or are its law."""
    return [
        name
        for (name, allowed), value in zip(candidate.ranges.items(), values, strict=True)
        if allowed.fitted
        and (
            value >= min(allowed.high, allowed.limit_begins)
            or (allowed.low < 0 and value <= allowed.low)
        )
    ]


def too_strong(candidate: Candidate, values: Array) -> list[str]:
    """Names of strengths that run to the end of their range, a sign that the effect stands for another."""
    strong = [list(candidate.ranges)[k] for k in strengths(candidate)]
    ends = at_bound(candidate, values)
    return [name for name in ends if name in strong and not candidate.ranges[name].limit]


def limits(candidate: Candidate, values: Array) -> list[str]:
    """What parameters at the end of their range mean, where that is a law of its own."""
    return [each for name in at_bound(candidate, values) if (each := candidate.ranges[name].limit)]


def worth_fitting(
    scores: Sequence[Score],
    candidates: Mapping[str, Candidate],
    least: float = WORTH_A_FIT,
    most: int = 3,
) -> list[str]:
    """Names of candidates to fit fully: the best few of those that remove at least a share, and those that
    the best can be confused with and that remove something, too; at one place only what removes nearly as
    much as the best of its like there.
    """
    ranked = [
        s for s in sorted(scores, key=lambda s: -s.share) if not _outshone(s, scores, candidates)
    ]
    least = max(least, _BESIDE_THE_BEST * ranked[0].share) if ranked else 0.0
    best = [s.name for s in ranked if s.share > least and s.excitation > EXCITED][:most]
    excited = {s.name for s in scores if s.excitation > EXCITED}
    least = max(_AT_LEAST, _LIKE_THE_BEST * ranked[0].share) if best else np.inf
    near = {s.name for s in ranked if s.share > least}
    alike = [n for name in best[:1] for n in candidates[name].confused_with if n in excited & near]
    return list(dict.fromkeys([*best, *alike]))


def _outshone(one: Score, scores: Sequence[Score], candidates: Mapping[str, Candidate]) -> bool:
    """Whether another that it can be confused with removes clearly more at the same place."""
    place, like = place_of(one.name), candidates[one.name].confused_with
    return bool(place) and any(
        other.name in like
        and place_of(other.name) == place
        and one.share < _AT_ONE_PLACE * other.share
        for other in scores
    )


def times_strength(candidate: Candidate, values: Array, factor: float) -> Array:
    """A candidate's parameters with its strengths times a factor, within their ranges."""
    return times(list(candidate.ranges.values()), values, strengths(candidate), factor)


def times(ranges: Sequence[Range], values: Array, which: Sequence[int], factor: float) -> Array:
    """Values with some of them times a factor, within their ranges."""
    out = values.copy()
    for k in which:
        out[k] = np.clip(factor * values[k], ranges[k].low, ranges[k].high)
    return out
