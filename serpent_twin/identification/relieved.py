"""Name the effect that a number of the model stands for, where calibration moved it beyond reason.

A payload at a tool makes what a heavier link makes: once the link's mass has taken it up, no log gains by the
payload. What tells them apart is how well parts are known as they are built.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.identification.absorbed import without_move
from serpent_twin.identification.acceptance import (
    EQUIVALENCE_MARGIN,
    CandidateTrial,
    Round,
    best_trial,
)
from serpent_twin.identification.fitting.far_steps import DECISIVE
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.objective import prior_squares
from serpent_twin.identification.held_out import gain
from serpent_twin.identification.rivals import along_one_line
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.trials import Trials
from serpent_twin.machines.case import Case

_ALIKE, _TRIED = 0.9, 3
"""Least cosine of what an effect and a number change of the residual, for one to stand for the other, and
most such effects
"""


def strained(case: Case[Any], base: Fit, scores: Sequence[Score]) -> tuple[str, list[str]]:
    """The number that a fit moved furthest, and the effects that it may stand for, by their scores on top of
    that fit; nothing where numbers are as they may be built.
    """
    squares = prior_squares(case, base.point)
    if squares.sum() <= DECISIVE:
        return "", []
    furthest = int(np.argmax(squares))
    ours = base.jacobian[base.free.declared.index(furthest)].ravel().astype(float)
    alike = {each.name: along_one_line(ours, each.change.astype(float)) for each in scores}
    best = sorted(alike, key=lambda name: -alike[name])[:_TRIED]
    return case.declared[furthest].name, [name for name in best if alike[name] > _ALIKE]


def relieved(
    trials: Trials, case: Case[Any], base: Fit, number: str, tried: Mapping[str, CandidateTrial]
) -> Round | None:
    """A round of those of some trials from the opening that explain the logs as well as a fit, with numbers
    nearer to what was built; judged against the fit in which one number did not move. None without any.
    """
    begun, _ = without_move(case, trials.training, base, number)
    before, after = (trials.errors(case, each.point) for each in (begun, base))
    out = {name: replace(each, gain=None) for name, each in tried.items()}
    for name, each in tried.items():
        fitted, errors = each.fit, each.errors
        if fitted is None or errors is None or gain(after, errors).relative <= -EQUIVALENCE_MARGIN:
            continue
        strains = float(prior_squares(case, fitted.point).sum()) > DECISIVE
        if relieves(case, base, fitted) and not strains:
            found = trials.judged(case, each.score, begun, fitted, before, len(tried))
            out[name] = replace(found, opened=True)
    best = best_trial(out, case.candidates)
    return Round(begun, before, out, (best,)) if best else None


def relieves(case: Case[Any], less: Fit, more: Fit) -> bool:
    """Whether numbers of the model are decisively nearer to what was built in a fit with more effects."""
    return (
        float((prior_squares(case, less.point) - prior_squares(case, more.point)).sum()) > DECISIVE
    )
