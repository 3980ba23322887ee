"""Write effects and their numbers as text for sentences and tables."""

from collections.abc import Mapping

from serpent_twin.effects import law_of, place_of
from serpent_twin.effects.law import HANDLES, SHAPES, parse
from serpent_twin.identification.estimates import ParameterEstimate

DISCOVERED = "discovered"
"""The name of an effect that was composed"""


def spaced(name: str) -> str:
    """An effect's name with spaces; of a composed one, its law and its place."""
    return with_numbers(name, {}) if law_of(name) == DISCOVERED else name.replace("_", " ")


def with_numbers(name: str, parameters: Mapping[str, ParameterEstimate]) -> str:
    """An effect with its numbers: a name and its parameters, or the sentence of a composed law."""
    if law_of(name) != DISCOVERED:
        told = ", ".join(f"{key} {each}" for key, each in parameters.items())
        return f"{spaced(name)} ({told})"
    law = parse(place_of(name))
    sizes = [str(each) for key, each in parameters.items() if key.startswith("size")]
    size = (
        "" if not sizes else f" of {sizes[0]}" if len(sizes) == 1 else f" of ({', '.join(sizes)})"
    )
    first, second = (
        str(parameters[key]) if key in parameters else key.replace("_", " ")
        for key in (*SHAPES[law.shape].parameters, "", "")[:2]
    )
    what = f"{HANDLES[law.handle].words} at {law.place}{size}"
    x = f"the {law.depends_on}" if law.reading else ""
    return f"{what}, {SHAPES[law.shape].words.format(x=x, first=first, second=second)}"
