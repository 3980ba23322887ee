"""Choose effects together where what they change adds up, as torques by inverse dynamics do.

Nothing is simulated between rows, so that a score test knows what each effect changes whatever the others
are: orthogonal matching pursuit chooses them, one fit of all says how strong they are, and each must show,
on logs not used, that the others do not do without it.
Source: Pati, Rezaiifar and Krishnaprasad, Orthogonal matching pursuit, 27th Asilomar Conference, 1993;
backward elimination as in Draper and Smith, Applied Regression Analysis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.acceptance import (
    DECISIVE_GAIN,
    CandidateTrial,
    Round,
    weakness,
    weakness_of_fit,
)
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.held_out import Errors
from serpent_twin.identification.score_test import WORTH_A_FIT, Score
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.numerals import counted

_DERIVATIVES = 2
_DIFFERENCE = 0.2
"""Difference of a parameter, in its value or what is typical"""
_NEARLY = 0.8
"""Share of what the best candidate removes, from which another may be what is there in its place"""
_OWN = 0.03
"""Least size of a change's own part, of the whole, from which it is a direction of its own"""


@dataclass(frozen=True)
class Together:
    """Effects that were fitted together, and what each gains beside the others."""

    fit: Fit
    """Fit of those that stand"""
    trials: dict[str, CandidateTrial]
    """Each effect that was fitted, judged against the fit without it"""
    names: tuple[str, ...]
    """Names of those that stand"""


def all_at_once(
    trials: Trials, case: Case[Any], base: Fit, before: Errors, names: Sequence[str], number: int
) -> Round:
    """A round that accepts all effects that explain something beside each other."""
    stage = f"{number}_base"
    found = trials.placed(stage, case, base, trials.scores(stage, case, base, names))
    out = {name: CandidateTrial(score, None, None, before.marker) for name, score in found.items()}
    sizes = chosen(case, base, spans(trials, case, base, found))
    if not sizes:
        return Round(base, before, out, ())
    trials.on_progress(f"round {number}: fitting {counted(len(sizes), 'effect')} together")
    point = base.point
    for name, size in sizes.items():
        point = point.having(name, found[name].sized(case.candidates[name], size))
    free, most = free_parameters(case, list(point.effects)), len(base.used)
    joint = trials.stable(
        f"fit_{number}_together",
        lambda: fit(
            case, trials.training, point, free, _DERIVATIVES, most, trials.on_progress, known=base
        ),
    )
    if joint is None:
        return Round(base, before, out, ())
    several = standing(trials, case, joint, {name: found[name] for name in sizes}, f"{number}")
    return Round(base, before, out | several.trials, several.names, together=True)


def chosen(case: Case[Any], base: Fit, changes: Mapping[str, Array]) -> dict[str, float]:
    """Candidates that remove a share of what the ones before them leave, as `alternatives` has them, with the
    sizes of the first of their changes: with all others together or, where that has a sign that it may not
    have, alone.
    """
    several = alternatives(case, base, changes, WORTH_A_FIT)
    best = [next(iter(each.items())) for each in several]
    if not best:
        return {}
    sizes = dict(best)
    goal = Information.of(case, base).beyond(base.residual.ravel().astype(float))
    together = zip(sizes, _sizes([changes[n] for n in sizes], goal), strict=True)
    return sizes | {n: size for n, size in together if _allowed(case.candidates[n], size)}


def alternatives(
    case: Case[Any], base: Fit, changes: Mapping[str, Array], least: float
) -> list[dict[str, float]]:
    """What explains a residual to first order: one candidate after the other that removes a share, at least,
    of what the ones before it leave, each with those that remove nearly as much in its place, best first, and
    the size of the first of its changes. What each changes by all that it has is given, (k, N), beyond what
    the base takes up.
    """
    known, flat = Information.of(case, base), base.residual.ravel().astype(float)
    rest, remains = known.beyond(flat), known.left(flat)
    found, left = list[dict[str, float]](), {n: each.astype(float) for n, each in changes.items()}
    while left:
        ways = {n: _directions(each) for n, each in left.items()}
        removed = {n: float(((each @ rest) ** 2).sum()) for n, each in ways.items()}
        alone = {n: _sizes([each[:1]], rest)[0] for n, each in left.items()}
        several = [n for n in left if _allowed(case.candidates[n], alone[n])]
        several = sorted(several, key=lambda n: -removed[n])
        if not several:
            break
        best = several[0]
        if not removed[best] > least * remains:
            break
        near = [n for n in several if removed[n] > _NEARLY * removed[best]]
        found.append({n: alone[n] for n in near})
        rest = rest - ways[best].T @ (ways[best] @ rest)
        remains -= removed[best]
        left = {n: e - (e @ ways[best].T) @ ways[best] for n, e in left.items() if n != best}
    return found


