"""Name the numbers of a model that a fit changes or a session states, and scale them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from serpent_twin.engine.friction_softness import near_rest, scale_near_rest
from serpent_twin.machines.model.actuator_numbers import (
    CONSTANT,
    LIMIT,
    RESISTANCE,
    damping_time,
    gain,
    of_motor,
    scale_constant,
    scale_controller,
    scale_damping,
    scale_gain,
    scale_gear,
    scale_limit,
    scale_resistance,
    volts_per_error,
)
from serpent_twin.machines.model.masses import carry, sheared, spread_along, spread_of, weigh
from serpent_twin.machines.model.moment_arms import moment_arm, scale_moment_arm

_SEVERAL = {
    "body": "bodies",
    "actuator": "actuators",
    "joint": "joints",
    "tendon": "tendons",
    "site": "sites",
}
"""The things of a kind, of a spec"""
_TURN = "°"
"""Unit of the angles that a spec has in degrees or radians, as its compiler says"""
OF_SLIDES = {
    "N m": "N",
    "N m s/rad": "N s/m",
    "N m/rad": "N/m",
    "N m/rad³": "N/m³",
    "1/(N m)": "1/N",
    "kg m²": "kg",
    "rad/s": "m/s",
    _TURN: "mm",
}
"""Units of what is said of hinges, at a slide"""


@dataclass(frozen=True)
class NumberKind:
    """A kind of number that things of a model have."""

    unit: str
    of: str
    """Kind of the things: joint, tendon, actuator, body or site"""
    read: Callable[[mujoco.MjModel], np.ndarray]
    """Numbers of all things of the kind in a model; 0 where a thing has none"""
    change: Callable[..., None]
    """Multiply the number of a thing of a spec by a factor; or add to it, in its unit. Where no spec can be
    changed, change a compiled model, given the thing's index.
    """
    prior: float = 0.3
    """Standard deviation of the logarithm of its ratio to the model's; of what is added, in its unit"""
    added: bool = False
    """Whether it may be zero or of either sign, so that a fit adds to it"""
    stated: bool = False
    """Whether a model may leave it to MuJoCo's compiler, see `state_all`"""
    fitted: bool = True
    """Whether calibration fits it without being asked"""
    at_rest: bool = True
    """Whether poses at rest show it"""
    held: bool = False
    """Whether rows of torque fit it without being asked"""
    compiled: bool = False
    """Whether `change` is of a compiled model"""
    uncertain: bool = True
    """Whether a fit may change it; else sessions alone state it"""


def _of_dof(field: str) -> Callable[[mujoco.MjModel], np.ndarray]:
    return lambda model: getattr(model, field)[model.jnt_dofadr]


def _attribute(name: str) -> Callable[[Any, float], None]:
    def scale(thing: Any, factor: float) -> None:
        setattr(thing, name, np.asarray(getattr(thing, name)) * factor)

    return scale


def _shifted(name: str, axis: int) -> NumberKind:
    """A place of a body's centre of mass, `ipos`, or of a site, `pos`, in its body's frame."""
    of = "site" if name == "pos" else "body"

    def read(model: mujoco.MjModel) -> np.ndarray:
        return 1e3 * getattr(model, f"{of}_{name}")[:, axis]

    def shift(thing: Any, by: float) -> None:
        getattr(thing, name)[axis] += 1e-3 * by

    return NumberKind(
        "mm", of, read, shift, 5.0, added=True, stated=of == "body", fitted=False, held=of == "body"
    )


def _turned(name: str, compiled: str, prior: float) -> NumberKind:
    """An angle of a hinge, or a length of a slide, and its name in a compiled model."""

    def read(model: mujoco.MjModel) -> np.ndarray:
        per = np.where(model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE, 1e3, 180 / np.pi)
        return per * getattr(model, compiled)[model.jnt_qposadr]

    def shift(joint: Any, by: float) -> None:
        setattr(joint, name, getattr(joint, name) + by)

    return NumberKind(_TURN, "joint", read, shift, prior, added=True, fitted=False)


def _angled(axis: int) -> NumberKind:
    """A turn of a body about an axis of its own frame, beyond how the model has it."""

    def turn(body: Any, by: float) -> None:
        beyond = Rotation.from_rotvec(np.radians(by) * np.eye(3)[axis])
        own = Rotation.from_quat(body.quat, scalar_first=True)
        body.quat = (own * beyond).as_quat(scalar_first=True)

    return NumberKind(
        _TURN,
        "body",
        lambda model: np.zeros(model.nbody),
        turn,
        2.0,
        added=True,
        stated=True,
        fitted=False,
    )


def _leaning(axis: int) -> NumberKind:
    """A lean of a joint's axis towards an axis of its body's frame."""

    def lean(joint: Any, by: float) -> None:
        joint.axis = joint.axis / np.linalg.norm(joint.axis) + 1e-3 * by * np.eye(3)[axis]

    def read(model: mujoco.MjModel) -> np.ndarray:
        return 1e3 * model.jnt_axis[:, axis]

    return NumberKind("mrad", "joint", read, lean, 5.0, added=True, fitted=False)


def _loosen(tendon: Any, by: float) -> None:
    tendon.springlength[1] += 1e-3 * by


def _along(axis: int) -> NumberKind:
    def scale(body: Any, factor: float) -> None:
        body.pos[axis] *= factor

    return NumberKind("m", "body", lambda m: m.body_pos[:, axis], scale, 0.05, fitted=False)


