"""Compose candidates from what a twin leaves of the training logs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from serpent_twin.identification.discovery.candidates import (
    candidate_of,
    distinct,
    resembling_at_first,
)
from serpent_twin.identification.discovery.screen import Composed, screened
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.least_squares import OnProgress
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case

_TRIED = 8
"""Composed candidates that are simulated"""
WORTH = 30.0
"""What the best of some 300,000 laws must be worth where little is left: 2 ln 300,000 is chance. Where much
is left, held-out logs decide, which took no part in the search.
"""
_SHARE = 0.015
"""Of the residual's squares that it must remove: of an arm that lacks nothing, the best removes 0.009"""
_SENSOR = 0.0015, 25.0
"""The same of a law that shows in one sensor alone, and what it must be worth: of an arm that lacks nothing,
the best removes 0.002 and is worth 10
"""


def discover(
    case: Case[Any], training: Any, base: Fit, little: bool, on_progress: OnProgress
) -> Sequence[Candidate]:
    """The best composed candidates on top of a fit that leaves little or much; none where nothing is left, or
    nothing explains it.
    """
    some = case.take(training, base.used)
    places = case.places(base.point, some)
    if places is None:
        return ()
    on_progress("laws at all places")
    least = WORTH if little else 0.0
    found = [
        each
        for each in screened(case, some, base, places)
        if (each.worth > least and each.share > _SHARE) or _in_one_sensor(each)
    ]
    at = [(each.handle, each.place) for each in places.responses]

    def made(each: Composed) -> Candidate:
        several = [place for handle, place in at if handle == each.law.handle]
        return candidate_of(each, places.readings, case.units_of_law(each.law), several)

    new = [
        replace(made(each), alternatives=tuple(map(made, resembling_at_first(each, found))))
        for each in distinct(found, _TRIED)
    ]
    return [each for each in new if each.name not in base.point.effects]


def _in_one_sensor(found: Composed) -> bool:
    """Whether a law shows in one sensor alone, and is worth a trial."""
    share, worth = _SENSOR
    return found.alone and found.share > share and found.worth > worth
