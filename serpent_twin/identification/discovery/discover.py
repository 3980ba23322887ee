"""Compose candidates from what a twin leaves of the training logs."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from serpent_twin.effects.law import Law
from serpent_twin.identification.discovery.candidates import (
    candidate_of,
    distinct,
    resembling_at_first,
)
from serpent_twin.identification.discovery.composed import Composed
from serpent_twin.identification.discovery.followed import Way, swinging
from serpent_twin.identification.discovery.screen import Search, screened
from serpent_twin.identification.discovery.stuck import held_by_friction
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.least_squares import OnProgress
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.places import Places, response_at

_TRIED = 8
"""Composed candidates that are simulated"""
WORTH = 30.0
"""What the best of some 800,000 laws must be worth where little is left: 2 ln 800,000 is chance. Where much
is left, held-out logs decide, which took no part in the search.
"""
_SHARE = 0.015
"""A law must remove at least this share of the residual's squares: on an arm that lacks nothing, the best
law removes 0.009
"""
_SENSOR = 0.0015, 25.0
"""Least share, and least worth, of a law that shows in one sensor alone: on an arm that lacks nothing, the
best removes 0.002 and is worth 10
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
    made = partial(_candidate, case, places)
    new = {each.name: each for each in map(made, held_by_friction(case, some, base, places))}
    for each in distinct(found, _TRIED):
        alike = tuple(map(made, resembling_at_first(each, found)))
        new.setdefault((one := made(each)).name, replace(one, alternatives=alike))
    return [each for name, each in new.items() if name not in base.point.effects]


def in_each_shape(case: Case[Any], training: Any, base: Fit, law: Law) -> Sequence[Candidate]:
    """The candidates of what a law changes and follows, the best of each shape, on a fit without it; and the
    same at every other place where that removes nearly as much.
    """
    some = case.take(training, base.used)
    places = case.places(base.point, some)
    if places is None:
        return ()
    search = Search.of(case, some, base, places)
    at = response_at(places, law)
    follows = law.reading, law.where
    found = [each for each in search.at(at) if (each.law.reading, each.law.where) == follows]
    if not found:
        return ()
    own = {each.law.shape: each for each in _in_all_shapes(found)}
    same = [way for each in own.values() for way in _ways(each)]
    found = list(own.values())
    for r in places.responses:
        if r is not at and replace(law, handle=r.handle, place=r.place).possible:
            there = _in_all_shapes(search.among(r, same))
            found += [each for each in there if own[each.law.shape].is_like(each)]
    return [_candidate(case, places, each) for each in found]


def _in_all_shapes(found: Sequence[Composed]) -> list[Composed]:
    return [one for each in found for one in (each, *each.shapes.values())]


def _ways(found: Composed) -> list[Way]:
    """How a composed law follows its reading; if in waves, whatever their phase."""
    law = found.law
    if law.shape == "periodic":
        return swinging((law.reading, law.where), found.first)
    return [Way(law.shape, law.reading, law.where, found.first, found.second)]


def _candidate(case: Case[Any], places: Places, found: Composed) -> Candidate:
    several = [each.place for each in places.responses if each.handle == found.law.handle]
    return candidate_of(found, places.readings, case.units_of_law(found.law), several)


def _in_one_sensor(found: Composed) -> bool:
    """Whether a law shows in one sensor alone, and is worth a trial."""
    share, worth = _SENSOR
    return found.alone and found.share > share and found.worth > worth
