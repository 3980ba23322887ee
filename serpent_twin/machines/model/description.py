"""Say what a machine.toml holds: which columns drive an MJCF, and which it is compared with."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.model.actuator_numbers import is_dc_motor
from serpent_twin.machines.model.bare import bare
from serpent_twin.machines.model.numbers import NUMBERS
from serpent_twin.residual import (
    ANGLE,
    ANGULAR_VELOCITY,
    CONTROL,
    FORCE,
    LENGTH,
    LOADS,
    POSITION,
    TORQUE,
    VELOCITY,
    Measure,
)
from serpent_twin.stored import Form, above, many, within
from serpent_twin.units import TO_SI

ADVICE = "docs/reference/machine-toml.md lists the keys."
POSES, MOTION = "poses", "motion"
"""What the rows of a log may be"""
if TYPE_CHECKING:
    Unit = NumberName = KnownName = str
else:
    Unit = Literal[tuple(TO_SI)]
    NumberName = Literal[tuple(NUMBERS)]
    KnownName = Literal[tuple(name for name, kind in NUMBERS.items() if not kind.added)]
Number = Annotated[float, within(-1e9, 1e9)]
Name = Annotated[str, msgspec.Meta(min_length=1)]
Vector = Annotated[tuple[Number, ...], many(3)]


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
    """Joint whose motion the column prescribes: the model follows it, whatever force that takes"""
    tendon: str = ""
    """Tendon whose length the column prescribes"""
    offset: Number | Literal["keyframe"] = 0.0
    """SI value where the column is 0, or "keyframe" for the value in the keyframe"""
    velocity: str = ""
    """Column of the velocity of a prescribed motion, in the unit per second, where velocities are commanded
    once a row: between rows the motion takes up the velocity that ends at the next row, with a lag that the
    logs show; without it, a motion is a spline through its rows
    """
    exact: bool = False
    """Whether zero and scale are known and not fitted, as where a servo's own encoder is measured"""
    zero: Annotated[float, within(0.0, 1e6)] = 0.0
    """Standard deviation of the zero that calibration fits, in the unit; 0: a hundredth of the range"""
    ratio: Annotated[float, within(0.0, 10.0)] = 0.0
    """Standard deviation of the logarithm of a scale that calibration fits to a prescribed motion; 0: none"""
    enable: str = ""
    """Column that is 0 where the actuator is switched off, so that it gives no force"""

    @property
    def of(self) -> tuple[str, str]:
        """Kind and name of what is driven."""
        return _only(self, DRIVEN)


class MeasuredColumns(Form, frozen=True):
    """Columns that the model is compared with."""

    columns: Annotated[tuple[Name, ...], many(1, 4)]
    """Names of the columns in the logs: three for a site, one for most others"""
    unit: Unit = "1"
    """Unit of the numbers in the columns"""
    scale: Number = 1.0
    """SI value = offset + scale × value in the unit; of a motor's current, the torque constant"""
    offset: Number = 0.0
    """SI value where a column is 0"""
    site: str = ""
    """Site whose position is measured"""
    joint: str = ""
    """Joint whose angle or length is measured; in N m or N, what drives a joint whose motion is prescribed,
    its friction included
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
    """Standard deviation of the measurement noise, in the unit; 0: estimated from the logs"""
    zero: Annotated[float, within(0.0, 1e6)] = 0.0
    """Standard deviation of a zero that calibration fits, in the unit; 0: known"""
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
        return "" if self.of_effort else self.joint

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
    what is fitted; an empty list: no number of this kind is fitted
    """
    prior: Annotated[float, above(0.0, 1000.0)] | None = None
    """Standard deviation of the logarithm of the ratio to the model's number; of numbers that are added, in
    mm or degrees; by default that of the table below
    """
    each: Annotated[float, above(0.0, 1000.0)] | None = None
    """Standard deviation by which each of those that match differs from what they share, in the same terms;
    by default they do not differ
    """
    begin: Annotated[float, within(-10.0, 10.0)] = 0.0
    """Where a fit of what they share begins, away from the model's number, in the terms of `prior`: where a
    number shows, or is known to be
    """


