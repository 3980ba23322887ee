"""Make candidates of composed laws, with sensible ranges and without those that look alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Range, law_of, place_of
from serpent_twin.effects.discovered import DISCOVERED
from serpent_twin.effects.law import HANDLES, parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.composed import Composed
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case

_WIDE = 30.0
"""Range of a size, in what the screening found"""
_SHARE = 0.2
"""Finite differences of a size, or of a play, to itself"""
_STEPS = 60.0
"""Finite differences of a threshold to the range of its reading"""
_RATES = 30
"""Finite differences of a rate to either end of its range: more than a period in the logs"""
_LEAST_PLAY = 1e-4
"""Width of a play to the range of the angle that takes it up, at least"""
_SLOWER = 8.0
"""Range of a time constant to what the screening found"""
_OTHER_SHAPE = 0.75
"""Another shape of a law is tried, too, if it is worth at least this fraction of what the law is worth"""
_NEARLY = 0.95
"""A constant replaces a law that follows a reading if it removes at least this fraction of what the law
removes
"""
_SIZES = ("size", "size_y", "size_z", "stiffness")
_ALONG = ("size_x", "size_y", "size_z", "stiffness")
FORM = len(_SIZES)
"""Where the numbers of a law's form begin among its parameters, after its sizes"""


@dataclass(frozen=True)
class _Reading:
    """Ends of a reading in the logs."""

    least: float
    most: float

    @property
    def wide(self) -> float:
        return self.most - self.least


def candidate_of(
    found: Composed,
    readings: Mapping[tuple[str, str], Array],
    units: Mapping[str, str],
    places: Sequence[str] = (),
) -> Candidate:
    """The candidate of a composed law, with the units of its numbers and other places where it could be."""
    law = found.law
    x = readings[law.reading, law.where] if law.reading else np.zeros(1)
    ends = _Reading(float(x.min()), float(x.max()))
    ranges = _sizes(found, units) | _forms(found, ends, units)
    values = [ranges[name].typical for name in ranges]
    values[: len(found.size)] = list(map(float, found.size))
    return Candidate(
        f"{DISCOVERED}@{law}",
        ranges,
        (np.array(values),),
        "A law at a place that no other effect describes.",
        "what no named effect explains",
        place_kind=HANDLES[law.handle].kind,
        whole=True,
        composed={
            "name": DISCOVERED,
            "place": {"kind": HANDLES[law.handle].kind, "name": law.place},
            "changes": law.handle,
            "law": law.shape,
            "depends_on": [law.depends_on] if law.reading else [],
        },
        alike=found.alike,
        flat=found.flat,
        places=tuple(place for place in places if place != law.place),
    )


def with_laws(case: Case[Any], effects: Mapping[str, Array]) -> Case[Any]:
    """A case with the composed laws among effects that were fitted to it before, by name, as candidates."""
    several = [_remade(case, n, v) for n, v in effects.items() if law_of(n) == DISCOVERED]
    return case.composing(several)


def always(case: Case[Any], name: str, values: Array) -> Candidate:
    """The candidate of a fitted law's sizes at all times, from its parameters, (8,)."""
    law = replace(parse(place_of(name)), shape="constant", reading="", where="")
    constant = np.where(np.arange(len(values)) < FORM, values, 0.0)
    return _remade(case, f"{DISCOVERED}@{law}", constant)


def _remade(case: Case[Any], name: str, values: Array) -> Candidate:
    """The candidate of a law that was fitted to a case before, from its parameters, (8,)."""
    law = parse(place_of(name))
    size, (first, second, least, most) = values[: HANDLES[law.handle].components], values[FORM:]
    ends = (least, most) if most > least else (min(0.0, first), abs(first) + abs(second) + 1.0)
    fitted = Composed(law, size, float(first), float(second), 0.0, 0.0)
    readings = {(law.reading, law.where): np.array(ends)}
    return candidate_of(fitted, readings, case.units_of_law(law))


def _sizes(found: Composed, units: Mapping[str, str]) -> dict[str, Range]:
    """Ranges of a law's sizes: all components of a vector have the range of its length, and a spring's
    stiffness has its own.
    """
    handle, components = HANDLES[found.law.handle], len(found.size)
    out = {}
    for n, name in enumerate(_ALONG if components > 1 else _SIZES):
        if n >= components:
            out[name] = Range(units["size"], 0.0, 0.0, 0.0, fitted=False)
            continue
        of_spring = n == _SIZES.index("stiffness")
        typical = float(np.linalg.norm(found.size[n:] if of_spring else found.size[:3])) or 1.0
        low = 0.0 if handle.only_more and n == components - 1 else -_WIDE * typical
        unit, step = f"{units['size']}/m" if of_spring else units["size"], _SHARE * typical
        out[name] = Range(unit, low, _WIDE * typical, typical, step=step, strength=True)
    return out


