"""Say what a machine.toml holds: which columns drive an MJCF, and which it is compared with."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec

from serpent_twin.machines.model.numbers import NUMBERS
from serpent_twin.residual import LOADS, MEASURES, POSITION, Measure
from serpent_twin.stored import Form, above, many, within
from serpent_twin.units import TO_SI

ADVICE = "docs/reference/machine-toml.md lists the keys."
POSES, MOTION, TORQUES = "poses", "motion", "torque"
"""What the rows of a log may be"""
if TYPE_CHECKING:
    Unit = NumberName = KnownName = str
else:
    Unit = Literal[tuple(TO_SI)]
    NumberName = Literal[tuple(name for name, kind in NUMBERS.items() if kind.uncertain)]
    KnownName = Literal[
        tuple(n for n, kind in NUMBERS.items() if not (kind.added and kind.uncertain))
    ]
Number = Annotated[float, within(-1e9, 1e9)]
Name = Annotated[str, msgspec.Meta(min_length=1)]
Vector = Annotated[tuple[Number, ...], many(3)]


KINDS = ("site", "joint", "sensor", "tendon", "actuator")
"""What of a model can be measured"""
DRIVEN = ("actuator", "joint", "tendon")
"""What of it can be driven"""


class Column(Form, frozen=True):
    """A column of a log, and what a number in it is."""

    column: Name
    """Name of the column in the logs"""
    unit: Unit = "1"
    """Unit of the numbers in the column"""
    scale: Number = 1.0
    """SI value = offset + scale × value in the unit; negative where the signs differ"""


class TimeColumn(Form, frozen=True):
    """The column with the time."""

    column: Name
    """Name of the column in the logs"""
    unit: Unit = "1"
    """Unit of a time that is a number; time stamps, such as 2025-03-02T10:00:20, need none"""
    scale: Number | None = None
    """Time in the unit = scale × value: 0.02 for rows counted at 50 Hz, 1 for whole numbers of seconds"""

    @property
    def seconds(self) -> float:
        """Seconds of a number in the column."""
        return (1.0 if self.scale is None else self.scale) * TO_SI[self.unit][0]


class DriveColumn(Column, frozen=True):
    """A column that drives the model."""

    actuator: str = ""
    """Actuator whose `ctrl` the column is, before the gear"""
    joint: str = ""
    """Joint whose motion the column prescribes, whatever force that takes"""
    tendon: str = ""
    """Tendon whose length it prescribes"""
    offset: Number | Literal["keyframe"] = 0.0
    """SI value where the column is 0, or "keyframe" for the value in the keyframe"""
    velocity: str = ""
    """Column of the velocity, in the unit per second, that a prescribed motion is commanded once a row and
    reaches with a lag that the logs show; without it, a spline through rows
    """
    exact: bool = False
    """Whether zero and scale are known, as where a servo's own encoder is measured"""
    zero: Annotated[float, within(0.0, 1e6)] = 0.0
    """Standard deviation of the zero that calibration fits, in the unit; 0: a hundredth of the range"""
    ratio: Annotated[float, within(0.0, 10.0)] = 0.0
    """Standard deviation of the logarithm of a scale that calibration fits to a prescribed motion; 0: none"""
    enable: str = ""
    """Column that is 0 where the actuator is off and gives no force"""

    @property
    def of(self) -> tuple[str, str]:
        """Kind and name of what is driven."""
        return _only(self, DRIVEN)


