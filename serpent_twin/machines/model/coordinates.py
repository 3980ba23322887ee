"""List the numbers of a model that calibration fits, and write them into its spec."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import mujoco
import numpy as np

from serpent_twin.machines.machine import Declared, Quantity
from serpent_twin.machines.model.description import MOTION, Described, DriveColumn, Uncertain
from serpent_twin.machines.model.masses import weigh

_ZERO, _SCALE = 0.01, 0.05
"""Prior of a drive's zero, of its control's range; of the logarithm of the drives' scale"""
_STIFFNESS, _GAIN, _MASS = 0.3, 0.5, 0.2
"""Priors of logarithms"""
_TURNED, _SHIFTED = 5.0, 20.0
"""Priors of the frame of the cameras [°], [mm]"""
CAMERAS = (
    tuple(f"cameras turned about {a}" for a in "xyz"),
    tuple(f"cameras along {a}" for a in "xyz"),
)
"""Names of the coordinates of the cameras' frame"""
SCALE = "scale of the drives"
"""Name of the coordinate that all drives share which set a position"""


def zero_of(drive: DriveColumn) -> str:
    """Name of the coordinate of a drive's zero."""
    return f"zero of {drive.actuator or ' '.join(drive.of)}"


@dataclass(frozen=True)
class FittedNumber:
    """A coordinate of the fit: numbers of the model that change together, or one of its drives or cameras."""

    declared: Declared
    quantity: Quantity
    number: str = ""
    """What of the model it changes; nothing for what is no number of the model"""
    of: tuple[int, ...] = ()
    """Of which of its things"""


def coordinates(machine: Described) -> tuple[FittedNumber, ...]:
    """The coordinates of the fit that data of this kind can move."""
    return (*_drives(machine), *_numbers(machine), *_cameras(machine))


def _drives(machine: Described) -> Iterator[FittedNumber]:
    """The zero of each drive, and the scale that all servos share; a force's is its actuator's gain."""
    for drive in machine.about.drive:
        limits = machine.limits(drive)
        unit, per = machine.control_unit(drive)
        prior = _ZERO * (1.0 if limits is None else float(np.ptp(limits))) / per
        name = zero_of(drive)
        yield FittedNumber(
            Declared(name, unit, prior, 0.1 * prior),
            Quantity(name, unit, 0.0, 1.0, (name,)),
        )
    if any(machine.is_servo(each.actuator) for each in machine.commanded):
        yield FittedNumber(
            Declared(SCALE, "log 1", _SCALE, 0.1 * _SCALE),
            Quantity(SCALE, "1", 1.0, 0.0, (SCALE,), 1.0),
        )


def _numbers(machine: Described) -> Iterator[FittedNumber]:
    """Numbers of the model: those that the file lists; of a kind that it does not list, all that are equal
    change alike.
    """
    told = {each.number for each in machine.about.uncertain}
    for each in machine.about.uncertain:
        yield from _listed(machine.model, each)
    for number, (prior, *_) in NUMBERS.items():
        if number not in told and _moves(machine, number):
            yield from _alike(machine, number, prior)


def _listed(model: mujoco.MjModel, uncertain: Uncertain) -> Iterator[FittedNumber]:
    known = _names(model, uncertain.number)
    for pattern in uncertain.of:
        which = tuple(n for n, name in enumerate(known) if fnmatchcase(name, pattern))
        yield _coordinate(model, uncertain.number, which, uncertain.prior, pattern)


def _alike(machine: Described, number: str, prior: float) -> Iterator[FittedNumber]:
    """Of actuators and joints, those that a drive tells something, or that are free to move."""
    model = machine.model
    values, known = numbers_of(model, number).copy(), _names(model, number)
    if number != "mass":
        told = {each.actuator for each in machine.commanded}
        held = {each.joint for each in machine.prescribed}
        moot = set(known) - told if number == "actuator gain" else held
        values[[name in moot for name in known]] = 0.0
    for value in sorted({float(v) for v in values if v > 0}):
        which = tuple(np.flatnonzero(values == value).tolist())
        label = known[which[0]] if len(which) == 1 else f"{len(which)} alike from {known[which[0]]}"
        yield _coordinate(model, number, which, prior, label)


