"""Read a machine.toml, and refuse one that does not agree with its model."""

from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

import mujoco

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.description import (
    ADVICE,
    KINDS,
    MEASURES,
    MOTION,
    Described,
    Description,
    MeasuredColumns,
)
from serpent_twin.machines.model.files import files
from serpent_twin.machines.model.lines import with_line
from serpent_twin.machines.model.masses import settle_total_mass
from serpent_twin.units import TO_SI

_OBJECTS = {
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
}
_NUMBERS_OF = {
    **dict.fromkeys(
        ("joint stiffness", "joint damping", "joint friction", "armature"),
        mujoco.mjtObj.mjOBJ_JOINT,
    ),
    "actuator gain": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "mass": mujoco.mjtObj.mjOBJ_BODY,
}


def read(path: Path, model_file: Path | None = None) -> Described:
    """Read a machine.toml and its MJCF, which may lie elsewhere; raises a `SerpentError` that names line and
    key.
    """
    raw = stored.contents(path, advice=ADVICE).decode(errors="replace")
    try:
        about = stored.read_toml(path, Description, ADVICE)
    except SerpentError as error:
        raise SerpentError(with_line(str(error), raw)) from None
    file = model_file or path.parent / about.model
    several = [path, *files(file, file.name)[1:]] if model_file else files(path, about.model)
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        settle_total_mass(spec)
        model = spec.compile()
    except ValueError as error:
        raise SerpentError(
            f"{file} is no model that MuJoCo builds: {' '.join(str(error).split())} Mend the MJCF."
        ) from None
    found = Described(path, about, spec, model, several)
    problem = next(iter(_amiss(about, model)), None)
    if problem:
        key, text = problem
        raise SerpentError(with_line(f"{path}: {key} {text} {ADVICE}", raw))
    return found


def _amiss(about: Description, model: mujoco.MjModel) -> list[tuple[str, str]]:
    """What the description names and the model lacks, with the key."""
    found = []
    if about.keyframe and about.keyframe not in _names(model, mujoco.mjtObj.mjOBJ_KEY):
        found.append(("keyframe", _unknown(about.keyframe, model, mujoco.mjtObj.mjOBJ_KEY)))
    if "" in _names(model, mujoco.mjtObj.mjOBJ_ACTUATOR):
        told = "must name each actuator of the model, where one has no name: give it one."
        found.append(("drive", told))
    for n, each in enumerate(about.drive):
        key = f"drive[{n}]"
        if each.actuator not in _names(model, mujoco.mjtObj.mjOBJ_ACTUATOR):
            text = _unknown(each.actuator, model, mujoco.mjtObj.mjOBJ_ACTUATOR)
            found.append((f"{key}.actuator", text))
        if each.offset == "keyframe" and not about.keyframe:
            found.append((f"{key}.offset", "is the keyframe's, and no keyframe is named."))
    driven = [each.actuator for each in about.drive]
    for name in _names(model, mujoco.mjtObj.mjOBJ_ACTUATOR):
        if name and driven.count(name) != 1:
            how = "no drive" if name not in driven else "two drives"
            found.append(("drive", f"must name each actuator once: {name!r} has {how}."))
    for n, each in enumerate(about.measured):
        found += [
            (f"measured[{n}].{key}".rstrip("."), why) for key, why in _amiss_measured(each, model)
        ]
    if about.rows == MOTION and not about.time:
        found.append(("rows", f'is "{MOTION}", and no time column is named: add [time].'))
    if not found and len({each.measure.one for each in about.measured}) > 1:
        found.append(
            ("measured", "has quantities of several kinds; all must be of one, such as positions.")
        )
    for n, each in enumerate(about.uncertain):
        of = _NUMBERS_OF[each.number]
        for pattern in each.of:
            if not any(fnmatchcase(name, pattern) for name in _names(model, of)):
                found.append((f"uncertain[{n}].of", _unknown(pattern, model, of)))
    return found


def _amiss_measured(each: MeasuredColumns, model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    """What is wrong with a measured thing: its key, and why."""
    kind, name = each.of
    if not kind:
        yield "", "must name one of " + ", ".join(KINDS) + "."
    elif name not in _names(model, _OBJECTS[kind]):
        yield kind, _unknown(name, model, _OBJECTS[kind])
    elif len(each.columns) != (wanted := _size(model, kind, name)):
        yield "columns", f"must be {wanted}: {kind} {name!r} has so many."
    elif (is_in := TO_SI[each.unit][1]) not in (units := _si_units(model, kind, name)):
        yield "unit", f"is {each.unit!r}, of {is_in}; {kind} {name!r} is in {' or '.join(units)}."


def _si_units(model: mujoco.MjModel, kind: str, name: str) -> tuple[str, ...]:
    """SI units in which a thing may be measured."""
    if kind == "sensor":
        return tuple(MEASURES)
    slide = kind == "joint" and model.joint(name).type[0] == mujoco.mjtJoint.mjJNT_SLIDE
    return ("m",) if kind == "site" or slide else ("rad",)


def _size(model: mujoco.MjModel, kind: str, name: str) -> int:
    """How many numbers a measured thing has."""
    if kind == "sensor":
        return int(model.sensor(name).dim[0])
    return 3 if kind == "site" else 1


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj) -> list[str]:
    """The names of a model's things of a kind."""
    count = {
        mujoco.mjtObj.mjOBJ_ACTUATOR: model.nu,
        mujoco.mjtObj.mjOBJ_SITE: model.nsite,
        mujoco.mjtObj.mjOBJ_JOINT: model.njnt,
        mujoco.mjtObj.mjOBJ_SENSOR: model.nsensor,
        mujoco.mjtObj.mjOBJ_BODY: model.nbody,
        mujoco.mjtObj.mjOBJ_KEY: model.nkey,
    }[kind]
    return [mujoco.mj_id2name(model, kind, n) or "" for n in range(count)]


def _unknown(name: str, model: mujoco.MjModel, kind: mujoco.mjtObj) -> str:
    there = [each for each in _names(model, kind) if each]
    listed = stored.names(there, 40) if there else "none that has a name"
    return f"is {name!r}, which the model lacks; there are: {listed}."
