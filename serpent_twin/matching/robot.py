"""Load an MJCF or URDF, and list what of it a log can drive or measure."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.actuator_numbers import is_dc_motor
from serpent_twin.machines.model.drive_errors import range_in_degrees
from serpent_twin.machines.model.masses import settle_total_mass
from serpent_twin.machines.model.things import OBJECTS, acts_on, joint_type, names, not_single
from serpent_twin.numerals import counted, listed

SERVO, SPEED, FORCE = "servo", "speed servo", "motor"
"""What an actuator is told: a position, a velocity, or a force, torque or anything else"""
_MISSING = re.compile(r"[Ee]rror opening file '([^']+)'|[Rr]esource not found.*?'([^']+)'")
_MODELS = (".xml", ".mjcf", ".urdf")


@dataclass(frozen=True)
class Joint:
    """A hinge or slide."""

    name: str
    hinge: bool
    limits: tuple[float, float] | None
    """[rad or m]"""
    sensors: tuple[str, ...]
    """Names of the model's sensors of its position"""


@dataclass(frozen=True)
class Actuator:
    """An actuator, and the joint or tendon that it moves."""

    name: str
    kind: str
    """Servo, speed servo or motor"""
    joint: str
    """Empty if it moves something else"""
    limits: tuple[float, float] | None
    """Range of the actuator's control"""
    gear: float
    slides: bool
    """Whether it moves a slide or a tendon, along a length"""


@dataclass(frozen=True, eq=False)
class Robot:
    """A model, and what of it a log can drive or measure."""

    path: Path
    model: mujoco.MjModel
    joints: tuple[Joint, ...]
    actuators: tuple[Actuator, ...]
    notes: tuple[str, ...] = ()
    without_meshes: str = ""
    """The model as MJCF, if files of meshes are missing"""

    def joint(self, name: str) -> Joint:
        """A joint by its name."""
        return next(each for each in self.joints if each.name == name)

    def actuator(self, name: str) -> Actuator:
        """An actuator by its name."""
        return next(each for each in self.actuators if each.name == name)


def load(path: Path) -> Robot:
    """The robot of an MJCF or URDF, or of a folder with one; raises a `SerpentError` that says what to do."""
    path = _file(path)
    spec, model, notes = _compiled(path)
    _require_names(path, model)
    actuators = tuple(_actuators(model))
    for each in actuators:
        if why := range_in_degrees(model, each.name):
            raise SerpentError(f"{path}: the actuator {why}")
    whole = spec.to_xml() if notes else ""
    notes += tuple(_others(model))
    return Robot(path, model, tuple(_joints(model)), actuators, notes, whole)


def _others(model: mujoco.MjModel) -> Iterator[str]:
    """Sentences on joints for which no column is sought."""
    several = names(model, OBJECTS["joint"])
    if unnamed := several.count(""):
        yield f"{counted(unnamed, 'joint')} of the model without a name: no column is sought for it."
    if others := [name for name in several if name and not_single(model, name)]:
        yield f"{listed(others)}: neither a hinge nor a slide, so that no column is sought for it."


def _file(path: Path) -> Path:
    if path.is_dir():
        found = sorted(each for each in path.iterdir() if each.suffix.lower() in _MODELS)
        if len(found) == 1:
            return found[0]
        there = f"several: {listed(each.name for each in found)}" if found else "none"
        raise SerpentError(
            f"{path} is a folder, and must have one model in MJCF or URDF: it has {there}. Name the file of "
            "the robot that was logged."
        )
    if not path.is_file():
        raise SerpentError(f"There is no file {path}. Name the robot's MJCF or URDF.")
    if path.suffix.lower() not in _MODELS:
        raise SerpentError(f"{path} is no model: name the robot's MJCF (.xml) or URDF (.urdf).")
    return path