_SHAPE = {"of": "body", "prior": 0.2, "stated": True, "fitted": False, "held": True}
"""How a body's mass is spread: along an axis, or shifted along one in proportion to another"""
NUMBERS: Mapping[str, NumberKind] = {
    "joint stiffness": NumberKind(
        "N m/rad", "joint", lambda m: m.jnt_stiffness, _attribute("stiffness")
    ),
    "joint damping": NumberKind(
        "N m s/rad", "joint", _of_dof("dof_damping"), _attribute("damping"), 0.5, at_rest=False
    ),
    "joint friction": NumberKind(
        "N m", "joint", _of_dof("dof_frictionloss"), _attribute("frictionloss"), 0.5
    ),
    "friction near rest": NumberKind(
        "1/s", "joint", near_rest, scale_near_rest, 1.0, fitted=False, at_rest=False
    ),
    "armature": NumberKind(
        "kg m²", "joint", _of_dof("dof_armature"), _attribute("armature"), 0.5, at_rest=False
    ),
    "joint zero": _turned("ref", "qpos0", 2.0),
    "joint rest": _turned("springref", "qpos_spring", 3.0),
    **{f"joint axis {axis}": _leaning(n) for n, axis in enumerate("xyz")},
    "actuator gain": NumberKind("1", "actuator", gain, scale_gain, 0.5),
    "actuator damping": NumberKind(
        "s", "actuator", damping_time, scale_damping, 0.2, at_rest=False
    ),
    "actuator gear": NumberKind(
        "1", "actuator", lambda m: m.actuator_gear[:, 0], scale_gear, 0.1, fitted=False
    ),
    "tendon stiffness": NumberKind(
        "N/m", "tendon", lambda m: m.tendon_stiffness, _attribute("stiffness")
    ),
    "tendon damping": NumberKind(
        "N s/m", "tendon", lambda m: m.tendon_damping, _attribute("damping"), 0.5, at_rest=False
    ),
    "tendon friction": NumberKind(
        "N", "tendon", lambda m: m.tendon_frictionloss, _attribute("frictionloss"), 0.5
    ),
    "tendon rest length": NumberKind(
        "m",
        "tendon",
        lambda m: m.tendon_lengthspring[:, 0] * (m.tendon_stiffness > 0),
        _attribute("springlength"),
        0.02,
        stated=True,
        fitted=False,
    ),
    "tendon slack": NumberKind(
        "mm",
        "tendon",
        lambda m: 1e3 * m.tendon_lengthspring[:, 1] * (m.tendon_stiffness > 0),
        _loosen,
        0.3,
        added=True,
        stated=True,
        fitted=False,
    ),
    "moment arm": NumberKind(
        "m", "joint", moment_arm, scale_moment_arm, 0.01, fitted=False, compiled=True
    ),
    "motor constant": NumberKind("V s/rad", "actuator", of_motor(CONSTANT), scale_constant),
    "motor resistance": NumberKind("Ω", "actuator", of_motor(RESISTANCE), scale_resistance),
    "controller gain": NumberKind(
        "V/rad", "actuator", volts_per_error, scale_controller, fitted=False
    ),
    "voltage limit": NumberKind("V", "actuator", of_motor(LIMIT), scale_limit, fitted=False),
    "mass": NumberKind("kg", "body", lambda m: m.body_mass, weigh, 0.2),
    "body x": _along(0),
    "body y": _along(1),
    "body z": _along(2),
    **{f"body angle {axis}": _angled(n) for n, axis in enumerate("xyz")},
    **{f"centre of mass {axis}": _shifted("ipos", n) for n, axis in enumerate("xyz")},
    **{
        f"spread {axis}": NumberKind("m", read=spread_of(n), change=spread_along(n), **_SHAPE)
        for n, axis in enumerate("xyz")
    },
    **{
        f"shear {axes}": NumberKind(
            "1",
            read=lambda model: np.zeros(model.nbody),
            change=sheared("xyz".index(axes[0]), "xyz".index(axes[1])),
            added=True,
            **_SHAPE,
        )
        for axes in ("xy", "xz", "yz")
    },
    **{f"site {axis}": _shifted("pos", n) for n, axis in enumerate("xyz")},
    "load": NumberKind(
        *("kg", "site", lambda m: np.zeros(m.nsite), carry),
        **{"added": True, "fitted": False, "compiled": True, "uncertain": False},
    ),
}
"""Kinds of numbers by name"""


def numbers_of(model: mujoco.MjModel, number: str) -> np.ndarray:
    """The numbers of a kind, of all things that may have one."""
    return NUMBERS[number].read(model)


def names_of(model: mujoco.MjModel, number: str) -> list[str]:
    """Names of the things that may have a number of a kind; those without a name are numbered."""
    kind = NUMBERS[number].of
    count = {
        "body": model.nbody,
        "actuator": model.nu,
        "joint": model.njnt,
        "tendon": model.ntendon,
        "site": model.nsite,
    }[kind]
    return [getattr(model, kind)(n).name or f"number {n}" for n in range(count)]


def change_number(spec: mujoco.MjSpec, number: str, which: int, by: float) -> None:
    """Multiply a number of one thing of a spec by a factor, or add to one of a kind that is added to."""
    kind = NUMBERS[number]
    things = getattr(spec, _SEVERAL[kind.of])
    if kind.unit == _TURN and kind.of == "joint":
        slides = things[which].type == mujoco.mjtJoint.mjJNT_SLIDE
        by *= 1e-3 if slides else 1.0 if spec.compiler.degree else np.pi / 180
    kind.change(things[which], by)


def change_compiled(model: mujoco.MjModel, number: str, which: int, by: float) -> None:
    """Multiply a number of one thing of a compiled model by a factor, or add to one of a kind that is added
    to.
    """
    NUMBERS[number].change(model, which, by)
