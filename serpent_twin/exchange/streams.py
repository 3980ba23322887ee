"""Take the columns that a map names out of one stream of a recording."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.exchange import map_file
from serpent_twin.exchange.clocks import Lateness
from serpent_twin.exchange.commands import is_command
from serpent_twin.exchange.map_file import MappedField, MappedStream, si
from serpent_twin.exchange.messages import PUBLISHER, Mask, Messages, Recorded
from serpent_twin.exchange.stamps import in_seconds, sorted_times
from serpent_twin.numerals import counted
from serpent_twin.tables.imported import Conversion
from serpent_twin.units import TO_SI

_TO_AND_FRO = 0.05
"""Share of messages that return to where the one before the last was, from which two senders are suspected"""


@dataclass(frozen=True)
class ImportedStream:
    """One stream's columns, in SI units and its own rows."""

    name: str
    """Its topic, or that it is the table"""
    time: Array
    """(T,) [s]"""
    columns: Mapping[str, Array]
    """(T,) each, by name"""
    conversions: Mapping[str, Conversion]
    """How each column was made"""
    commands: Mapping[str, bool | None]
    """Whether each column is a command; None where nothing says so"""
    left: Sequence[str]
    """Fields that were not asked for"""
    unsorted: int
    """Messages that came before an earlier one, or at the same time"""
    time_unit: str
    """Unit that its time was read in"""
    notes: tuple[str, ...]
    """How it was read, and what is odd"""
    clock: Lateness | None = None
    """How its clock was set, if by motion"""

    @property
    def period(self) -> float:
        """Time between messages [s]."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else np.inf


def stream_of(each: MappedStream, recorded: Recorded, roles: Mapping[str, bool]) -> ImportedStream:
    """The columns of a stream; raises a `SerpentError` that says what it lacks."""
    everything = _topic(each, recorded)
    sources = [of.source for of in each.fields] + [n for of in each.points for n in of.fields]
    messages, notes = _of_one_sender(each, everything, sources)
    time, unit, note = _times(each, messages)
    values = [messages.field(path) for path in sources]
    kept, time, unsorted, spread = sorted_times(time, values, each.time or "the time of recording")
    made = {of.column: _conversion(of, messages) for of in each.fields}
    columns = {
        name: si(messages.field(of.field), of.unit, of.scale, of.offset)[kept]
        for name, of in made.items()
    }
    for of in each.points:
        place = np.stack([si(messages.field(name), of.unit)[kept] for name in of.fields], axis=1)
        moved = place @ np.array(of.axes) + np.array(of.origin)
        columns |= dict(zip(of.columns, moved.T, strict=True))
        sources_of = [""] * 3 if of.is_turned else of.fields
        made |= {n: Conversion(f, of.unit) for n, f in zip(of.columns, sources_of, strict=True)}
    notes += [note, spread, *(_doubt(name, values) for name, values in columns.items())]
    commands: dict[str, bool | None] = {n: False for of in each.points for n in of.columns}
    commands |= {of.column: is_command(each, of, roles) for of in each.fields}
    asked = {each.time, *sources}
    left = [name for name in messages.fields if name not in asked]
    said = tuple(filter(None, (*messages.notes, *notes)))
    return ImportedStream(
        each.topic or "the table", time, columns, made, commands, left, unsorted, unit, said
    )


def _topic(each: MappedStream, recorded: Recorded) -> Messages:
    if each.topic not in recorded:
        there = ", ".join(sorted(recorded)) or "none"
        missing = f"there is no topic {each.topic!r}" if each.topic else "topic is missing"
        tables = " A table has no topic: leave the key out." if [*recorded] == [""] else ""
        raise SerpentError(f"{missing}; there are: {there or 'a table'}.{tables} {map_file.ADVICE}")
    if not len(recorded[each.topic]):
        raise SerpentError(f"the topic {each.topic!r} has no messages. Leave the stream out.")
    return recorded[each.topic]


def _of_one_sender(
    each: MappedStream, messages: Messages, sources: Sequence[str]
) -> tuple[Messages, list[str]]:
    """The messages that have all fields that are asked for, of one sender, and a note on the others."""
    chosen = _chosen(each, messages)
    messages, others = messages.kept(chosen), int((~chosen).sum())
    for path in sources:
        messages.field(path)  # which lists what there is, if no message has it
    whole = messages.with_all([*sources, *([each.time] if each.time else [])])
    if not whole.any():
        raise SerpentError(
            f"no message has all of {', '.join(sources)}: they come in messages of their own. Write a "
            "[[stream]] of the topic for those of each."
        )
    found, others = messages.kept(whole), others + int((~whole).sum())
    _refuse_mixed(found)
    return found, [f"{counted(others, 'other message')} on the topic left out"] * bool(others)


def _chosen(each: MappedStream, messages: Messages) -> Mask:
    """The messages whose texts are those of `only`."""
    found = np.ones(len(messages), bool)
    for key, text in each.only.items():
        there = messages.texts.get(key)
        if there is None:
            raise SerpentError(f"only has {key!r}; give {' or '.join(messages.texts) or 'none'}.")
        found &= np.array([value == text for value in there], bool)
        if not found.any():
            several = ", ".join(map(repr, sorted({*there})))
            raise SerpentError(f"only: {key} is never {text!r}; it is {several}.")
    return found


def _refuse_mixed(messages: Messages) -> None:
    """Refuse messages of several senders, or of several frames."""
    for key, texts in messages.texts.items():
        count, changes = Counter(texts), sum(a != b for a, b in pairwise(texts))
        follows = key == PUBLISHER and changes < len(count)  # as of a node that was started again
        if len(count) > 1 and not follows:
            several = ", ".join(f"{text!r} in {counted(n, 'message')}" for text, n in count.items())
            raise SerpentError(
                f"several senders are mixed: {key} is {several}. Choose one of them: "
                f'only = {{ "{key}" = "{next(iter(count))}" }}.'
            )


def _conversion(of: MappedField, messages: Messages) -> Conversion:
    """How a field becomes a column, in the unit that the map states, else in that of the recording."""
    own = messages.units.get(of.source, "1")
    if own not in TO_SI or own == "1":
        return Conversion(of.source, of.unit, of.scale, of.offset)
    if of.unit not in ("1", own):
        raise SerpentError(
            f"{of.source!r} is in {own}, as the recording says, and the map says {of.unit!r}. State "
            f"unit = {own!r}, or none."
        )
    return Conversion(of.source, own, of.scale, of.offset)


def _doubt(name: str, values: Array) -> str:
    """A note where a column jumps to another course and back, again and again."""
    jump, over = np.abs(np.diff(values)), np.abs(values[2:] - values[:-2])
    least, usual = np.minimum(jump[1:], jump[:-1]), np.nanmedian(jump) if len(jump) else 0.0
    if not usual > 0:  # such as an encoder at rest, whose last count flickers
        return ""
    back = (over < 0.2 * least) & (least > 5 * usual)
    alternates = len(over) > 8 and np.nanmedian(over) < 0.2 * usual
    if not alternates and back.sum() <= _TO_AND_FRO * len(values):
        return ""
    return (
        f"{name} jumps to and fro from message to message, as where two nodes publish on one topic"
    )


def _times(each: MappedStream, messages: Messages) -> tuple[Array, str, str]:
    """The times of messages [s], the unit that they were read in, and a note on it."""
    if each.time:
        own = messages.units.get(each.time, "")
        unit = each.time_unit or (own if TO_SI.get(own, (1.0, ""))[1] == "s" else None)
        return in_seconds(messages.field(each.time), unit, each.time)
    if np.isnan(messages.recorded).any():
        raise SerpentError("a table needs time, the name of its column. Add it.")
    return messages.recorded, "s", ""
