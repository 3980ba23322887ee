"""Read a machine.toml, and refuse one that does not agree with its model."""

from collections import Counter
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

import mujoco

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import (
    ADVICE,
    KINDS,
    MOTION,
    POSES,
    Description,
    MeasuredColumns,
    pose_first,
)
from serpent_twin.machines.model.drive_errors import amiss_in_drives
from serpent_twin.machines.model.files import files
from serpent_twin.machines.model.held import amiss_in_held, as_held
from serpent_twin.machines.model.joint_velocities import with_velocity_sensors
from serpent_twin.machines.model.known import amiss_known
from serpent_twin.machines.model.lines import with_line
from serpent_twin.machines.model.masses import settle_total_mass, state_all
from serpent_twin.machines.model.numbers import NUMBERS, numbers_of
from serpent_twin.machines.model.things import (
    OBJECTS,
    acts_on,
    joint_type,
    lengths,
    names,
    not_single,
    sensor_units,
    speeds,
    unknown,
    wrong_unit,
)
from serpent_twin.numerals import listed
from serpent_twin.residual import MEASURES
from serpent_twin.units import TO_SI

_EFFORT = ("N m", "N")
"""SI units of what drives a hinge and a slide"""


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
    if file.is_dir():
        raise SerpentError(
            with_line(f"{path}: model is {about.model!r}, which is a folder. {ADVICE}", raw)
        )
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        settle_total_mass(spec)
        model = spec.compile()
        if about.held or any(NUMBERS[each.number].stated for each in about.uncertain):
            state_all(spec, model)
    except ValueError as error:
        raise SerpentError(
            f"{file} is no model that MuJoCo builds: {' '.join(str(error).split()).rstrip('.')}. Mend the "
            "MJCF."
        ) from None
    problem = next(iter(_amiss(about, model)), None)
    if problem:
        key, text = problem
        raise SerpentError(with_line(f"{path}: {key} {text} {ADVICE}", raw))
    velocities = tuple(each for each in about.measured if about.held and each.of_velocity)
    about = as_held(about, model) if about.held else about
    _delete_superseded(spec, about, model)
    about = with_velocity_sensors(spec, about, model)
    return Described(path, pose_first(about), spec, spec.compile(), several, velocities)


def _delete_superseded(spec: mujoco.MjSpec, about: Description, model: mujoco.MjModel) -> None:
    """Delete actuators of what follows its column, all where rows are of torques, and their sensors."""
    followed = about.followed
    actuators = [
        each for n, each in enumerate(spec.actuators) if about.held or acts_on(model, n) in followed
    ]
    names = [each.name for each in actuators]
    sensors = [
        each
        for each in spec.sensors
        if each.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR and each.objname in names
    ]
    for each in (*sensors, *actuators):
        spec.delete(each)


def _amiss(about: Description, model: mujoco.MjModel) -> list[tuple[str, str]]:
    """What the description names and the model lacks, with the key."""
    found = []
    if about.keyframe and about.keyframe not in names(model, mujoco.mjtObj.mjOBJ_KEY):
        found.append(("keyframe", unknown(about.keyframe, model, mujoco.mjtObj.mjOBJ_KEY)))
    found += [] if about.held else amiss_in_drives(about, model)
    found += _twice(about)
    for n, each in enumerate(about.measured):
        found += [
            (f"measured[{n}].{key}".rstrip("."), why)
            for key, why in _amiss_measured(each, about, model)
        ]
    found += amiss_in_held(about, model) if about.held else []
    if about.moves and not about.time:
        found.append(("rows", f'is "{about.rows}", and no time column is named: add [time].'))
    if about.lead and about.rows != MOTION:
        found.append(("lead", f'is of a motion, and rows are "{about.rows}": leave it out.'))
    if about.lead and about.start:
        found.append(
            ("start", "says how segments begin, and so does lead: leave one of the two out.")
        )
    if about.time and (of := TO_SI[about.time.unit][1]) not in ("s", "1"):
        found.append(("time.unit", f"is {about.time.unit!r}, of {of}; time is in s, ms, µs or ns."))
    compared = [e for e in about.measured if not found and not (about.held and e.of_velocity)]
    kinds = list(dict.fromkeys(each.measure.one for each in compared))
    if len(kinds) > 2:
        told = f"has quantities of {len(kinds)} kinds, {listed(kinds)}; beside the first, which is the "
        found.append(("measured", f"{told}pose, only one other is compared. Leave some out."))
    return found or [*amiss_known(about, model), *_amiss_uncertain(about, model)]


