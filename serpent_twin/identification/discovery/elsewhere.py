"""Try a fitted law on other bodies: which one it acts on, first order says less well than a fit."""

from collections.abc import Sequence
from dataclasses import replace

from serpent_twin.effects import place_of
from serpent_twin.effects.law import HANDLES, parse
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.wording import DISCOVERED
from serpent_twin.machines.candidate import Candidate

_BODY = "body"


def elsewhere(candidate: Candidate, found: Fit) -> Sequence[Candidate]:
    """The same law with its fitted numbers on every other body; none where it acts on no body."""
    law = parse(place_of(candidate.name))
    if HANDLES[law.handle].kind != _BODY:
        return ()
    place, values = candidate.composed["place"], found.point.effects[candidate.name]
    return [
        replace(
            candidate,
            name=f"{DISCOVERED}@{replace(law, place=other)}",
            variants=(values,),
            composed={**candidate.composed, "place": {**place, "name": other}},
            places=tuple(each for each in (*candidate.places, law.place) if each != other),
        )
        for other in candidate.places
    ]