def _coordinate(
    model: mujoco.MjModel, number: str, which: tuple[int, ...], prior: float, label: str
) -> FittedNumber:
    name, unit = f"{number} of {label}", NUMBERS[number][1]
    if number in _OF_JOINTS and (model.jnt_type[list(which)] == mujoco.mjtJoint.mjJNT_SLIDE).all():
        unit = OF_SLIDES[unit]
    start = float(np.mean(numbers_of(model, number)[list(which)]))
    return FittedNumber(
        Declared(name, f"log {unit}", prior, 0.1 * prior),
        Quantity(name, unit, start, 0.0, (name,), start),
        number,
        which,
    )


NUMBERS: Mapping[str, tuple[float, str]] = {
    "joint stiffness": (_STIFFNESS, "N m/rad"),
    "joint damping": (_GAIN, "N m s/rad"),
    "joint friction": (_GAIN, "N m"),
    "armature": (_GAIN, "kg m²"),
    "actuator gain": (_GAIN, "1"),
    "mass": (_MASS, "kg"),
}
"""Kinds of numbers: prior and unit"""
OF_SLIDES = {
    "N m": "N",
    "N m s/rad": "N s/m",
    "N m/rad": "N/m",
    "N m/rad³": "N/m³",
    "kg m²": "kg",
    "rad/s": "m/s",
}
"""Units of what is said of hinges, at a slide"""
_OF_JOINTS = ("joint stiffness", "joint damping", "joint friction", "armature")
_OF_MOTION = ("joint damping", "armature")
"""Those that no pose at rest shows"""


def _moves(machine: Described, number: str) -> bool:
    """Whether logs of this kind can show a kind of number at all."""
    if machine.about.rows == MOTION:
        return True
    return number not in _OF_MOTION and (number != "mass" or bool(machine.model.opt.gravity.any()))


def numbers_of(model: mujoco.MjModel, number: str) -> np.ndarray:
    """The numbers of a kind, of all things that have one."""
    match number:
        case "mass":
            return model.body_mass
        case "actuator gain":
            return model.actuator_gainprm[:, 0]
        case "joint stiffness":
            return model.jnt_stiffness
    of_dof = {
        "joint damping": model.dof_damping,
        "joint friction": model.dof_frictionloss,
        "armature": model.dof_armature,
    }[number]
    return of_dof[model.jnt_dofadr]


def _names(model: mujoco.MjModel, number: str) -> list[str]:
    """Of the things that have a number; those without a name are counted."""
    things = {"mass": model.body, "actuator gain": model.actuator}.get(number, model.joint)
    count = {"mass": model.nbody, "actuator gain": model.nu}.get(number, model.njnt)
    return [things(n).name or f"number {n}" for n in range(count)]


def _cameras(machine: Described) -> Iterator[FittedNumber]:
    """The frame in which sites are measured, and where the markers sit on them."""
    sites = [each for each in machine.about.measured if each.site]
    if any(each.cameras for each in sites):
        for names, unit, prior in zip(CAMERAS, ("°", "mm"), (_TURNED, _SHIFTED), strict=True):
            for name in names:
                yield FittedNumber(
                    Declared(name, unit, prior, 0.05 * prior),
                    Quantity(name, unit, 0.0, 1.0, (name,)),
                )


def edit_numbers(
    spec: mujoco.MjSpec, all_of: Sequence[FittedNumber], values: Mapping[str, float]
) -> None:
    """Write coordinates into a spec of the model."""
    joints, actuators, bodies = spec.joints, spec.actuators, [*spec.bodies]
    for each in all_of:
        factor = float(np.exp(values[each.declared.name])) if each.number in NUMBERS else 1.0
        for n in each.of if each.number in NUMBERS else ():
            match each.number:
                case "joint stiffness":
                    joints[n].stiffness = np.asarray(joints[n].stiffness) * factor
                case "joint damping":
                    joints[n].damping = np.asarray(joints[n].damping) * factor
                case "joint friction":
                    joints[n].frictionloss *= factor
                case "armature":
                    joints[n].armature *= factor
                case "actuator gain":
                    actuators[n].gainprm[0] *= factor
                    actuators[n].biasprm[1:3] *= factor
                case "mass":
                    weigh(bodies[n], factor)