class KnownNumber(Form, frozen=True):
    """A number of the model that each session states."""

    number: KnownName
    """Kind of number, one of the table below that is not added"""
    of: Name
    """Name of a joint, actuator or body"""
    columns: Annotated[tuple[Name, ...], many(1, 3)]
    """Columns that are constant in a session, or entries of the log's metadata; of several, the product"""
    scale: Annotated[float, above(0.0, 1e9)] = 1.0
    """SI value = scale × product"""


class Description(Form, frozen=True):
    """What a machine.toml holds."""

    schema_version: Literal[1]
    """Version of this form"""
    model: Name
    """MJCF or URDF file, relative to the folder of this file"""
    rows: Literal["poses", "motion"]
    """Whether a log's rows are poses at rest, for each of which the model settles, or instants of a motion"""
    drive: Annotated[tuple[DriveColumn, ...], many(1, 1000)]
    """Columns that drive the model"""
    measured: Annotated[tuple[MeasuredColumns, ...], many(1, 1000)]
    """Columns that the model is compared with; the quantity of the first one is the pose"""
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
    """Rows that are fitted and judged as one segment; 0: 20 poses, or 100 rows of a motion"""
    start: Annotated[float, within(0.0, 1e3)] = 0.0
    """Time [s] about the first row of a segment, through which a parabola gives the state in which the
    segment begins; 0: the model follows the 15 rows before the segment
    """
    lead: Annotated[float, within(0.0, 1e3)] = 0.0
    """Time [s] before each segment through which the model moves there from rest in its keyframe, for a
    machine that has forgotten by then how it was; 0: segments begin as the log says
    """
    steps: Annotated[int, within(0, 1000)] = 0
    """Time steps of the simulation between two rows of a motion, at least 8, or one for each command where
    `every` is 4 or more, though they be longer than the model's; 0: set by the noise
    """


def pose_first(about: Description) -> Description:
    """The same, what is measured of the pose before all else."""
    pose = about.measured[0].measure
    ordered = sorted(about.measured, key=lambda each: each.measure != pose)
    return msgspec.structs.replace(about, measured=tuple(ordered))


_SLIDE = mujoco.mjtJoint.mjJNT_SLIDE
KINDS = ("site", "joint", "sensor", "tendon", "actuator")
"""What of a model can be measured"""
DRIVEN = ("actuator", "joint", "tendon")
"""What of it can be driven"""
MEASURES = {
    "m": LENGTH,
    "rad": ANGLE,
    "N": FORCE,
    "N m": TORQUE,
    "m/s": VELOCITY,
    "rad/s": ANGULAR_VELOCITY,
}
"""By SI unit"""
_STATED = {"m": ("mm", 1e-3), "rad": ("°", np.pi / 180)}
"""Units in which lengths and angles are stated, and how many of SI they are"""
_PLACE = Measure("place", "the place is", "place error, rms", "mm", "mm", 1e3, "m")


def beside(pose: Measure, measure: Measure) -> Measure:
    """A measure as that of a channel beside the pose, whose error is a root mean square of numbers."""
    if measure == pose:
        return pose
    return _PLACE if measure == POSITION else replace(measure, size=f"{measure.one} error, rms")


