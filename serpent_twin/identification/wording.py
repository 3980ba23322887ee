"""Write effects and their numbers as text for sentences and tables."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Range, law_of, place_of
from serpent_twin.effects.discovered import DISCOVERED
from serpent_twin.effects.law import HANDLES, SPRING, Law, parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.estimates import ParameterEstimate, length_of
from serpent_twin.numerals import listed


def spaced(name: str) -> str:
    """An effect's name with spaces; of a composed one, its law and its place."""
    return with_numbers(name, {}) if law_of(name) == DISCOVERED else name.replace("_", " ")


def placed(name: str) -> str:
    """An effect's name and its place in words."""
    return spaced(name).replace("@", " at ")


def full_name(effect: Mapping[str, Any]) -> str:
    """The name that holds the place or law of an effect of diagnosis.json, as some names do already."""
    if "place" not in effect or place_of(effect["name"]):
        return str(effect["name"])
    place = effect["place"]["name"]
    if "changes" in effect:
        reading, _, where = " ".join(effect["depends_on"]).partition(" of ")
        law = effect["law"], reading.replace(" ", "_"), where or "session"
        place = str(Law(effect["changes"], place, *law))
    return f"{effect['name']}@{place}"


def with_numbers(name: str, parameters: Mapping[str, ParameterEstimate]) -> str:
    """An effect with its numbers: a name and its parameters, or the sentence of a composed law."""
    if law_of(name) != DISCOVERED:
        told = ", ".join(f"{key} {each}" for key, each in parameters.items())
        return f"{spaced(name)} ({told})"
    law = parse(place_of(name))
    shape = SHAPES[law.shape]
    handle = HANDLES[law.handle]
    x = f"the {law.depends_on}" if law.reading else ""
    if not parameters:
        return f"{handle.told(law.place)}, {(shape.plain or shape.words).format(x=x)}"
    first, second = ([*map(parameters.get, shape.parameters)] + [None, None])[:2]
    if first and law.shape == "periodic":
        first = _swings(first)
    sizes = [each for key, each in parameters.items() if key.startswith("size")]
    what = handle.told(law.place, _size(sizes))
    if law.handle == SPRING:
        what = _spring(law.place, sizes, parameters["stiffness"])
    return f"{what}, {shape.words.format(x=x, first=first, second=second)}"


def _spring(place: str, forces: Sequence[ParameterEstimate], stiffness: ParameterEstimate) -> str:
    """A spring with the point to which it pulls, and half the 95 % intervals of that point's coordinates."""
    k, off = max(stiffness.value, 1e-30), (stiffness.high - stiffness.low) / 2
    point = ", ".join(
        f"{f.value / k:.3f} ± {np.hypot((f.high - f.low) / 2, f.value / k * off) / k:.3f}"
        for f in forces
    ).replace("-", "−")
    return f"a spring of {stiffness} that pulls {place} to ({point}) m in the base frame"


def _size(sizes: Sequence[ParameterEstimate]) -> str:
    """A size; of a vector, its length and its direction."""
    if len(sizes) == 1:
        return str(sizes[0])
    whole = length_of(sizes)
    along = (each.value / max(whole.value, 1e-30) for each in sizes)
    direction = ", ".join(f"{each:.2f}" for each in along).replace("-", "−")
    return f"{whole} along ({direction})"


def _swings(rate: ParameterEstimate) -> str:
    """The rate of a sine: of time as a frequency, of an angle as waves in a turn."""
    if rate.unit != "rad per s":
        return f"{replace(rate, unit='1')} waves in a turn"
    value, low, high = (each / (2 * np.pi) for each in (rate.value, rate.low, rate.high))
    return str(ParameterEstimate(value, low, high, "Hz"))


def tried_with(ranges: Mapping[str, Range], values: Array, strong: Sequence[int]) -> str:
    """The fitted parameters of an effect that are not its strength, such as `grip of 3 N`."""
    out = []
    for k, (name, allowed) in enumerate(ranges.items()):
        if allowed.fitted and k not in strong:
            unit = "" if allowed.unit == "1" else f" {allowed.unit}"
            out.append(f"{spaced(name)} of {values[k]:.2g}{unit}".replace("-", "−"))
    return listed(out)