def _compiled(path: Path) -> tuple[mujoco.MjSpec, mujoco.MjModel, tuple[str, ...]]:
    """A model, without the meshes whose files are missing."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        settle_total_mass(spec) if not spec.meshes else None
    except ValueError as error:
        raise SerpentError(_broken(path, error)) from None
    missing: list[str] = []
    while True:
        try:
            model = spec.compile()
            break
        except ValueError as error:
            file = _MISSING.search(str(error))
            if not file or not _drop(spec, Path(file[1] or file[2]).name):
                raise SerpentError(_broken(path, error, missing)) from None
            missing.append(Path(file[1] or file[2]).name)
    if not missing:
        return spec, model, ()
    said = (
        f"{path}: the files of {len(missing)} mesh{'es' if len(missing) > 1 else ''} are missing "
        f"({listed(missing[:4])}{' …' if len(missing) > 4 else ''}), and the model is simulated without "
        "them: they touch nothing.",
    )
    return spec, model, said


def _drop(spec: mujoco.MjSpec, file: str) -> bool:
    """Take a mesh out of a model, with what is made of it; whether there was one."""
    gone = [each for each in spec.meshes if Path(each.file).name == file]
    called = {each.name or Path(each.file).stem for each in gone}
    for geom in list(spec.geoms):
        if geom.meshname in called:
            spec.delete(geom)
    for each in gone:
        spec.delete(each)
    return bool(gone)


def _broken(path: Path, error: ValueError, missing: list[str] | None = None) -> str:
    why = " ".join(str(error).split()).rstrip(".")
    if missing:
        return (
            f"{path}: the files of the meshes {listed(missing[:4])} are missing, and without them MuJoCo "
            f"says: {why}. Put the files beside the model, or give its bodies an <inertial>."
        )
    return f"{path} is no model that MuJoCo builds: {why}. Correct it until MuJoCo's own viewer opens it."


def _require_names(path: Path, model: mujoco.MjModel) -> None:
    """Refuse an actuator without a name, which machine.toml could not name."""
    several = names(model, OBJECTS["actuator"])
    if "" in several:
        n = several.index("")
        target = int(model.actuator_trnid[n, 0])
        of = model.joint(target).name if model.actuator_trntype[n] <= 1 else ""
        moved = f", which moves the joint {of}," if of else ""
        raise SerpentError(
            f'{path}: actuator {n + 1}{moved} has no name. Give it one, such as name="{of or "drive"}".'
        )


def require_actuators(robot: Robot) -> None:
    """Refuse a robot that no command can drive."""
    if not robot.actuators:
        raise SerpentError(_no_actuators(robot.path, robot.model))


def _no_actuators(path: Path, model: mujoco.MjModel) -> str:
    joint = next((n for n in names(model, OBJECTS["joint"]) if n and not not_single(model, n)), "")
    if not joint:
        return (
            f"{path} has no actuators and no hinge or slide with a name: there is nothing to drive."
        )
    save = "save it as MJCF (docs/describe-a-machine.md has the line) and " * (
        path.suffix == ".urdf"
    )
    return (
        f"{path} has no actuators, so that no command can drive it: {save}add to it what drives each "
        f'joint, such as <actuator><position name="{joint}" joint="{joint}" kp="20" kv="1"/></actuator> '
        f'for a servo or <motor name="{joint}" joint="{joint}"/> for a torque. Or write a machine.toml '
        "whose [[drive]] tables name joints, if their motion is prescribed and something else is measured. "
        "Torques or currents of motors need no actuators where logs have them beside every joint's angle."
    )


def _joints(model: mujoco.MjModel) -> Iterator[Joint]:
    for name in names(model, OBJECTS["joint"]):
        if not name or not_single(model, name):
            continue
        joint = model.joint(name)
        limits = (float(joint.range[0]), float(joint.range[1])) if joint.limited[0] else None
        sensors = tuple(
            model.sensor(n).name
            for n in range(model.nsensor)
            if model.sensor_type[n] == mujoco.mjtSensor.mjSENS_JOINTPOS
            and model.sensor_objid[n] == joint.id
        )
        yield Joint(name, joint_type(model, name) == "hinge", limits, sensors)


def _actuators(model: mujoco.MjModel) -> Iterator[Actuator]:
    for n, name in enumerate(names(model, OBJECTS["actuator"])):
        kind, moved = acts_on(model, name)
        joint = moved if kind == "joint" else ""
        limits = model.actuator_ctrlrange[n] if model.actuator_ctrllimited[n] else None
        yield Actuator(
            name,
            _kind(model, n),
            joint,
            None if limits is None else (float(limits[0]), float(limits[1])),
            float(model.actuator_gear[n, 0]),
            kind == "tendon" or (bool(joint) and joint_type(model, joint) == "slide"),
        )


def _kind(model: mujoco.MjModel, n: int) -> str:
    """What an actuator is told."""
    if is_dc_motor(model)[n]:
        told = model.actuator_ctrlspec[n] == mujoco.mjtCtrlInput.mjINPUT_POS
        return SERVO if told else FORCE
    position, velocity = model.actuator_biasprm[n, 1:3]
    gain = model.actuator_gainprm[n, 0]
    integrates = model.actuator_dyntype[n] == mujoco.mjtDyn.mjDYN_INTEGRATOR
    affine = model.actuator_biastype[n] == mujoco.mjtBias.mjBIAS_AFFINE
    if affine and position and np.isclose(position, -gain):
        return SPEED if integrates else SERVO
    if affine and not position and velocity and np.isclose(velocity, -gain):
        return SPEED
    return FORCE
