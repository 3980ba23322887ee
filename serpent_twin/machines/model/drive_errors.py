"""Find what is wrong with the drives of a machine.toml."""

from collections.abc import Iterator

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.model.description import DRIVEN, POSES, Description, DriveColumn
from serpent_twin.machines.model.things import (
    OBJECTS,
    acts_on,
    joint_type,
    lengths,
    names,
    not_single,
    tendon_levers,
    unknown,
    wrong_unit,
)
from serpent_twin.numerals import counted
from serpent_twin.units import TO_SI

_HALF = 0.5
"""How near to the range of its joint in degrees a control range is taken for that"""


def amiss_in_drives(about: Description, model: mujoco.MjModel) -> list[tuple[str, str]]:
    """Each thing that is wrong: its key, and why."""
    found = []
    if not about.drive:
        found.append(("drive", "is missing, so that nothing would move. Add a [[drive]]."))
    prescribed = about.followed
    unnamed = [n for n, name in enumerate(names(model, OBJECTS["actuator"])) if not name]
    if any(acts_on(model, n) not in prescribed for n in unnamed):
        told = "must name each actuator of the model, where one has no name: give it one."
        found.append(("drive", told))
    for n, each in enumerate(about.drive):
        found += [(f"drive[{n}]{key}", why) for key, why in _amiss_drive(each, about, model)]
    return found or [("drive", why) for why in _amiss_together(about, model)]


def _amiss_drive(
    each: DriveColumn, about: Description, model: mujoco.MjModel
) -> Iterator[tuple[str, str]]:
    """What is wrong with a drive by itself."""
    kind, name = each.of
    if not kind:
        yield "", "must name exactly one of " + ", ".join(DRIVEN) + "."
    elif kind == "actuator" and not model.nu:
        yield ".actuator", _no_actuators(name, about, model)
    elif name not in names(model, OBJECTS[kind]):
        yield f".{kind}", unknown(name, model, OBJECTS[kind])
    elif kind == "joint" and (ball := not_single(model, name)):
        yield ".joint", f"is {name!r}, {ball}; only a hinge or a slide can follow a column."
    elif kind != "actuator" and (
        why := wrong_unit(each.unit, lengths(model, kind, name), kind, name)
    ):
        yield ".unit", why
    elif kind == "actuator" and each.ratio:
        yield (
            ".ratio",
            "is of a joint or a tendon that follows a column; leave it out of an actuator.",
        )
    elif kind != "actuator" and each.enable:
        yield ".enable", f"switches an actuator, and {kind} {name!r} follows its column."
    elif kind == "actuator" and model.actuator_ctrlnum[model.actuator(name).id] != 1:
        count = counted(int(model.actuator_ctrlnum[model.actuator(name).id]), "control")
        yield (
            ".actuator",
            f"is {name!r}, which takes {count}; a drive tells one. Give it one input.",
        )
    elif kind == "actuator" and (why := _wrong_control(each.unit, model, name)):
        yield ".unit", why
    elif kind == "actuator" and (why := range_in_degrees(model, name)):
        yield ".actuator", why
    if each.enable and about.rows == POSES:
        yield ".enable", f'is of a motion, and rows are "{POSES}": leave the rows out that are off.'
    if each.enable and each.enable in [other.column for other in about.drive]:
        yield ".enable", f"is {each.enable!r}, which drives something already."
    if each.offset == "keyframe" and not about.keyframe:
        yield ".offset", "is the keyframe's, and no keyframe is named."


def _no_actuators(name: str, about: Description, model: mujoco.MjModel) -> str:
    """What to do where a drive names an actuator of a model that has none, as no URDF has."""
    joints = names(model, OBJECTS["joint"])
    joint = name if name in joints else next(iter(filter(None, joints)), "NAME")
    to_mjcf = (
        f"save {about.model} as MJCF (docs/describe-a-machine.md has the line) and add to it "
        if about.model.lower().endswith(".urdf")
        else "add to it "
    )
    return (
        f"is {name!r}, and {about.model} has no actuators: say which joints are driven. For a servo, "
        f'{to_mjcf}<actuator><position name="{joint}" joint="{joint}" kp="20"/></actuator>; if the column '
        f'is the joint\'s own motion, write joint = "{joint}" here.'
    )


