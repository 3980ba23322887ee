"""Say in sentences what to doubt in the result of a trace."""

from typing import Any

from serpent_twin.identification.acceptance import Selection
from serpent_twin.identification.fitting.free_parameters import unstable
from serpent_twin.identification.fitting.uncertainty import indistinguishable
from serpent_twin.identification.score_test import at_bound
from serpent_twin.machines.case import Case as AnyCase

Case = AnyCase[Any]


def cautions(case: Case, selection: Selection) -> tuple[str, ...]:
    """What to doubt in a selection: of its last fit, of the logs, of what they do not determine."""
    told = list(selection.cautions)
    if not selection.final.converged:
        told.append("The last fit has not converged; its intervals are too narrow.")
    told += indistinguishable(case, selection.final)
    told += [f"{name}: {why}." for name, why in case.unseen.items()]
    told += case.notes
    for (name, k), within in selection.undetermined.items():
        parameter, allowed = list(case.candidates[name].ranges.items())[k]
        told.append(
            f"The logs do not determine {name}'s {parameter}, which is not worth it beside the others: it "
            f"may be as much as {within:.2g} {allowed.unit}."
        )
    for name, values in selection.final.point.effects.items():
        for parameter in at_bound(case.candidates[name], values):
            limit = case.candidates[name].ranges[parameter].limit
            told.append(
                f"{name}'s {parameter} lies at the end of its range: {limit or 'doubt it'}."
            )
    return tuple(told)


def unstable_fits(case: Case, selection: Selection, training: Any) -> list[str]:
    """What could not be computed because the simulation was unstable, in sentences."""
    final = selection.final
    some = case.take(training, final.used)
    held = unstable(case, final.point, final.free, some, final.jacobian)
    told = [
        f"The twin's simulation became unstable at every step of {', '.join(held)} that was tried: the fit "
        "held its value, which these logs therefore do not determine."
    ] * bool(held)
    last = selection.rounds[-1].trials if selection.rounds else {}
    told += [
        f"{name} was not tested: the simulation of a twin with it became unstable, also at smaller strengths."
        for name, trial in last.items()
        if trial.gain is None and trial.score.unstable
    ]
    return told
