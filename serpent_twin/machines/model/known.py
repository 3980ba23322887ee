"""Read the numbers of a model that are known in each session of a log, and refuse those that cannot be."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import Description, KnownNumber
from serpent_twin.machines.model.numbers import NUMBERS, names_of, numbers_of
from serpent_twin.machines.model.things import OBJECTS, names, unknown
from serpent_twin.machines.rig import NOTES, is_named
from serpent_twin.numerals import listed
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

STATED, VALUES = "stated", "known_values"
"""Keys in a session's metadata: what its log states, by name, and the value of each `[[known]]` number, None
where that is the model's
"""
Factor = tuple[str, int, float]
"""Kind of a number, of which thing, and how many times the model's it is, or how much is added to that"""


def amiss_known(about: Description, model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    """Numbers that the model lacks, that are zero there, or that are stated twice; the key, and why."""
    there = set[tuple[str, str, tuple[str, ...]]]()
    for n, each in enumerate(about.known):
        named = names(model, kind := OBJECTS[NUMBERS[each.number].of])
        if each.of not in named:
            yield f"known[{n}].of", unknown(each.of, model, kind)
        elif NUMBERS[each.number].added:
            if not model.body_weldid[model.site(each.of).bodyid[0]]:
                yield f"known[{n}].of", f"is {each.of!r}, which no joint moves: name another site."
        elif not numbers_of(model, each.number)[named.index(each.of)]:
            told = f"is {each.of!r}, whose {each.number} is 0 in the model: no factor changes it."
            yield f"known[{n}].of", told
        if bool(each.columns) == (each.value is not None):
            yield f"known[{n}]", "must have either columns or a value."
        if (which := (each.number, each.of, each.sessions)) in there:
            yield f"known[{n}].of", f"is {each.of!r}, whose {each.number} is known already."
        there.add(which)


def stated(machine: Described, session: Log, metadata: Mapping[str, Any]) -> dict[str, Any]:
    """The metadata of a session's `[[known]]` numbers; raises a `SerpentError` that says which is none, not
    constant, of the wrong sign, or stated twice.
    """
    found, parts = list[float | None](), dict[str, float]()
    there = set[tuple[str, str]]()
    for each in machine.about.known:
        if not any(is_named(session, pattern) for pattern in each.sessions):
            found.append(None)
            continue
        if (which := (each.number, each.of)) in there:
            raise SerpentError(
                f"{session.path}: two [[known]] tables state the {each.number} of {each.of} in the session "
                f"{session.name}. Name it under sessions of one of them alone."
            )
        there.add(which)
        own = {name: _stated(session, name, metadata) for name in each.columns}
        found.append(_value(machine, session, each, own))
        parts |= own
    return {STATED: parts, VALUES: tuple(found)}


def _value(
    machine: Described, session: Log, known: KnownNumber, parts: Mapping[str, float]
) -> float:
    """The value of a number in a session, by what its log states, which has the sign of the model's."""
    value = known.scale * float(np.prod([*parts.values()])) if known.value is None else known.value
    own, by = _model_value(machine, known), _change(machine, known, value)
    added = NUMBERS[known.number].added
    if not np.isfinite(by) or (by < 0 if added else by <= 0):
        told = " × ".join(f"{name} = {part:g}" for name, part in parts.items()) or "machine.toml"
        sign = "is no load" if added else f"has not the sign of the model's {own:g}"
        raise SerpentError(
            f"{session.path}: {told} makes the {known.number} of {known.of} {value:g}, which {sign}. State "
            f"its {'scale' if parts else 'value'} in machine.toml."
        )
    return value


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


def _model_value(machine: Described, known: KnownNumber) -> float:
    which = names_of(machine.model, known.number).index(known.of)
    return float(numbers_of(machine.model, known.number)[which])


def _change(machine: Described, known: KnownNumber, value: float) -> float:
    """How many times the model's number a value is, or how much more."""
    own = _model_value(machine, known)
    return value - own if NUMBERS[known.number].added else value / own


def with_known_noted(machine: Described, sessions: Sequence[Log]) -> list[Log]:
    """Sessions, the first of which has a sentence on each number that machine.toml states for some."""
    notes = tuple(
        f"machine.toml states {each.value:g} for the {each.number} of {each.of} in "
        + (listed(_that_state(sessions, n)) or f"no session: none is named {listed(each.sessions)}")
        + "."
        for n, each in enumerate(machine.about.known)
        if each.value is not None
    )
    if not (notes and sessions):
        return list(sessions)
    first, *others = sessions
    about = first.metadata | {NOTES: (*first.metadata.get(NOTES, ()), *notes)}
    return [replace(first, metadata=about), *others]


def _that_state(sessions: Sequence[Log], n: int) -> list[str]:
    """Names of the sessions in which a `[[known]]` number is not the model's."""
    return [each.name for each in sessions if each.metadata[VALUES][n] is not None]


def _factors(machine: Described, metadata: Mapping[str, Any]) -> tuple[Factor, ...]:
    """What a session states, as changes of the model; nothing for a motion that no log has."""
    return tuple(
        (
            each.number,
            names_of(machine.model, each.number).index(each.of),
            _change(machine, each, value),
        )
        for each, value in zip(machine.about.known, metadata.get(VALUES, ()), strict=False)
        if value is not None
    )


def by_known_numbers(machine: Described, pieces: Segments) -> dict[tuple[Factor, ...], list[int]]:
    """Segments whose sessions state the same numbers, by these."""
    groups: dict[tuple[Factor, ...], list[int]] = {}
    for n, metadata in enumerate(pieces.metadata):
        groups.setdefault(_factors(machine, metadata), []).append(n)
    return groups
