"""Try what resembles a fitted law: first order ranks such laws less well than fits do."""

from collections.abc import Iterable
from dataclasses import replace

from serpent_twin.effects import place_of
from serpent_twin.effects.law import HANDLES, parse
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.wording import DISCOVERED
from serpent_twin.machines.candidate import Candidate

_BODY = "body"


def of_shape(name: str, several: Iterable[Candidate]) -> list[Candidate]:
    """The other shapes and readings of some candidates that are those of a law's name."""
    law = parse(place_of(name))
    found = []
    for candidate in several:
        for each in candidate.alternatives:
            other = parse(place_of(each.name))
            if (other.shape, other.depends_on) == (law.shape, law.depends_on):
                found.append(each)
    return found


def elsewhere(candidate: Candidate, found: Fit) -> list[Candidate]:
    """Of a law that acts on a body, the same law with its fitted numbers on every other one."""
    law = parse(place_of(candidate.name))
    if HANDLES[law.handle].kind != _BODY:
        return []
    place, values = candidate.composed["place"], found.point.effects[candidate.name]
    return [
        replace(
            candidate,
            name=f"{DISCOVERED}@{replace(law, place=other)}",
            variants=(values,),
            composed={**candidate.composed, "place": {**place, "name": other}},
            places=tuple(each for each in (*candidate.places, law.place) if each != other),
            alternatives=(),
        )
        for other in candidate.places
    ]
