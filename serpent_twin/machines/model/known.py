"""Read the numbers of a model that each session of a log states, and refuse those that cannot be."""

from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import Description, KnownNumber
from serpent_twin.machines.model.numbers import NUMBERS, names_of, numbers_of
from serpent_twin.machines.model.things import OBJECTS, names, unknown
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

STATED = "stated"
"""Key in a session's metadata: the numbers that the session states, by name"""
Factor = tuple[str, int, float]
"""Kind of a number, of which thing, and how many times the model's it is"""


def amiss_known(about: Description, model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    """Numbers that the model lacks, that are zero there, or that are stated twice; the key, and why."""
    there = set[tuple[str, str]]()
    for n, each in enumerate(about.known):
        named = names(model, kind := OBJECTS[NUMBERS[each.number].of])
        if each.of not in named:
            yield f"known[{n}].of", unknown(each.of, model, kind)
        elif not numbers_of(model, each.number)[named.index(each.of)]:
            told = f"is {each.of!r}, whose {each.number} is 0 in the model: no factor changes it."
            yield f"known[{n}].of", told
        if (each.number, each.of) in there:
            yield f"known[{n}].of", f"is {each.of!r}, whose {each.number} is known already."
        there.add((each.number, each.of))


def stated(machine: Described, session: Log, metadata: Mapping[str, Any]) -> dict[str, float]:
    """The values in a session of what `[[known]]` names, by name; raises a `SerpentError` that says which is
    none, not constant, or of the wrong sign.
    """
    wanted = dict.fromkeys(name for each in machine.about.known for name in each.columns)
    found = {name: _stated(session, name, metadata) for name in wanted}
    for each in machine.about.known:
        ratio = _value(each, found) / _model_value(machine, each)
        if not (np.isfinite(ratio) and ratio > 0):
            told = " × ".join(f"{name} = {found[name]:g}" for name in each.columns)
            value, own = _value(each, found), _model_value(machine, each)
            raise SerpentError(
                f"{session.path}: {told} makes the {each.number} of {each.of} {value:g}, which has not the "
                f"sign of the model's {own:g}. State its scale in machine.toml."
            )
    return found


def _stated(session: Log, name: str, metadata: Mapping[str, Any]) -> float:
    path = session.path
    if name in session.columns:
        values = session.columns[name]
        if not np.isfinite(values).all() or np.ptp(values) > 0:
            raise SerpentError(
                f"{path}: the column {name!r} is not one number throughout a session, and a [[known]] number "
                "is. Split the log where it changes."
            )
        return float(values[0])
    value = metadata.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SerpentError(
            f"{path} states no number {name!r}, which machine.toml has under [[known]]: neither a column nor "
            f"an entry of the metadata, which are {stored.names(list(metadata), 40) or 'none'}."
        )
    return float(value)


def _value(known: KnownNumber, found: Mapping[str, float]) -> float:
    return known.scale * float(np.prod([found[name] for name in known.columns]))


def _model_value(machine: Described, known: KnownNumber) -> float:
    which = names_of(machine.model, known.number).index(known.of)
    return float(numbers_of(machine.model, known.number)[which])


def _factors(machine: Described, metadata: Mapping[str, Any]) -> tuple[Factor, ...]:
    """Ratios of the numbers that a session states to the model's; none for a motion that no log has."""
    if STATED not in metadata:
        return ()
    found = metadata[STATED]
    return tuple(
        (
            each.number,
            names_of(machine.model, each.number).index(each.of),
            _value(each, found) / _model_value(machine, each),
        )
        for each in machine.about.known
    )


def by_known_numbers(machine: Described, pieces: Segments) -> dict[tuple[Factor, ...], list[int]]:
    """Segments whose sessions state the same numbers, by these."""
    groups: dict[tuple[Factor, ...], list[int]] = {}
    for n, metadata in enumerate(pieces.metadata):
        groups.setdefault(_factors(machine, metadata), []).append(n)
    return groups
