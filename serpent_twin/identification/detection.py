"""Predict, before any long fit, which parameters and effects logs can tell.

All is to first order at a fit without any step, from the Jacobian J by the declared parameters and the
changes c of the residual by each effect. What all of them together leave of the residual weighs the channels
anew, and the information matrix w J Jᵀ + Λ then gives each parameter's posterior covariance. The strength of
an effect, relative to the one that makes the change c, is known to within 1/√(w cᵀ b), b being what the
parameters cannot take up of c. Where a limit is asked for exactly, twice the strength that would be found by
this is then taken up by a fit, and what that leaves decides.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.acceptance import MIN_GAIN, MIN_Z
from serpent_twin.identification.excitation import advice, excitation
from serpent_twin.identification.explained import EffectChange, Explained, explain
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import fit, spread, telling
from serpent_twin.identification.fitting.null_space import null_combinations
from serpent_twin.identification.fitting.weak_directions import (
    NamedParameter,
    WeakDirection,
    weakest_directions,
)
from serpent_twin.identification.identifiability import (
    ALIKE,
    EffectIdentifiability,
    Identifiability,
    ParameterIdentifiability,
)
from serpent_twin.identification.imitated import Imitation
from serpent_twin.identification.score_test import Score, strengths
from serpent_twin.identification.wording import tried_with
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_LITTLE = 0.005
"""Correlation up to which two errors count as independent"""
_SURELY = 2.0
"""Times the limit to first order, of the strength that a fit is to take up"""
_TRIES = 2
"""Strengths tried at most. Fits take up more of weak effects, so a limit above the strength tried is tried"""
_MOST_TIMES = 1e6
"""Typical strengths up to which a detection limit is sought"""


def opening_fit(case: Case[Any], pieces: Any) -> Fit:
    """First guesses as a fit without any step, with the derivatives by all declared parameters, on segments
    that tell as much as all.
    """
    start, free = ParameterVector.nominal(case.declared), free_parameters(case, ())
    used = spread(len(pieces), case.segments[0])
    if len(used) < len(pieces):
        left = case.residual([start], pieces, case.coarse_step([start]))[0].astype(float)
        used = telling(np.nan_to_num((left**2).mean(axis=1)), used)
    return fit(case, pieces, start, free, 1, len(used), steps=0, used=used)


Keeping = Callable[[str, Callable[[], Array]], Array]
"""Gives the limits of an effect by its name, computed now or read back"""


def identifiability(
    case: Case[Any],
    pieces: Any,
    opening: Fit,
    scored: Sequence[Score],
    exactly: Keeping | None = None,
) -> Identifiability:
    """What logs can tell by a fit of all declared parameters without any step, and score tests on it: with
    detection limits to first order, or, with `exactly`, by a fit for each.
    """
    explained = explain(case, opening, scored)
    effects = [EffectChange(case, explained, score) for score in scored]
    some = case.take(pieces, opening.used)
    goal = cache(lambda timestep: case.residual([opening.point], some, timestep)[0])
    found = []
    for of in effects:
        limits = _first_order(case, explained, of)
        if exactly:
            limits = exactly(
                of.score.name,
                lambda of=of, first=limits: _limits(
                    case, pieces, opening, explained, of, goal, first
                ),
            )
        found.append(_detection(of, effects, limits))
    hidden = {
        each.score.name: each.score.change
        for each, limits in zip(effects, found, strict=True)
        if not limits.told
    }
    found += [_unseen(case.candidates[name], why) for name, why in case.unseen.items()]
    found.sort(key=lambda each: (not each.delay, -each.limit / each.typical))
    parameters, directions = _parameters(case, explained.known, effects)
    known = explained.known
    combined = null_combinations(case.declared, known.slopes, known.weight)
    without = case.compare(opening.point, some)
    return Identifiability(
        parameters,
        tuple(found),
        directions,
        excitation(without),
        advice(case, some, without, hidden),
        opening.residual.size // case.channels,
        1 / explained.known.weight,
        case.not_sought,
        combined=combined,
    )


def _first_order(case: Case[Any], explained: Explained, of: EffectChange) -> Array:
    """How many typical strengths an effect must have to be seen beside what is left of the residual, by
    scatter and by gain, as inverses; and the share of its change that the parameters leave. All to first
    order.
    """
    by_scatter = MIN_Z / np.sqrt(of.information) if of.information > 0 else np.inf
    by_gain = _worth(case, explained, of.beyond)
    return np.array([1 / by_scatter, 1 / by_gain, of.left / of.size if of.size else 1.0])


@np.errstate(divide="ignore")
def _limits(
    case: Case[Any],
    pieces: Any,
    opening: Fit,
    explained: Explained,
    of: EffectChange,
    goal: Callable[[float | None], Array],
    first: Array,
) -> Array:
    """Detection limits after the fit has absorbed what it can of the effect, from the limits to first
    order.
    """
    by_scatter, by_gain = (1 / first[:2]).tolist()
    share = float(first[2])
    times = _SURELY * max(by_scatter, by_gain)
    for _ in range(_TRIES):
        if not times < of.most:
            break
        effect = of.score.name, of.score.sized(of.candidate, times)
        fitted = Imitation(case, pieces, opening, explained.known, explained.scale, effect, goal)
        if (found := fitted.fitted(times**2 * of.information)) is None:
            break
        beyond = found.left / times
        by_scatter = MIN_Z * times / np.sqrt(found.cost)
        by_gain = _worth(case, explained, beyond)
        share = min(1.0, float(beyond @ beyond) / of.size)
        if max(by_scatter, by_gain) <= times:
            break
        times = max(by_scatter, by_gain)
    return np.array([1 / by_scatter, 1 / by_gain, share])


def _detection(
    of: EffectChange, among: Sequence[EffectChange], limits: Array
) -> EffectIdentifiability:
    """The detection limit of an effect, in its unit, from its `_limits`."""
    parameter, allowed = list(of.candidate.ranges.items())[of.at]
    both = [of.typical / float(x) if x * of.most > 1 else np.inf for x in limits[:2]]
    why = "" if np.isfinite(max(both)) else "no strength within its range would show"
    return EffectIdentifiability(
        of.score.name,
        parameter,
        allowed.unit,
        of.typical,
        both[0],
        both[1],
        1 - float(limits[2]),
        _confounded(of, among),
        "the simulation of a twin with it became unstable" if of.score.unstable else why,
        tried_with(of.candidate.ranges, of.score.tried, strengths(of.candidate)),
    )


def _worth(case: Case[Any], explained: Explained, beyond: Array) -> float:
    """Times its strength that an effect must have to better the error by `MIN_GAIN`, pose and the other
    channels weighing alike.

    A twin without it leaves √(σ² + x² b²) where one with it leaves σ.
    """
    measures = [each.measure for each in case.machine.outputs]
    pose = np.array([each == measures[0] for each in measures])

    def squares(rows: Array) -> Array:
        each = ((rows.reshape(-1, case.channels) * explained.noise) ** 2).sum(axis=0)
        return np.array([each[pose].sum(), each[~pose].sum()])

    noise, changed = squares(explained.left), squares(beyond)
    ratio = changed[noise > 0] / noise[noise > 0]

    def gain(times: float) -> float:
        return float(np.mean(1 - 1 / np.sqrt(1 + times**2 * ratio)))

    if not ratio.size or gain(_MOST_TIMES) < MIN_GAIN:
        return np.inf
    low, high = 0.0, _MOST_TIMES
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if gain(middle) < MIN_GAIN else (low, middle)
    return high


def _confounded(of: EffectChange, among: Sequence[EffectChange]) -> dict[str, float]:
    """Effects whose change beyond the parameters has a cosine with this one's above `ALIKE`."""
    out = {}
    for each in among:
        size = np.linalg.norm(of.beyond) * np.linalg.norm(each.beyond)
        if each is not of and size > 0:
            cosine = float(of.beyond @ each.beyond / size)
            out |= {each.score.name: cosine} if abs(cosine) > ALIKE else {}
    return out