def range_in_degrees(model: mujoco.MjModel, name: str) -> str:
    """What is wrong with the control range of a hinge's position servo that is the joint's range in degrees:
    MuJoCo's compiler converts the range of a joint, and takes every `ctrlrange` as it is.
    """
    n, (kind, joint) = model.actuator(name).id, acts_on(model, name)
    if kind != "joint" or not _is_plain_servo(model, n) or joint_type(model, joint) != "hinge":
        return ""
    if not (model.actuator_ctrllimited[n] and model.joint(joint).limited[0]):
        return ""
    told, turns = model.actuator_ctrlrange[n], model.joint(joint).range
    if not _HALF < np.abs(told).max() / np.degrees(np.abs(turns).max()) < 1 / _HALF:
        return ""
    return (
        f"is {name!r}, whose ctrlrange is {told[0]:.4g} … {told[1]:.4g} rad where its joint {joint!r} has "
        f"{turns[0]:.4g} … {turns[1]:.4g} rad, as of degrees: MuJoCo takes a ctrlrange as it is, whatever "
        'the compiler\'s angle. Give it in radians in the MJCF, or inheritrange="1" in its place.'
    )


def _is_plain_servo(model: mujoco.MjModel, n: int) -> bool:
    """Whether an actuator's control is the angle or length that it moves to."""
    gain, bias = model.actuator_gainprm[n, 0], model.actuator_biasprm[n, 1]
    return bool(bias != 0 and bias == -gain and abs(model.actuator_gear[n, 0]) == 1)


def _wrong_control(unit: str, model: mujoco.MjModel, name: str) -> str:
    """What is wrong with the unit of what a position servo is told, if it is that of something else."""
    n, moved = model.actuator(name).id, acts_on(model, name)
    if not moved[0] or not _is_plain_servo(model, n) or TO_SI[unit][1] == "1":
        return ""
    return wrong_unit(unit, lengths(model, *moved), "position servo of " + moved[0], moved[1])


def _amiss_together(about: Description, model: mujoco.MjModel) -> Iterator[str]:
    """What is wrong with the drives beside each other."""
    driven = [each.of for each in about.drive]
    for kind, name in dict.fromkeys(driven):
        if kind != "actuator" and driven.count((kind, name)) > 1:
            yield f"must name each {kind} once: {name!r} has two drives."
    for name in filter(None, names(model, mujoco.mjtObj.mjOBJ_ACTUATOR)):
        moved, count = acts_on(model, name), driven.count(("actuator", name))
        if moved in driven:
            if count:
                yield (
                    f"prescribes the motion of {' '.join(moved)}, and also tells {name!r}, which acts on it: "
                    "leave one of the two out."
                )
        elif count != 1:
            how = "two drives" if count else "no drive"
            yield f"must name each actuator once: {name!r} has {how}."
    prescribed = [of for of in dict.fromkeys(driven) if of[0] != "actuator"]
    if prescribed and np.linalg.matrix_rank(_jacobian(about, model, prescribed)) < len(prescribed):
        told = ", ".join(" ".join(of) for of in prescribed)
        yield f"prescribes motions of which one follows from the others: {told}. Leave one out."


def _jacobian(about: Description, model: mujoco.MjModel, several: list[tuple[str, str]]) -> Array:
    """Change of joints and tendons with the degrees of freedom, where runs begin, (P, nv)."""
    data, out = mujoco.MjData(model), np.zeros((len(several), model.nv))
    if about.keyframe in names(model, mujoco.mjtObj.mjOBJ_KEY):
        mujoco.mj_resetDataKeyframe(model, data, model.key(about.keyframe).id)
    mujoco.mj_forward(model, data)
    for row, (kind, name) in zip(out, several, strict=True):
        if kind == "joint":
            row[model.joint(name).dofadr[0]] = 1.0
            continue
        row[:] = tendon_levers(model, data)[model.tendon(name).id]
    return out