def _forms(found: Composed, ends: _Reading, units: Mapping[str, str]) -> dict[str, Range]:
    """Ranges of the law's form: thresholds within the readings, widths up to theirs, phases all round."""
    law = found.law
    names = SHAPES[law.shape].parameters
    out: dict[str, Range] = {}
    for key, value, name in zip(
        ("first", "second"), (found.first, found.second), (*names, "", "")[:2], strict=True
    ):
        low, high, step = _room(name, value, ends)
        out[name or key] = Range(
            units[key], low, high, value, fitted=bool(name), step=step, form=True
        )
    unbounded = law.shape == "periodic" or SHAPES[law.shape].drags
    bounded = law.reading not in ("", "time", "runtime") and not unbounded
    for key, value in (("least_reading", ends.least), ("most_reading", ends.most)):
        end = value if bounded else 0.0
        out[key] = Range(units["bound"], end, end, end, fitted=False, form=True)
    return out


def _room(name: str, value: float, ends: _Reading) -> tuple[float, float, float]:
    """Lowest and highest value of a parameter, and its finite difference."""
    if name == "phase":
        return value - np.pi, value + np.pi, 0.05
    if name == "rate":
        step = 0.3 / max(ends.wide, 1e-9)
        return max(step, value - _RATES * step), value + _RATES * step, step
    if name == "gap":
        return ends.wide * _LEAST_PLAY, ends.wide / 2, value * _SHARE
    if name == "time_constant":
        return value / _SLOWER, value * _SLOWER, value * _SHARE
    if name == "width":
        return ends.wide / _STEPS, ends.wide, ends.wide / _STEPS
    if name:
        return ends.least, ends.most, ends.wide / _STEPS
    return value, value, 0.0


def _simplest(found: Sequence[Composed]) -> list[Composed]:
    """Drop laws that follow a reading where a constant in their place removes nearly as much: the
    difference may be an error of the first order.
    """
    constant = {(one.law.handle, one.law.place): one.gain for one in found if not one.law.reading}
    return [
        each
        for each in found
        if not each.law.reading
        or each.gain * _NEARLY > constant.get((each.law.handle, each.law.place), 0.0)
    ]


def distinct(found: Sequence[Composed], most: int) -> list[Composed]:
    """The best few, each of another quantity at another place: half of them, if there are so many, changes of
    what has the reading that they follow. What declared parameters could do is theirs to be fitted.
    """
    best: dict[tuple[str, str], Composed] = {}
    own: dict[tuple[str, str], Composed] = {}
    for each in _simplest(found):
        if each.declared:
            continue
        for several in (best, own) if each.law.of_itself else (best,):
            several.setdefault((each.law.handle, each.law.place), each)
    chosen = list(own.values())[: most // 2]
    rest = [each for each in best.values() if each.law not in {one.law for one in chosen}]
    return sorted([*chosen, *rest[: most - len(chosen)]], key=lambda each: -each.worth)


def resembling_at_first(one: Composed, found: Sequence[Composed]) -> list[Composed]:
    """Laws with the same change that first order cannot distinguish from one: by another reading of the
    same part, and the best of another shape if that removes nearly as much. For a law that holds until an
    instant, also the law from then on: a calibration without it may have taken the later state for what was
    built.
    """
    if not one.law.follows_a_thing:
        return [one.shapes["above"]] if one.law.shape == "under" and "above" in one.shapes else []
    readings = [
        each
        for each in found
        if each.law.follows_a_thing
        and (each.law.handle, each.law.place) == (one.law.handle, one.law.place)
        and (each.law.reading, each.law.where) != (one.law.reading, one.law.where)
        and one.is_like(each)
    ]
    others = [
        each for shape, each in one.shapes.items() if shape not in one.alike
    ]  # tested after fits
    shapes = sorted(others, key=lambda each: -each.worth)
    return readings + [each for each in shapes[:1] if each.worth > _OTHER_SHAPE * one.worth]