def spans(
    trials: Trials, case: Case[Any], base: Fit, scores: Mapping[str, Score]
) -> dict[str, Array]:
    """What candidates change of the residual beyond the base's free parameters, (k, N): the best variant, and
    a difference of each fitted parameter from it, such as viscous friction beside dry friction.
    """
    points, of = list[ParameterVector](), list[str]()
    tried = {n: each for n, each in scores.items() if not each.unstable and each.beyond.any()}
    for name, score in tried.items():
        point = base.point.having(name, score.tried)
        for k, allowed in enumerate(case.candidates[name].ranges.values()):
            if allowed.fitted:
                step = allowed.step or _DIFFERENCE * max(abs(score.tried[k]), allowed.typical)
                back = score.tried[k] + step > allowed.high
                values = score.tried + (-step if back else step) * (
                    np.arange(len(score.tried)) == k
                )
                points.append(point.having(name, values))
                of.append(name)
    some, known = case.take(trials.training, base.used), Information.of(case, base)
    without, *shown = case.residual([base.point, *points], some)
    found = {name: [score.beyond.astype(float)] for name, score in tried.items()}
    for name, each in zip(of, shown, strict=True):
        further = (each - without).ravel().astype(float) - scores[name].change
        if np.isfinite(further).all():
            found[name].append(known.beyond(further))
    return {name: np.array(several) for name, several in found.items()}


def _directions(changes: Array) -> Array:
    """An orthonormal basis of changes, (k, N), without what is hardly one of its own."""
    _, sizes, ways = np.linalg.svd(
        changes / np.maximum(np.linalg.norm(changes, axis=1, keepdims=True), 1e-30),
        full_matrices=False,
    )
    return np.asarray(ways[sizes > _OWN])


def _sizes(spans: Sequence[Array], residual: Array) -> list[float]:
    """Size of the first change of each span, where all together leave least of a residual."""
    columns, firsts = np.concatenate(spans), np.cumsum([0, *(len(each) for each in spans[:-1])])
    scale = np.maximum(np.linalg.norm(columns, axis=1), 1e-30)
    unit = columns / scale[:, None]
    found = -np.linalg.lstsq(unit @ unit.T, unit @ residual, rcond=_OWN**2)[0] / scale
    return [float(found[n]) for n in firsts]


def _allowed(candidate: Candidate, size: float) -> bool:
    """Whether a candidate's strengths may have a sign."""
    return size > 0 or all(
        each.low < 0 for each in candidate.ranges.values() if each.fitted and not each.form
    )


def standing(
    trials: Trials, case: Case[Any], joint: Fit, scores: Mapping[str, Score], stage: str
) -> Together:
    """The effects of a joint fit that each gain beside the others, and the fit of these; the weakest goes
    first. Where effects do not add up, a gain that is not decisive is judged again by a fit without the
    effect that has a derivative of its own.
    """
    known, judged = case.candidates, dict[str, CandidateTrial]()
    names = list(scores)
    while names:
        less = dict[str, Fit]()
        for name in names:
            for more in range(1 if case.adds_up else 2):
                less[name] = without(trials, case, joint, name, stage, more=more)
                before, found = trials.errors(case, less[name].point), scores[name]
                judged[name] = trials.judged(case, found, less[name], joint, before, len(scores))
                one = judged[name].gain
                if not one or weakness(one) or one.whole > DECISIVE_GAIN:
                    break  # whatever another derivative took up
        gains = {name: judged[name].gain for name in names}
        weak = {
            name: each.relative if each else 0.0
            for name, each in gains.items()
            if not each or weakness_of_fit(joint, each, {name: known[name]})
        }
        if not weak:
            break
        least = min(weak, key=lambda name: weak[name])
        trials.on_progress(f"{spaced(least)} is not worth it beside the others")
        joint = less[least]
        names.remove(least)
    return Together(joint, judged, tuple(names))


def one_by_one(trials: Trials, case: Case[Any], found: Fit, done: Round, stage: str) -> list[Round]:
    """A round for each effect of one that accepted several, as if it were accepted last, and nothing after
    it; the round itself, if it accepted one effect, or one pair.
    """
    if not done.together or len(done.accepted) == 1:
        return [done]
    later = [n for n in found.point.effects if n not in (*done.base.point.effects, *done.accepted)]
    out = []
    for name in done.accepted:
        if name not in found.point.effects:
            continue
        base = without(trials, case, found, name, stage, later)
        before = trials.errors(case, base.point)
        score = trials.scores(f"{stage}_{name}", case, base, [name])[name]
        alone = {name: replace(done.trials[name], score=score)}
        out.append(Round(base, before, alone, (name,)))
    return out


def as_accepted(trials: Trials, case: Case[Any], found: Fit, done: Round, stage: str) -> Fit | None:
    """The fit with what a round accepted and what was there before it, without what came after; None where
    it did not accept effects together, or nothing came.
    """
    there = (*done.base.point.effects, *done.accepted)
    later = [name for name in found.point.effects if name not in there]
    if not done.together or not later:
        return None
    case = replace(case, noise=found.noise)
    return without(trials, case, found, later[0], f"{stage}_plain", later[1:])


def without(
    trials: Trials,
    case: Case[Any],
    found: Fit,
    name: str,
    stage: str,
    others: Sequence[str] = (),
    more: int = 0,
) -> Fit:
    """The fit without one effect and some others, from the derivative of the fit with them, and so many
    `more`.
    """
    held, of = (
        found.without([name, *others]),
        f"{stage}_without_{name}_of_{len(found.free.effects)}",
    )
    return trials.further(case, held, f"{of}_{more}" if more else of, more)
