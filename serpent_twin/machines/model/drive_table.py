"""Write how a twin's drives obey their commands into a spec to be given away, and read it there."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.model.coordinates import (
    CAMERAS,
    SCALE,
    ratio_of,
    zero_of,
    zeros_of,
)
from serpent_twin.machines.model.described import Described

TABLE = "serpent_twin_drives"
"""Name of the custom numbers of an MJCF that hold the table"""
_COLUMNS = 4
_AFFINE = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
_PROPORTIONAL = (
    mujoco.mjtDyn.mjDYN_NONE,
    mujoco.mjtDyn.mjDYN_FILTER,
    mujoco.mjtDyn.mjDYN_FILTEREXACT,
)
"""Dynamics that scale and shift with the control: what a filter makes of s u + o is s y + o"""


@dataclass(frozen=True)
class DriveTable:
    """How each actuator of a machine obeys: a command u acts as scale · u + offset, (nu,) each."""

    scale: Array
    offset: Array
    """[m, rad or 1]"""
    inside: Array
    """1 where the MJCF has scale and offset, 0 where only the table has them"""
    force_per_control: Array
    """Force per control of an actuator whose control is a force, as effects had it in the fit [N m or N]"""

    @property
    def beside(self) -> bool:
        """Whether an actuator has a scale or an offset that the MJCF lacks."""
        own = (self.scale != 1) | (self.offset != 0)
        return bool((own & (self.inside == 0)).any())

    def acts_as(self, command: Array) -> Array:
        """What commands, (..., nu), act as."""
        return self.scale * command + self.offset

    def control_for(self, acting: Array) -> Array:
        """The controls of the MJCF that act so, (..., nu)."""
        return np.where(self.inside > 0, (acting - self.offset) / self.scale, acting)


def drive_table(machine: Described, x: Mapping[str, float]) -> DriveTable:
    """The table of a twin at coordinates `x` of the fit, as `controls` drives it; nothing is inside yet."""
    model, start = machine.model, machine.keyframe_controls
    scale, offset = np.ones(model.nu), np.zeros(model.nu)
    for each in machine.commanded:
        n = model.actuator(each.actuator).id
        if not each.exact:
            scale[n] = np.exp(x[SCALE]) if machine.is_servo(each.actuator) else 1.0
            offset[n] = (1 - scale[n]) * start[n] + machine.control_unit(each)[1] * x[zero_of(each)]
    force = np.abs(model.actuator_gainprm[:, 0] * model.actuator_gear[:, 0])
    return DriveTable(scale, offset, np.zeros(model.nu), force)


def write_calibration(spec: mujoco.MjSpec, machine: Described, x: Mapping[str, float]) -> list[str]:
    """Write scales and zeros of the drives into their gains, and the table; names of the coordinates that no
    number of the spec can be: those of other drives and of readings.
    """
    table, left = drive_table(machine, x), []
    for each in (each for each in machine.commanded if not each.exact):
        n = machine.model.actuator(each.actuator).id
        scale, offset = float(table.scale[n]), float(table.offset[n])
        if (scale, offset) == (1.0, 0.0):
            continue
        if _is_affine(spec.actuator(each.actuator)):
            _obey(spec.actuator(each.actuator), scale, offset)
            table.inside[n] = 1
        else:
            left.append(zero_of(each))
    columns = np.stack([table.scale, table.offset, table.inside, table.force_per_control], axis=1)
    values = columns.ravel() if columns.size else [0.0]  # MuJoCo has no empty numbers
    spec.add_numeric(name=TABLE, data=values, size=len(values))
    return left + [name for name in _beside(machine) if x.get(name, 0.0)]


def _beside(machine: Described) -> Iterator[str]:
    """Names of the coordinates of prescribed motion and of what is measured."""
    for drive in machine.prescribed:
        yield from (zero_of(drive), ratio_of(drive))
    for measured in machine.about.measured:
        yield from zeros_of(measured)
    yield from (name for names in CAMERAS for name in names)


def read_drives(model: mujoco.MjModel) -> DriveTable | None:
    """The table of a model that a trace has written; None of any other."""
    names = [model.numeric(n).name for n in range(model.nnumeric)]
    if TABLE not in names:
        return None
    values = np.array(model.numeric(TABLE).data)
    return DriveTable(*values[: len(values) // _COLUMNS * _COLUMNS].reshape(-1, _COLUMNS).T)


def _is_affine(actuator: mujoco.MjsActuator) -> bool:
    """Whether what an actuator gives is affine in its control."""
    return (
        actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED
        and actuator.biastype in _AFFINE
        and actuator.dyntype in _PROPORTIONAL
        and not actuator.inheritrange
    )


def _obey(actuator: mujoco.MjsActuator, scale: float, offset: float) -> None:
    """Let an affine actuator's control act as scale · u + offset."""
    if actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[:3] = 0.0
    actuator.biasprm[0] += actuator.gainprm[0] * offset
    actuator.gainprm[0] *= scale
    for limits in (actuator.ctrlrange, actuator.actrange):
        if limits[0] < limits[1]:
            limits[:] = (np.array(limits) - offset) / scale
