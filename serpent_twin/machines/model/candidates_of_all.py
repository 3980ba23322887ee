"""List the effects that several like things of a model may have together, by one shared strength."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from serpent_twin.effects import KNOWN, Range, law_of, ranges
from serpent_twin.effects.strands import ALIKE, N_STRANDS
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.numbers import NUMBERS
from serpent_twin.machines.model.things import OBJECTS, names

_ALONG = ("base_tilt", "constant_force", "link_flex", "payload")
"""Effects that without a place are somewhere along bodies `link1`, `link2`, … on a body `base`"""


def of_all(machine: Described, found: Sequence[Candidate]) -> Iterator[Candidate]:
    """One candidate for all things that machine.toml says are alike, sized by those for each; what is late;
    and what acts along a chain of links.
    """
    alike = _alike(machine)
    laws: dict[str, list[Candidate]] = {}
    for each in found:
        if each.place_kind in ("joint", "tendon") and each.at in alike:
            laws.setdefault(law_of(each.name), []).append(each)
    for law, several in laws.items():
        if len(several) > 1 and len({_units(each) for each in several}) == 1:
            yield _shared(law, several, machine.model.ntendon)
    yield from _late(machine)
    yield from _along(machine)


def _alike(machine: Described) -> set[str]:
    """Joints and tendons that share an uncertain number with others."""
    found = set[str]()
    for each in machine.about.uncertain:
        known = names(machine.model, OBJECTS[NUMBERS[each.number].of])
        for pattern in each.of if NUMBERS[each.number].of in ("joint", "tendon") else ():
            matched = {name for name in known if fnmatchcase(name, pattern)}
            found |= matched if len(matched) > 1 else set()
    return found


def _shared(law: str, several: Sequence[Candidate], strands: int) -> Candidate:
    """A law at several places, from the values that are usual there, if all machines may have these."""
    known: dict[str, Range] = {}
    if "strand" in ranges(KNOWN[law]) and strands != N_STRANDS:
        known["strand"] = ALIKE
    for name, own in ranges(KNOWN[law]).items():
        each = [one.ranges[name] for one in several]
        usual = float(np.median([one.typical for one in each]))
        if each[0].fitted and own.low < usual < own.high and usual != own.typical:
            unit = each[0].unit if several[0].place_kind == "joint" else own.unit
            known[name] = replace(own, typical=usual, unit=unit)
    found, starts = candidate(law, **known), [one.variants for one in several]
    if len(starts[0]) > len(found.variants):
        found = replace(found, variants=tuple(np.median(starts, axis=0)))
    return found


def _units(one: Candidate) -> tuple[str, ...]:
    return tuple(each.unit for each in one.ranges.values())


def _late(machine: Described) -> Iterator[Candidate]:
    """Cameras that are late against joints that follow columns, and these against cameras."""
    if machine.winches and any(each.site for each in machine.about.measured):
        yield candidate("mocap_latency")
        yield candidate("motor_latency")


def _along(machine: Described) -> Iterator[Candidate]:
    """What acts along a chain of links, which the model's bodies are if machine.toml names such an effect."""
    return (candidate(name) for name in _ALONG if name in machine.about.candidates)
