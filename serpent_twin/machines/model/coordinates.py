"""List the numbers of a model that calibration fits, and write them into its spec."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.machines.machine import Declared, Quantity
from serpent_twin.machines.model.built_alike import built_alike
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION, DriveColumn, MeasuredColumns, Uncertain
from serpent_twin.machines.model.numbers import (
    NUMBERS,
    OF_SLIDES,
    change_compiled,
    change_number,
    names_of,
    numbers_of,
)
from serpent_twin.units import TO_SI

_ZERO, _SCALE = 0.01, 0.05
"""Prior of a drive's zero, of its control's range; of the logarithm of the drives' scale"""
_IN_MOTION = 0.001
"""Finite difference of a motion, of a prior, where others are a tenth: a motion is smooth enough. What longer
ones are off by passes for information on what all forces share, fifty times what is known of it before
"""
_FARTHEST = float(np.log(1000.0))
"""Bound on a fitted logarithm of a number, so that no mass becomes too small for MuJoCo"""
_APART = 10.0
"""Widths by which one of several that share a number differs from it at most"""
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


def ratio_of(drive: DriveColumn) -> str:
    """Name of the coordinate of a prescribed motion's own scale."""
    return f"scale of {' '.join(drive.of)}"


@dataclass(frozen=True)
class FittedNumber:
    """A coordinate of the fit: numbers of the model that change together, or one of its drives or cameras."""

    declared: Declared
    quantity: Quantity
    number: str = ""
    """What of the model it changes; nothing for what is no number of the model"""
    of: tuple[int, ...] = ()
    """Indices of the model's elements whose number it changes"""
    begin: float = 0.0
    """Where a fit begins"""

    def guessed(self, guess: Mapping[str, float]) -> "FittedNumber":
        """A coordinate whose quantity starts at a first guess of all coordinates, by name."""
        if not guess:
            return self
        start = self.quantity.after(sum(guess.get(name, 0.0) for name in self.quantity.of))
        return replace(self, quantity=replace(self.quantity, start=start))


def coordinates(machine: Described) -> tuple[FittedNumber, ...]:
    """The coordinates of the fit that data of this kind can move."""
    found = (*_drives(machine), *_numbers(machine), *_readings(machine), *_cameras(machine))
    if machine.about.rows != MOTION:
        return found
    return tuple(
        replace(each, declared=replace(each.declared, step=_IN_MOTION * each.declared.prior))
        for each in found
    )


def _drives(machine: Described) -> Iterator[FittedNumber]:
    """The zero of each drive, a scale of its own where one is asked for, and the scale that all servos share;
    a force's is its actuator's gain.
    """
    for drive in (each for each in machine.about.drive if not each.exact):
        limits = machine.limits(drive)
        unit, per = machine.control_unit(drive)
        prior = _ZERO * (1.0 if limits is None else float(np.ptp(limits))) / per
        prior = drive.zero * TO_SI[drive.unit][0] / per or prior
        name = zero_of(drive)
        yield FittedNumber(
            Declared(name, unit, prior, 0.1 * prior),
            Quantity(name, unit, 0.0, 1.0, (name,)),
        )
        if drive.ratio:
            yield _scale(ratio_of(drive), drive.ratio)
    if any(machine.is_servo(each.actuator) and not each.exact for each in machine.commanded):
        yield _scale(SCALE, _SCALE)


def _scale(name: str, prior: float) -> FittedNumber:
    """A scale, whose logarithm is fitted."""
    return FittedNumber(
        Declared(name, "log 1", prior, 0.1 * prior), Quantity(name, "1", 1.0, 0.0, (name,), 1.0)
    )


def _numbers(machine: Described) -> Iterator[FittedNumber]:
    """Numbers of the model: those that the file lists; of other kinds, those of copies of one part change
    alike.
    """
    told = {each.number for each in machine.about.uncertain}
    for each in machine.about.uncertain:
        yield from _listed(machine.model, each)
    for number, kind in NUMBERS.items():
        fitted = kind.fitted or (kind.held and machine.about.held)
        if fitted and number not in told and _moves(machine, number):
            yield from _alike(machine, number)


def _listed(model: mujoco.MjModel, uncertain: Uncertain) -> Iterator[FittedNumber]:
    known = names_of(model, uncertain.number)
    can_change = _can_change(model, uncertain.number)
    prior = uncertain.prior or NUMBERS[uncertain.number].prior
    for pattern in uncertain.of:
        named = (n for n, name in enumerate(known) if fnmatchcase(name, pattern))
        which = tuple(n for n in named if can_change[n])
        shared = _coordinate(model, uncertain.number, which, prior, pattern)
        expected = shared.quantity.after(uncertain.begin)
        held = replace(shared.declared, farthest=uncertain.most or shared.declared.farthest)
        quantity = replace(shared.quantity, nominal=expected)
        yield replace(shared, declared=held, begin=uncertain.begin, quantity=quantity)
        apart = uncertain.each or 0.0
        for n in which if apart and len(which) > 1 else ():
            one = _coordinate(model, uncertain.number, (n,), apart, known[n])
            of = (shared.declared.name, one.declared.name)
            declared = one.declared
            if declared.farthest < np.inf:
                declared = replace(declared, farthest=min(_APART * apart, _FARTHEST))
            expected = one.quantity.after(uncertain.begin)
            quantity = replace(one.quantity, of=of, nominal=expected)
            yield replace(one, declared=declared, quantity=quantity)


