"""Try what resembles a fitted law: first order ranks such laws less well than fits do."""

from collections.abc import Iterable
from dataclasses import replace

from serpent_twin.arrays import Array
from serpent_twin.effects import law_of, place_of
from serpent_twin.effects.discovered import DISCOVERED
from serpent_twin.effects.law import HANDLES, Law, parse
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.machines.candidate import Candidate

_BODY = "body"
_TURNED = {"above": "under", "under": "above"}


def composed_law(name: str) -> Law | None:
    """The law of a composed effect, by its name; None of other effects."""
    return parse(place_of(name)) if law_of(name) == DISCOVERED else None


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
    """A law that acts on a body, with its fitted numbers, on every other body."""
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


def turned(candidate: Candidate, values: Array) -> Candidate | None:
    """The complement of a step: the law that holds where the step does not, with opposite sizes; None for
    other effects.
    """
    law = composed_law(candidate.name)
    if not law or law.shape not in _TURNED:
        return None
    start, shape = values.copy(), _TURNED[law.shape]
    start[: HANDLES[law.handle].components] *= -1
    return replace(
        candidate,
        name=f"{DISCOVERED}@{replace(law, shape=shape)}",
        variants=(start,),
        composed={**candidate.composed, "law": shape},
        alike={},
        alternatives=(),
    )