class MeasuredColumns(Form, frozen=True):
    """Columns that the model is compared with."""

    columns: Annotated[tuple[Name, ...], many(1, 4)]
    """Names of the columns in the logs: three for a site, one for most"""
    unit: Unit = "1"
    """Unit of the numbers in the columns"""
    scale: Number = 1.0
    """SI value = offset + scale × value in the unit; of a motor's current, the torque constant"""
    offset: Number = 0.0
    """SI value where a column is 0"""
    site: str = ""
    """Site whose position is measured"""
    joint: str = ""
    """Joint whose angle, length or velocity is measured; in N m or N, what drives it where its motion is
    prescribed, friction included
    """
    sensor: str = ""
    """Sensor of the model whose reading is measured"""
    tendon: str = ""
    """Tendon whose length is measured; in a unit of force, or of torque where its length is an angle, the
    pull of its spring
    """
    actuator: str = ""
    """Actuator whose force is measured: MuJoCo's `actuator_force`, that of a motor before its gear"""
    frame: str = ""
    """Site, fixed to the world, in whose frame the site's position is measured; by default the world's"""
    point: Vector = (0.0, 0.0, 0.0)
    """Place of the marker in the site's frame [m]"""
    cameras: bool = True
    """Whether calibration fits the frame of the position, within millimetres and degrees"""
    noise: Annotated[float, within(0.0, 1e6)] = 0.0
    """Standard deviation of the noise, in the unit; 0: estimated from the logs"""
    zero: Annotated[float, within(0.0, 1e6)] = 0.0
    """Standard deviation of a zero that calibration fits, in the unit; 0: known"""
    ratio: Annotated[float, within(0.0, 10.0)] = 0.0
    """Standard deviation of the logarithm of a fitted scale, as of a torque constant; 0: known"""
    of_stall: bool = False
    """Whether `scale` is a stall torque, and errors are in percent of it"""

    @property
    def of(self) -> tuple[str, str]:
        """Kind and name of what is measured."""
        return _only(self, KINDS)

    @property
    def names(self) -> tuple[str, ...]:
        """The thing, or each column of a thing that has several."""
        return (self.of[1],) if self.site or len(self.columns) == 1 else self.columns

    @property
    def angle_of(self) -> str:
        """The joint whose angle or length is measured; nothing where something else is."""
        return "" if self.of_effort or self.of_velocity else self.joint

    @property
    def of_velocity(self) -> bool:
        """Whether a velocity is measured."""
        return TO_SI[self.unit][1] in ("m/s", "rad/s")

    @property
    def of_effort(self) -> bool:
        """Whether a force or torque is measured."""
        return TO_SI[self.unit][1] in ("N", "N m")

    @property
    def measure(self) -> Measure:
        """The quantity that is measured."""
        if self.of_stall:
            return replace(LOADS, scale=LOADS.scale / abs(self.scale), base="N m")
        return POSITION if self.site else MEASURES[TO_SI[self.unit][1]]


def _only(named: Form, kinds: tuple[str, ...]) -> tuple[str, str]:
    """The one kind of thing that a table names, and its name; nothing where it names several or none."""
    found = [(kind, getattr(named, kind)) for kind in kinds if getattr(named, kind)]
    return found[0] if len(found) == 1 else ("", "")


class Uncertain(Form, frozen=True):
    """Numbers of the model that calibration fits, in place of those that it fits by default."""

    number: NumberName
    """Kind of number, one of the table below"""
    of: Annotated[tuple[Name, ...], many(0, 1000)]
    """Names of joints, tendons, actuators, bodies or sites, with wildcards; those that match one text share
    what is fitted; an empty list: none is fitted
    """
    prior: Annotated[float, above(0.0, 1000.0)] | None = None
    """Standard deviation of the logarithm of the ratio to the model's number; of added numbers, in mm or
    degrees; by default that of the table
    """
    each: Annotated[float, above(0.0, 1000.0)] | None = None
    """Standard deviation by which each that matches differs from what they share, in the same terms; by
    default 0
    """
    most: Annotated[float, above(0.0, 1000.0)] | None = None
    """Bound of what they share, in the terms of `prior`"""
    begin: Annotated[float, within(-10.0, 10.0)] = 0.0
    """Where a fit of what they share begins, in the terms of `prior`"""


