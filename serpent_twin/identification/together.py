"""Choose effects together where what they change adds up, as torques by inverse dynamics do.

Nothing is simulated between rows, so that a score test knows what each effect changes whatever the others
are: orthogonal matching pursuit chooses them, one fit of all says how strong they are, and each must show,
on logs not used, that the others do not do without it.
Source: Pati, Rezaiifar and Krishnaprasad, Orthogonal matching pursuit, 27th Asilomar Conference, 1993;
backward elimination as in Draper and Smith, Applied Regression Analysis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.acceptance import CandidateTrial, Round, weakness_of_fit
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
from serpent_twin.numerals import counted

_DERIVATIVES = 2


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
    sizes = chosen(case, base, found)
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
    return Round(base, before, out | several.trials, several.names)


def chosen(case: Case[Any], base: Fit, scores: Mapping[str, Score]) -> dict[str, float]:
    """Candidates that remove a share of what the ones before them leave, to first order, best first, with the
    sizes of their variants together. A typical strength need not show: sizes follow from what is left.
    """
    known, flat = Information.of(case, base), base.residual.ravel().astype(float)
    left = {n: s.beyond.astype(float) for n, s in scores.items() if not s.unstable}
    rest, remains = known.beyond(flat), known.left(flat)
    sizes: dict[str, float] = {}
    while left:
        along = {n: float(each @ each) for n, each in left.items()}
        removed = {n: float(left[n] @ rest) ** 2 / max(along[n], 1e-30) for n in left}
        best = max(removed, key=lambda n: removed[n])
        if not removed[best] > WORTH_A_FIT * remains:
            break
        now = _sizes([scores[n].beyond for n in (*sizes, best)], known.beyond(flat))
        if _allowed(case.candidates[best], now[-1]):
            sizes = dict(zip((*sizes, best), now.tolist(), strict=True))
            unit = left[best] / np.sqrt(along[best])
            rest = rest - (unit @ rest) * unit
            remains -= removed[best]
            left = {n: each - (unit @ each) * unit for n, each in left.items()}
        del left[best]
    return {n: size for n, size in sizes.items() if _allowed(case.candidates[n], size)}


def _sizes(changes: Sequence[Array], residual: Array) -> Array:
    """Sizes of changes together that leave least of a residual."""
    columns = np.array(changes, float)
    return -np.linalg.lstsq(columns @ columns.T, columns @ residual)[0]


def _allowed(candidate: Candidate, size: float) -> bool:
    """Whether a candidate's strengths may have a sign."""
    return size > 0 or all(
        each.low < 0 for each in candidate.ranges.values() if each.fitted and not each.form
    )


def standing(
    trials: Trials, case: Case[Any], joint: Fit, scores: Mapping[str, Score], stage: str
) -> Together:
    """The effects of a joint fit that each gain beside the others, and the fit of these; the weakest goes
    first.
    """
    known, judged = case.candidates, dict[str, CandidateTrial]()
    names = list(scores)
    while names:
        less = {name: without(trials, case, joint, name, stage) for name in names}
        for name, each in less.items():
            before = trials.errors(case, each.point)
            judged[name] = trials.judged(case, scores[name], each, joint, before, len(scores))
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


def without(trials: Trials, case: Case[Any], found: Fit, name: str, stage: str) -> Fit:
    """The fit without one effect, from the derivative of the fit with it."""
    held = found.without([name])
    return trials.notes.fit(
        f"{stage}_without_{name}_of_{len(found.free.effects)}",
        lambda: fit(
            case,
            trials.training,
            held.point,
            held.free,
            0,
            len(found.used),
            trials.on_progress,
            carried=held,
        ),
    )
