"""Try what resembles a fitted law: first order ranks such laws less well than fits do."""

from collections.abc import Sequence
from dataclasses import replace

from serpent_twin.effects import place_of
from serpent_twin.effects.law import HANDLES, parse
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.wording import DISCOVERED
from serpent_twin.machines.candidate import Candidate

_BODY = "body"


def resembling(candidate: Candidate, found: Fit) -> Sequence[Sequence[Candidate]]:
    """The same change by other readings or in another shape; and of a law that acts on a body, the same law
    with its fitted numbers on every other one.
    """
    law = parse(place_of(candidate.name))
    place, values = candidate.composed["place"], found.point.effects[candidate.name]
    of_body = HANDLES[law.handle].kind == _BODY
    elsewhere = [
        replace(
            candidate,
            name=f"{DISCOVERED}@{replace(law, place=other)}",
            variants=(values,),
            composed={**candidate.composed, "place": {**place, "name": other}},
            places=tuple(each for each in (*candidate.places, law.place) if each != other),
            alternatives=(),
        )
        for other in (candidate.places if of_body else ())
    ]
    return candidate.alternatives, elsewhere