@dataclass(frozen=True, eq=False)
class Described:
    """A machine.toml and its model, which agree."""

    path: Path
    about: Description
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    files: list[Path]
    """All that it is made of"""

    @cached_property
    def bare(self) -> mujoco.MjSpec:
        """The model without what is only drawn, as it is simulated."""
        return bare(self.spec, self.model)

    @property
    def name(self) -> str:
        """Of the machine."""
        return self.about.name or self.path.resolve().parent.name

    @property
    def begin(self) -> Array:
        """Where runs begin, (nq,)."""
        return self.model.key(self.about.keyframe).qpos if self.about.keyframe else self.model.qpos0

    @property
    def commanded(self) -> list[DriveColumn]:
        """The drives that tell actuators something."""
        return [each for each in self.about.drive if each.actuator]

    @property
    def switches(self) -> list[str]:
        """The columns that switch actuators off, each once."""
        return list(dict.fromkeys(each.enable for each in self.commanded if each.enable))

    @property
    def prescribed(self) -> list[DriveColumn]:
        """The drives whose motion is known."""
        return [each for each in self.about.drive if not each.actuator]

    @property
    def winches(self) -> list[str]:
        """The joints in motion whose motion is known."""
        moves = self.about.rows == MOTION
        return [each.joint for each in self.prescribed if each.joint and moves]

    @property
    def efforts(self) -> dict[str, MeasuredColumns]:
        """What is measured of the torque or force that drives a joint whose motion is known, by the joint."""
        return {each.joint: each for each in self.about.measured if each.joint in self.winches}

    @property
    def read_joints(self) -> dict[str, str]:
        """The column of each joint whose motion is prescribed, or whose angle or length is measured."""
        columns = {each.joint: each.column for each in self.prescribed if each.joint}
        measured = (each for each in self.about.measured if each.angle_of)
        return columns | {each.angle_of: each.columns[0] for each in measured}

    @property
    def pose(self) -> Measure:
        """The measure of the pose."""
        return self.about.measured[0].measure

    def is_servo(self, actuator: str) -> bool:
        """Whether an actuator's control is a position, not a force or a voltage."""
        n = self.model.actuator(actuator).id
        if is_dc_motor(self.model)[n]:
            return bool(self.model.actuator_ctrlspec[n] == mujoco.mjtCtrlInput.mjINPUT_POS)
        return bool(self.model.actuator_biasprm[n, 1])

    def is_length(self, drive: DriveColumn) -> bool:
        """Whether what is driven is a length: that of a tendon, or of a slide."""
        return self.control_unit(drive)[0] == "mm"

    def control_unit(self, drive: DriveColumn) -> tuple[str, float]:
        """The unit in which what is driven is stated, and how many of SI it is."""
        n = self.model.actuator(drive.actuator).id if drive.actuator else 0
        if drive.actuator and not self.is_servo(drive.actuator):
            return "1", 1.0
        if (told := TO_SI[drive.unit][1]) in _STATED:  # that of a geared servo is before the gear
            return _STATED[told]
        kind, target = self.model.actuator_trntype[n], self.model.actuator_trnid[n, 0]
        slides = kind == mujoco.mjtTrn.mjTRN_JOINT and self.model.jnt_type[target] == _SLIDE
        return _STATED["m" if kind == mujoco.mjtTrn.mjTRN_TENDON or slides else "rad"]

    def limits(self, drive: DriveColumn) -> Array | None:
        """Of what is driven [SI], (2,); None where it has none."""
        kind, name = drive.of
        model = self.model
        limited, ranges, thing = {
            "actuator": (model.actuator_ctrllimited, model.actuator_ctrlrange, model.actuator),
            "joint": (model.jnt_limited, model.jnt_range, model.joint),
            "tendon": (model.tendon_limited, model.tendon_range, model.tendon),
        }[kind]
        return ranges[thing(name).id] if limited[thing(name).id] else None

    def offset(self, drive: DriveColumn) -> float:
        """What a drive's column is where its value is zero [SI]."""
        if drive.offset != "keyframe":
            return float(drive.offset)
        data, key = mujoco.MjData(self.model), self.model.key(self.about.keyframe).id
        mujoco.mj_resetDataKeyframe(self.model, data, key)
        mujoco.mj_forward(self.model, data)
        kind, name = drive.of
        if kind == "actuator":
            return float(data.ctrl[self.model.actuator(name).id])
        return float(data.joint(name).qpos[0] if kind == "joint" else data.tendon(name).length[0])

    def told(self, drive: DriveColumn) -> Measure:
        """What a drive tells the model."""
        unit, own = self.control_unit(drive)[0], TO_SI[drive.unit][1]
        if unit == "1" and own != "1":
            return replace(CONTROL, unit=own, base=own)
        return {"mm": LENGTH, "°": ANGLE, "1": CONTROL}[unit]

    @property
    def keyframe_controls(self) -> Array:
        """Controls of the keyframe, (nu,); zeros without one."""
        if not self.about.keyframe:
            return np.zeros(self.model.nu)
        return self.model.key(self.about.keyframe).ctrl.copy()
