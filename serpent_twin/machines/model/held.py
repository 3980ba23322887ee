"""Let every joint follow its column, where a log has the torques that its motion takes."""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np
from msgspec.structs import replace

from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import Description, DriveColumn, MeasuredColumns
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.machines.model.things import OBJECTS, acts_on, names
from serpent_twin.numerals import listed
from serpent_twin.tables.log import Log
from serpent_twin.units import TO_SI

_OFFSET = 0.1
"""Prior of a torque's offset, of its scatter in the logs"""


def as_held(about: Description, model: mujoco.MjModel) -> Description:
    """A description of torques with joints that are measured as drives, which the model follows, and motors
    that are measured as what drives their joints.
    """
    followed = tuple(_followed(each) for each in about.measured if each.angle_of)
    efforts = tuple(_effort(each, model) for each in about.measured if _is_effort(each))
    return replace(about, drive=followed, measured=efforts)


def amiss_in_held(about: Description, model: mujoco.MjModel) -> list[tuple[str, str]]:
    """Each thing that is wrong with a description of torques: its key, and why."""
    found = list[tuple[str, str]]()
    if about.drive:
        found.append(
            ("drive", "is of rows that are simulated. Measure every joint, and what drives it.")
        )
    moved = list[tuple[str, str]]()
    for n, each in enumerate(about.measured):
        kind, name = each.of
        if kind not in ("joint", "actuator"):
            told = (
                "is not compared where rows are of torques: measure joints, and what drives them."
            )
            found.append((f"measured[{n}].{kind}", told))
        elif _is_effort(each) and name in names(model, OBJECTS[kind]):
            of = each.of if kind == "joint" else acts_on(model, name)
            if of in moved:
                found.append(
                    (
                        f"measured[{n}].{kind}",
                        f"drives {of[1]}, whose torque is measured already. Leave one out.",
                    )
                )
            elif of not in about.followed:
                found.append(
                    (
                        f"measured[{n}].{kind}",
                        f"drives {' '.join(of)}, whose angle no column has. Measure it.",
                    )
                )
            moved.append(of)
    if len(single_joints(model)) < model.njnt:
        found.append(
            (
                "rows",
                'is "torque", and the model has joints that are no hinges or slides: use "motion".',
            )
        )
    joints = [model.joint(n).name for n in range(model.njnt)]
    if lacking := [name for name in joints if ("joint", name) not in about.followed]:
        told = f"lacks the angle of {listed(map(repr, lacking))}. Torques depend on every joint: measure all."
        found.append(("measured", told))
    if not moved:
        found.append(
            (
                "measured",
                "has no torque, force or current of a joint's motor: nothing would be compared. Add it.",
            )
        )
    return found


def _is_effort(each: MeasuredColumns) -> bool:
    """Whether a column is of what drives a joint, not of how it moves."""
    return not each.angle_of and not each.of_velocity


def with_offsets(machine: Described, training: Sequence[Log]) -> Described:
    """The machine with an offset of each measured torque that calibration fits, if the file states none."""
    measured = tuple(_offset(each, training) for each in machine.about.measured)
    return dataclasses.replace(machine, about=replace(machine.about, measured=measured))


def _offset(each: MeasuredColumns, training: Sequence[Log]) -> MeasuredColumns:
    if each.zero or not each.of_effort:
        return each
    values = np.concatenate([run.columns[name] for run in training for name in each.columns])
    return replace(each, zero=_OFFSET * float(np.nanstd(values)) / TO_SI[each.unit][0])


def _followed(each: MeasuredColumns) -> DriveColumn:
    return DriveColumn(
        each.columns[0],
        each.unit,
        each.scale,
        joint=each.joint,
        offset=each.offset,
        exact=not each.zero,
        zero=each.zero,
    )


def _effort(each: MeasuredColumns, model: mujoco.MjModel) -> MeasuredColumns:
    """What drives a joint, by what its motor gives before the gear."""
    if not each.actuator or each.actuator not in names(model, OBJECTS["actuator"]):
        return each
    kind, joint = acts_on(model, each.actuator)
    if kind != "joint":
        return each
    gear = float(model.actuator(each.actuator).gear[0])
    return replace(
        each, actuator="", joint=joint, scale=gear * each.scale, offset=gear * each.offset
    )