def _amiss_uncertain(about: Description, model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    """Numbers that the model lacks, that are zero there, or that are listed twice."""
    counts = Counter[tuple[str, str]]()
    for n, each in enumerate(about.uncertain):
        kind = OBJECTS[NUMBERS[each.number].of]
        known = names(model, kind)
        values = numbers_of(model, each.number)
        for pattern in each.of:
            those = [k for k, name in enumerate(known) if fnmatchcase(name, pattern)]
            if not those:
                yield f"uncertain[{n}].of", unknown(pattern, model, kind)
            elif not values[those].any() and not NUMBERS[each.number].added:
                yield (
                    f"uncertain[{n}].of",
                    f"has {pattern!r}, whose {each.number} is 0: no factor changes it.",
                )
            counts.update((each.number, known[k]) for k in those)
        twice = [name for (number, name), c in counts.items() if c > 1 and number == each.number]
        if twice:
            yield f"uncertain[{n}].of", f"has {twice[0]!r}, whose {each.number} is listed already."


def _twice(about: Description) -> Iterator[tuple[str, str]]:
    """Columns that are to be several things, and things that are measured twice."""
    use = {"time": "the clock"} | ({about.time.column: "the time"} if about.time else {})
    for n, drive in enumerate(about.drive):
        if drive.column in use:
            yield (
                f"drive[{n}].column",
                f"is {drive.column!r}, which is {use[drive.column]} already.",
            )
        if drive.scale == 0:
            yield f"drive[{n}].scale", "is 0, so that nothing would be driven."
        use[drive.column] = f"what drives {drive.of[1]}"
    for n, each in enumerate(about.known):
        for name in each.columns:
            if name in use:
                yield f"known[{n}].columns", f"has {name!r}, which is {use[name]} already."
    use |= {name: "a known number" for each in about.known for name in each.columns}
    use |= {drive.enable: "a switch" for drive in about.drive if drive.enable}
    there = set[tuple[str, str, str]]()
    for n, each in enumerate(about.measured):
        for name in each.columns:
            if name in use:
                yield f"measured[{n}].columns", f"has {name!r}, which is {use[name]} already."
            use[name] = f"measured of {each.of[1]}"
        which = *each.of, TO_SI[each.unit][1] if each.joint else ""
        if which in there:
            yield f"measured[{n}].{each.of[0]}", f"is {each.of[1]!r}, which is measured already."
        there.add(which)
        if each.scale == 0:
            yield f"measured[{n}].scale", "is 0, so that nothing would be measured."
        if each.of_stall and TO_SI[each.unit][1] != "N m":
            yield (
                f"measured[{n}].of_stall",
                'states a share of a stall torque, so that unit must be "N m" and scale the torque in N m.',
            )


def _amiss_measured(
    each: MeasuredColumns, about: Description, model: mujoco.MjModel
) -> Iterator[tuple[str, str]]:
    """What is wrong with a measured thing: its key, and why."""
    kind, name = each.of
    follows = about.held and kind == "joint" and not each.of_effort
    prescribed = [] if follows else about.followed
    if not kind:
        yield "", "must name exactly one of " + ", ".join(KINDS) + "."
    elif name not in names(model, OBJECTS[kind]):
        yield kind, unknown(name, model, OBJECTS[kind])
    elif each.of in prescribed and (kind == "tendon" or TO_SI[each.unit][1] not in _EFFORT):
        yield (
            kind,
            f"is {name!r}, whose motion a drive prescribes. Measure what responds to it, or the force or "
            "torque that drives a joint.",
        )
    elif (
        not about.held
        and (actuator := _actuator(model, kind, name))
        and acts_on(model, actuator) in prescribed
    ):
        moved = " ".join(acts_on(model, actuator))
        yield (
            kind,
            f"is {name!r}, which acts on {moved}, whose motion a drive prescribes: nothing tells it a "
            f"control. Measure the force or torque that drives {moved}, or a sensor of another kind.",
        )
    elif kind == "sensor" and _is_quaternion(model, name):
        yield (
            kind,
            f"is {name!r}, a quaternion, which is not compared: q and −q are one attitude. Measure joints, "
            "or a gyro of the model, or sites on the body by where they are.",
        )
    elif each.of_velocity and about.rows == POSES:
        yield (
            "unit",
            f"is {each.unit!r}, of a velocity, which is 0 in rows of poses at rest. Leave it out, or set "
            'rows = "motion" for a log of a motion.',
        )
    elif kind == "joint" and (ball := not_single(model, name)):
        yield kind, f"is {name!r}, {ball}: measure its turn by a sensor of the model."
    elif kind == "site" and not model.body_weldid[model.site(name).bodyid[0]]:
        yield kind, f"is {name!r}, which no joint moves: measure one on a body that moves."
    elif len(each.columns) != (wanted := _size(model, kind, name)):
        yield "columns", f"must be {wanted}: {kind} {name!r} has so many."
    elif each.zero and kind == "site" and each.cameras:
        yield "zero", "is that of a site whose frame of the cameras is fitted, too: leave one out."
    elif each.frame and (why := _wrong_frame(each, model)):
        yield "frame", why
    elif why := wrong_unit(each.unit, _si_units(model, each, each.of in prescribed), kind, name):
        yield "unit", why


def _wrong_frame(each: MeasuredColumns, model: mujoco.MjModel) -> str:
    """What is wrong with the site in whose frame something is measured; nothing where all is right."""
    if not each.site:
        return f"is of a site, and {each.of[0]} {each.of[1]!r} is measured: leave it out."
    if each.frame not in names(model, OBJECTS["site"]):
        return unknown(each.frame, model, OBJECTS["site"])
    if model.body_weldid[model.site(each.frame).bodyid[0]]:
        return f"is {each.frame!r}, which moves: name a site that is fixed to the world."
    return ""


def _si_units(
    model: mujoco.MjModel, measured: MeasuredColumns, prescribed: bool = False
) -> tuple[str, ...]:
    """SI units in which a thing may be measured; a joint whose motion is prescribed, by what drives it."""
    kind, name = measured.of
    if kind == "joint" and prescribed:
        return (_EFFORT[joint_type(model, name) == "slide"],)
    if kind == "joint" and measured.of_velocity:
        return speeds(model, name)
    if kind == "sensor":
        return sensor_units(model, name, tuple(MEASURES))
    if kind == "tendon":
        pulls = model.tendon_stiffness[model.tendon(name).id] > 0
        along = lengths(model, kind, name)
        return (*along, *({"m": "N", "rad": "N m"}[each] for each in along if pulls))
    if kind == "actuator":
        moved = acts_on(model, name)
        return {"hinge": ("N m",), "slide": ("N",), "tendon": ("N",)}.get(
            joint_type(model, moved[1]) if moved[0] == "joint" else moved[0], ("N m", "N")
        )
    return ("m",) if kind == "site" else lengths(model, kind, name)


def _actuator(model: mujoco.MjModel, kind: str, name: str) -> str:
    """The actuator that is measured, by itself or by a sensor of the model; nothing for another thing."""
    if kind != "sensor" or model.sensor(name).objtype[0] != mujoco.mjtObj.mjOBJ_ACTUATOR:
        return name if kind == "actuator" else ""
    return model.actuator(int(model.sensor(name).objid[0])).name


def _is_quaternion(model: mujoco.MjModel, sensor: str) -> bool:
    kinds = (mujoco.mjtSensor.mjSENS_FRAMEQUAT, mujoco.mjtSensor.mjSENS_BALLQUAT)
    return int(model.sensor(sensor).type[0]) in map(int, kinds)


def _size(model: mujoco.MjModel, kind: str, name: str) -> int:
    """How many numbers a measured thing has."""
    if kind == "sensor":
        return int(model.sensor(name).dim[0])
    return 3 if kind == "site" else 1