def _unseen(candidate: Candidate, why: str) -> EffectIdentifiability:
    """An effect that these logs cannot show, whatever its strength."""
    at = strengths(candidate)[0]
    parameter, allowed = list(candidate.ranges.items())[at]
    typical, none = abs(float(candidate.variants[0][at])), float("inf")
    return EffectIdentifiability(
        candidate.name, parameter, allowed.unit, typical, none, none, 0.0, {}, why
    )


def _parameters(
    case: Case[Any], known: Information, effects: Sequence[EffectChange]
) -> tuple[tuple[ParameterIdentifiability, ...], tuple[WeakDirection, ...]]:
    """What the logs tell of each declared quantity and of their combinations.

    What several quantities have in common is in each of them, and not listed apart.
    """
    names = [each.name for each in case.declared]
    shared = {n for q in case.quantities if len(q.of) > 1 for n in q.of}
    several = [q for q in case.quantities if len(q.of) > 1 or not shared & set(q.of)]
    adds = np.array([[name in q.of for name in names] for q in several], float)
    each = np.array([q.scale or q.start for q in several])
    prior = adds @ np.diag(1 / known.prior) @ adds.T
    posterior = adds @ np.linalg.inv(known.matrix) @ adds.T
    inflation = np.diag(posterior) * np.diag(np.linalg.inv(posterior))
    partners = _partners([q.name for q in several], posterior, adds, effects)
    found = []
    for k, q in enumerate(several):
        before, after = (abs(float(each[k])) * float(np.sqrt(c[k, k])) for c in (prior, posterior))
        found.append(
            ParameterIdentifiability(
                q.name, q.unit, before, after, float(inflation[k]), *partners[k]
            )
        )
    percent = np.array([q.scale or 100.0 for q in several])
    units = np.outer(percent, percent)
    told = [NamedParameter(q.name, q.unit if q.scale else "%") for q in several]
    return tuple(found), weakest_directions(told, units * prior, units * posterior)


def _partners(
    names: Sequence[str], posterior: Array, adds: Array, effects: Sequence[EffectChange]
) -> list[tuple[str, float]]:
    """What each quantity's error is most correlated with: another's, or an effect's strength if it were
    fitted, too, with the correlation.
    """
    width = np.sqrt(np.diag(posterior))
    columns = posterior / np.outer(width, width)
    np.fill_diagonal(columns, 0.0)
    labels = list(names)
    for effect in (each for each in effects if each.information > 0):
        taken = adds @ effect.taken
        wider = np.sqrt(effect.information * width**2 + taken**2)
        columns = np.column_stack([columns, -taken / wider])
        labels.append(effect.score.name.replace("_", " "))
    most = np.argmax(np.abs(columns), axis=1)
    pairs = [(labels[at], float(columns[k, at])) for k, at in enumerate(most)]
    return [(name, size) if abs(size) > _LITTLE else ("", 0.0) for name, size in pairs]
