"""Fit pairs of candidates that help only together, and judge them on held-out logs."""

from collections.abc import Mapping
from typing import Any

from serpent_twin.identification.acceptance import NEGLECTED, PairTrial, weakness_of_fit
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.held_out import Errors, gave_up
from serpent_twin.identification.rivals import pairs
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.trials import Trials
from serpent_twin.machines.case import Case


def pair_fits(
    trials: Trials,
    case: Case[Any],
    base: Fit,
    before: Errors,
    scores: Mapping[str, Score],
    number: int,
) -> tuple[PairTrial, ...]:
    """Full fits of the pairs that help only together, to first order."""
    known, out = case.candidates, []
    chosen = pairs(list(scores.values()), base.residual, known)
    for pair in chosen:
        names = " and ".join(pair.names)
        trials.on_progress(f"{number}, pairs: fitting {names}")
        point = base.point
        for name, size in zip(pair.names, pair.size, strict=True):
            point = point.having(name, scores[name].sized(known[name], size))
        free = free_parameters(case, [*base.point.effects, *pair.names])
        fitted = trials.stable(
            f"fit_{number}_pair_{'_'.join(pair.names)}",
            lambda p=point, f=free: fit(
                case, trials.training, p, f, 2, 1, trials.on_progress, known=base
            ),
        )
        if fitted is None or gave_up(before, trials.errors(case, fitted.point)):
            continue
        among = len(chosen) + len(known)
        trial = trials.judged(case, scores[pair.names[0]], base, fitted, before, among)
        assert trial.gain
        both = {name: known[name] for name in pair.names}
        weak = weakness_of_fit(fitted, trial.gain, both)
        why = NEGLECTED if trial.within_neglect else weak
        out.append(PairTrial(pair, trial, why))
    return tuple(out)
