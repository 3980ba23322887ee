"""Name the effect that a number of the model stands for, where calibration moved it beyond reason.

A payload at a tool makes what a heavier link makes: once the link's mass has taken it up, no log gains by the
payload. What tells them apart is how well parts are known as they are built.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.identification.absorbed import without_move
from serpent_twin.identification.acceptance import HARDLY, CandidateTrial, Round, best_trial
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.held_out import gain
from serpent_twin.identification.least_squares import derives_cheaply
from serpent_twin.identification.score_test import full_fit, worth_fitting
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_DECISIVE = 6.0
"""Least decrease of the priors' squares, as twice the logarithm of a Bayes factor: strong evidence (Kass and
Raftery, JASA 90, 1995); of one number, two and a half widths
"""


def relieved(
    trials: Trials, case: Case[Any], names: Sequence[str], base: Fit, stage: str
) -> Round | None:
    """A round of candidates that explain the logs as well as a fit, each in place of the number that the fit
    moved furthest; None where it moved none beyond reason, or no candidate does.
    """
    squares = _squares(case, base.point)
    furthest = int(np.argmax(squares)) if len(squares) else 0
    if not derives_cheaply(case) or squares.max(initial=0.0) < _DECISIVE:
        return None
    coordinate = case.declared[furthest].name
    begun, blind = without_move(case, trials.training, base, coordinate)
    trials.on_progress(f"effects in place of {coordinate}")
    scored = trials.scores(stage, case, blind, names)
    before, after = (trials.errors(case, each.point) for each in (begun, base))
    out = {name: CandidateTrial(s, None, None, before.marker) for name, s in scored.items()}
    for name in worth_fitting(list(scored.values()), case.candidates):
        trials.on_progress(f"in place of {coordinate}: fitting {spaced(name)}")
        fitted = trials.stable(
            f"fit_{stage}_{name}",
            lambda one=scored[name]: full_fit(
                case, trials.training, begun, one, trials.on_progress, afresh=True
            ),
        )
        if fitted is None or not relieves(case, base, fitted):
            continue
        found = trials.judged(case, scored[name], begun, fitted, before, len(scored))
        if found.errors and gain(after, found.errors).relative > -HARDLY:
            out[name] = replace(found, opened=True)
    best = best_trial(out, case.candidates)
    return Round(begun, before, out, (best,)) if best else None


def relieves(case: Case[Any], less: Fit, more: Fit) -> bool:
    """Whether numbers of the model are decisively nearer to what was built in a fit with more effects."""
    return float((_squares(case, less.point) - _squares(case, more.point)).sum()) > _DECISIVE


def _squares(case: Case[Any], point: ParameterVector) -> np.ndarray:
    """Squares of how far each number is off, in widths of its prior, (P,)."""
    return (point.declared / np.array([each.prior for each in case.declared])) ** 2