class KnownNumber(Form, frozen=True):
    """A number of the model that is known in sessions."""

    number: KnownName
    """`load`, or a kind of number below that is not added"""
    of: Name
    """Name of its joint, actuator, body or site"""
    columns: Annotated[tuple[Name, ...], many(0, 3)] = ()
    """Columns constant in a session, or entries of the log's metadata; of several, the product"""
    scale: Annotated[float, above(0.0, 1e9)] = 1.0
    """SI value = scale × product"""
    value: Number | None = None
    """SI value, in place of columns"""
    sessions: Annotated[tuple[Name, ...], many(1, 1000)] = ("*",)
    """Names of sessions or files, with wildcards; others have the model's number"""


class Description(Form, frozen=True):
    """What a machine.toml holds."""

    schema_version: Literal[1]
    """Version of this form"""
    model: Name
    """MJCF or URDF file, relative to the folder of this file"""
    rows: Literal["poses", "motion", "torque"]
    """Poses at rest, for each of which the model settles, instants of a motion, or instants with all joints
    and torques
    """
    measured: Annotated[tuple[MeasuredColumns, ...], many(1, 1000)]
    """Columns that the model is compared with; the quantity of the first one is the pose"""
    drive: Annotated[tuple[DriveColumn, ...], many(0, 1000)] = ()
    """Columns that drive the model"""
    name: str = ""
    """Name of the machine; by default that of the folder"""
    keyframe: str = ""
    """Keyframe of the model in which runs begin, and what `offset = "keyframe"` means"""
    time: TimeColumn | None = None
    """Column with the time; a motion needs it, poses without it are counted"""
    session: str = ""
    """Column whose value names the session of a row, where one file holds several in turn"""
    uncertain: tuple[Uncertain, ...] = ()
    """Numbers of the model that calibration fits, in place of the default"""
    candidates: Annotated[tuple[Name, ...], many(0, 1000)] = ()
    """Names, with wildcards, of the effects that the machine may have, such as `["*_friction@*"]`; by default
    all that have a place in it
    """
    changes: Annotated[tuple[Name, ...], many(0, 1000)] = ()
    """Names of the effects that are candidates after a change of the machine; by default `candidates`"""
    known: tuple[KnownNumber, ...] = ()
    """Numbers of the model that differ from session to session"""
    every: Annotated[int, within(1, 100_000)] = 1
    """One reading is used of so many rows; commands are applied at the full rate"""
    segment: Annotated[int, within(0, 100_000)] = 0
    """Rows fitted and judged as one segment; 0: 20 poses, or 100 rows of a motion"""
    start: Annotated[float, within(0.0, 1e3)] = 0.0
    """Time [s] about a row through which a parabola gives the state there; a segment begins in the quietest
    of some before it. 0: the model follows the 15 rows before the segment
    """
    lead: Annotated[float, within(0.0, 1e3)] = 0.0
    """Time [s] through which the model moves to each segment from rest in its keyframe, for a machine that
    forgets how it was; 0: segments begin as the log says
    """
    steps: Annotated[int, within(0, 1000)] = 0
    """Time steps between two rows of a motion, at least 8, or one for each command where `every` is 4 or
    more; 0: set by the noise
    """

    @property
    def followed(self) -> list[tuple[str, str]]:
        """Kind and name of what follows a column."""
        measured = [each.of for each in self.measured if self.held and each.angle_of]
        return [each.of for each in self.drive if not each.actuator] + measured

    @property
    def moves(self) -> bool:
        """Whether rows are instants of a motion."""
        return self.rows != POSES

    @property
    def held(self) -> bool:
        """Whether rows are of torques, and every joint follows its column."""
        return self.rows == TORQUES


def pose_first(about: Description) -> Description:
    """Put what is measured of the pose before all else that is measured."""
    pose = about.measured[0].measure
    ordered = sorted(about.measured, key=lambda each: each.measure != pose)
    return msgspec.structs.replace(about, measured=tuple(ordered))