def _can_change(model: mujoco.MjModel, number: str) -> NDArray[np.bool_]:
    """Whether a number of each thing can change: no factor changes 0, and nothing the world."""
    kind = NUMBERS[number]
    if kind.added:
        there = np.ones(len(names_of(model, number)), bool)
    else:
        there = np.asarray(numbers_of(model, number) != 0)
    if kind.of == "body":
        there[0] = False
    return there


def _alike(machine: Described, number: str) -> Iterator[FittedNumber]:
    """A coordinate for each part: of actuators and joints those that a drive tells something, or that are
    free to move; of bodies those that move; none of which a log states the number.
    """
    model, kind = machine.model, NUMBERS[number]
    values, names = numbers_of(model, number).copy(), names_of(model, number)
    moot = {each.of for each in machine.about.known if each.number == number}
    if kind.of == "actuator":
        moot |= set(names) - {each.actuator for each in machine.commanded}
    if kind.of == "joint" and not machine.about.held:
        moot |= {each.joint for each in machine.prescribed}
    if kind.of == "tendon":
        moot |= {each.tendon for each in machine.prescribed}
    values[[name in moot for name in names]] = 0.0
    if kind.of == "body":
        values[model.body_weldid == 0] = 0.0  # what is fixed to the world weighs on nothing
    part = built_alike(model, kind.of)
    there = values > 0
    if kind.added:
        there = np.array([name not in moot for name in names])
        if kind.of == "body":
            there &= (model.body_weldid > 0) & (model.body_mass > 0)
    several = [np.flatnonzero(there & (part == n)) for n in dict.fromkeys(part)]
    for those in sorted((each for each in several if len(each)), key=lambda each: values[each[0]]):
        which = tuple(those.tolist())
        label = names[which[0]] if len(which) == 1 else f"{len(which)} alike from {names[which[0]]}"
        yield _coordinate(model, number, which, kind.prior, label)


def _coordinate(
    model: mujoco.MjModel, number: str, which: tuple[int, ...], prior: float, label: str
) -> FittedNumber:
    name, unit = f"{number} of {label}", NUMBERS[number].unit
    if (
        NUMBERS[number].of == "joint"
        and (model.jnt_type[list(which)] == mujoco.mjtJoint.mjJNT_SLIDE).all()
    ):
        unit = OF_SLIDES.get(unit, unit)
    start = float(np.mean(numbers_of(model, number)[list(which)]))
    added = NUMBERS[number].added
    return FittedNumber(
        Declared(name, unit, prior, 0.1 * prior)
        if added
        else Declared(name, f"log {unit}", prior, 0.1 * prior, _FARTHEST),
        Quantity(name, unit, start, float(added), (name,), start),
        number,
        which,
    )


def _moves(machine: Described, number: str) -> bool:
    """Whether logs of this kind can show a kind of number at all."""
    if machine.about.moves:
        return True
    gravity = bool(machine.model.opt.gravity.any())
    return NUMBERS[number].at_rest and (number != "mass" or gravity)


def zeros_of(measured: MeasuredColumns) -> list[str]:
    """Names of the coordinates of the zeros of its columns; none where they are known."""
    return [f"zero of {name}" for name in measured.columns if measured.zero]


def scales_of(measured: MeasuredColumns) -> list[str]:
    """Names of the coordinates of the scales of its columns; none where they are known."""
    return [f"scale of {name}" for name in measured.columns if measured.ratio]


def _readings(machine: Described) -> Iterator[FittedNumber]:
    """Zeros and scales of what is measured."""
    for each in machine.about.measured:
        factor, unit = TO_SI[each.unit]
        for name in zeros_of(each):
            prior = each.zero * factor
            yield FittedNumber(
                Declared(name, unit, prior, 0.1 * prior), Quantity(name, unit, 0.0, 1.0, (name,))
            )
        for name in scales_of(each):
            yield _scale(name, each.ratio)


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
    """Write coordinates into a spec of the model, but for those of compiled models."""
    for number, n, by in _changes(all_of, values, compiled=False):
        change_number(spec, number, n, by)


def edit_compiled(
    model: mujoco.MjModel, all_of: Sequence[FittedNumber], values: Mapping[str, float]
) -> None:
    """Write into a compiled model those coordinates that no spec can take."""
    for number, n, factor in _changes(all_of, values, compiled=True):
        change_compiled(model, number, n, factor)


def arm_factors(
    model: mujoco.MjModel, all_of: Sequence[FittedNumber], values: Mapping[str, float]
) -> dict[str, float]:
    """Ratios of joints' moment arms to the model's, by the name of the joint."""
    out: dict[str, float] = {}
    for _, n, factor in _changes(all_of, values, compiled=True):
        name = model.joint(n).name
        out[name] = factor * out.get(name, 1.0)
    return out


def _changes(
    all_of: Sequence[FittedNumber], values: Mapping[str, float], compiled: bool
) -> Iterator[tuple[str, int, float]]:
    """Numbers of single things, and by which factor each changes, or how much is added to it."""
    for each in all_of:
        value = values.get(each.declared.name, 0.0)
        if not (each.number and value) or NUMBERS[each.number].compiled != compiled:
            continue
        by = value if NUMBERS[each.number].added else float(np.exp(value))
        yield from ((each.number, n, by) for n in each.of)
