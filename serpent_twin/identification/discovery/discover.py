"""Compose candidates from what a twin leaves of the training logs."""

from collections.abc import Sequence
from typing import Any

from serpent_twin.identification.discovery.candidates import candidate_of, distinct
from serpent_twin.identification.discovery.screen import Composed, screened
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.least_squares import OnProgress
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import Candidate

_TRIED = 8
"""Composed candidates that are simulated"""
_WORTH = 30.0
"""Squared standard errors that the best of some 300,000 laws must be worth: 2 ln 300,000 is chance"""
_SHARE = 0.015
"""Of the residual's squares that it must remove: of an arm that lacks nothing, the best removes 0.005"""


def discover(
    case: Case[Any], training: Any, base: Fit, on_progress: OnProgress
) -> Sequence[Candidate]:
    """The best composed candidates on top of a fit; none where nothing is left, or nothing explains it."""
    some = case.take(training, base.used)
    places = case.places(base.point, some)
    if places is None:
        return ()
    on_progress("laws at all places")
    found = [each for each in screened(case, some, base, places) if _worth_it(each)]
    new = [
        candidate_of(each, places.readings, case.units_of_law(each.law))
        for each in distinct(found, _TRIED)
    ]
    return [each for each in new if each.name not in base.point.effects]


def _worth_it(found: Composed) -> bool:
    return found.worth > _WORTH and found.share > _SHARE
