"""Say what a map.toml holds: which fields of which streams become which columns."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta, field

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.stored import Form, many, within
from serpent_twin.units import TO_SI

ADVICE = "docs/reference/map-toml.md lists the keys."
if TYPE_CHECKING:
    Unit = TimeUnit = str
else:
    Unit = Literal[tuple(TO_SI)]
    TimeUnit = Literal[tuple(name for name, (_, si_unit) in TO_SI.items() if si_unit == "s")]
Name = Annotated[str, Meta(min_length=1)]
Number = Annotated[float, within(-1e9, 1e9)]
Three = Annotated[tuple[Number, ...], many(3)]


class MappedField(Form, frozen=True, rename={"source": "field"}):
    """A field of a stream that becomes a column."""

    source: Name
    """Column of a table, or part of a message, such as position[elbow], position[2] or pose.position.x"""
    column: Name
    """Name of the column in the log"""
    unit: Unit = "1"
    """Unit of the numbers in the field"""
    scale: Number = 1.0
    """SI value = offset + scale × value in the unit"""
    offset: Number = 0.0
    """SI value where the field is 0"""
    hold: bool | None = None
    """Whether the field is a command, in force until the next one; by default as the stream says"""


class MappedPoint(Form, frozen=True):
    """Three fields of a stream that are a place, and the frame that they are wanted in."""

    fields: Annotated[tuple[Name, ...], many(3)]
    """Fields with x, y and z"""
    columns: Annotated[tuple[Name, ...], many(3)]
    """Names of the three columns in the log"""
    unit: Unit = "m"
    """Unit of the fields"""
    axes: Annotated[tuple[Three, ...], many(3)] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    """Axes x, y and z of the stream's frame, each as a vector in the frame wanted"""
    origin: Three = (0.0, 0.0, 0.0)
    """Origin of the stream's frame in the frame wanted [m]"""

    def __post_init__(self) -> None:
        turn = np.array(self.axes)
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3):
            raise SerpentError("axes are not three of length 1 at right angles.")

    @property
    def is_turned(self) -> bool:
        """Whether the frame that is wanted is another one than the stream's."""
        return any(self.origin) or not np.array_equal(self.axes, np.eye(3))


class Follows(Form, frozen=True):
    """How the clock of a stream is set by motion: two columns that move alike."""

    own: Name
    """Column of this stream"""
    like: Name
    """Column of another stream, whose clock is right, that shows the same motion"""
    most: Annotated[float, within(0.0, 60.0, "s")] = 2.0
    """Largest difference of the clocks that is tried"""


class MappedStream(Form, frozen=True):
    """One topic, or a table."""

    topic: str = ""
    """Topic of the messages; a table has none"""
    time: str = ""
    """Field with the time, such as header.stamp; by default when a message was recorded; a table needs it"""
    time_unit: TimeUnit | None = None
    """Unit of a time that is a number; by default seconds, or the one unit that stamps since 1970 can have"""
    hold: bool | None = None
    """Whether the fields are commands; by default the drives of machine.toml are, else those named so"""
    only: dict[str, str] = field(default_factory=dict)
    """Sender whose messages are taken, of several on one topic, by header.frame_id, child_frame_id or
    publisher: { "header.frame_id" = "arm" }
    """
    late: Annotated[float, within(-1e6, 1e6, "s")] = 0.0
    """Time by which this stream's stamps are later than those of the other streams"""
    follows: Follows | None = None
    """Two columns from whose motion `late` is found"""
    fields: tuple[MappedField, ...] = ()
    """Fields that become columns"""
    points: tuple[MappedPoint, ...] = ()
    """Places that become three columns each"""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in the log."""
        return (
            *(each.column for each in self.fields),
            *(name for each in self.points for name in each.columns),
        )


class Map(Form, frozen=True):
    """What a map.toml holds."""

    schema_version: Literal[1]
    """Version of this form"""
    stream: Annotated[tuple[MappedStream, ...], many(1, 1000)]
    """Topics of the recording, or tables"""
    rate_hz: Annotated[float, within(0.0, 1e5, "Hz")] = 0.0
    """Rows per second of the log; 0: the rows of the first stream"""
    gap: Annotated[float, within(1e-6, 1e6, "s")] = field(default=0.2)
    """Longest time between two messages that a straight line bridges; in longer ones nothing is known"""

    def __post_init__(self) -> None:
        names = [name for stream in self.stream for name in stream.columns]
        if twice := sorted({name for name in names if names.count(name) > 1 or name == "time"}):
            raise SerpentError(f"stream: the column {twice[0]!r} is there twice.")
        for n, each in enumerate(self.stream):
            key = f"stream[{n}]"
            if not each.columns:
                raise SerpentError(f"{key} has neither fields nor points.")
            if each.late and each.follows:
                raise SerpentError(f"{key} has late and follows: leave out one of them.")
            if each.follows and each.follows.own not in each.columns:
                raise SerpentError(f"{key}.follows.own is none of its columns.")
            if each.follows and each.follows.like not in {*names} - {*each.columns}:
                raise SerpentError(f"{key}.follows.like is no column of another stream.")


def read(path: Path) -> Map:
    """Read a map.toml; raises a `SerpentError` that names the key."""
    return stored.read_toml(path, Map, ADVICE)


def si(values: Array, unit: str, scale: float = 1.0, offset: float = 0.0) -> Array:
    """Values in a unit in SI units."""
    return offset + scale * TO_SI[unit][0] * values
