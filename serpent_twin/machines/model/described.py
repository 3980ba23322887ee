"""A machine.toml with the model that it describes: what is driven and measured of it, and in which units."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.model.actuator_numbers import is_dc_motor
from serpent_twin.machines.model.bare import bare
from serpent_twin.machines.model.description import (
    Description,
    DriveColumn,
    MeasuredColumns,
)
from serpent_twin.residual import ANGLE, CONTROL, LENGTH, POSITION, Measure
from serpent_twin.units import TO_SI

_SLIDE = mujoco.mjtJoint.mjJNT_SLIDE
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
    velocities: tuple[MeasuredColumns, ...] = ()
    """Velocities of joints that say how these move where rows are of torques, and are not compared"""

    @property
    def logged(self) -> tuple[MeasuredColumns, ...]:
        """All columns of measurements that are read."""
        return *self.about.measured, *self.velocities

    @cached_property
    def bare(self) -> mujoco.MjSpec:
        """The model without what is only drawn, as it is simulated."""
        return bare(self.spec, self.model)

    @property
    def name(self) -> str:
        """Name of the machine; by default that of its folder."""
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
        return [each.joint for each in self.prescribed if each.joint and self.about.moves]

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
        """Range of what is driven [SI], (2,); None where it has none."""
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
