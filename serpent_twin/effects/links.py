"""Find places in a spec."""

import mujoco
import numpy as np

from serpent_twin.arrays import Array

HELD = 1e-3
"""Time constant with which dry friction holds [s]; MuJoCo raises it to two time steps"""


def link_at(spec: mujoco.MjSpec, place: float) -> tuple[mujoco.MjsBody, float]:
    """The link at a distance from joint 1 along the straight arm [m], and where along it that is [m]; of a
    link that bends or twists, the half that holds the link's joint.
    """
    links = [body for body in spec.bodies if body.name.startswith("link")]
    begins = np.cumsum([0.0, *(link.pos[0] for link in links[1:])])
    at = max(place, 0.0)
    carrier = int(np.searchsorted(begins, at, side="right")) - 1
    return links[carrier], at - float(begins[carrier])


def last_joint(spec: mujoco.MjSpec) -> float:
    """Distance of the last joint from joint 1 along the straight arm [m]."""
    links = [body for body in spec.bodies if body.name.startswith("link")]
    return float(sum(link.pos[0] for link in links[1:]))


def body_at(spec: mujoco.MjSpec, name: str) -> tuple[mujoco.MjsBody, Array]:
    """The body of a name, or of the site of that name, and where in its frame that is [m], (3,)."""
    site = spec.site(name)
    return (site.parent, np.array(site.pos)) if site else (spec.body(name), np.zeros(3))


def joints_at(spec: mujoco.MjSpec, name: str) -> list[mujoco.MjsJoint]:
    """The joint of a name; without one, those whose names begin with `joint`, which are the arm's own hinges,
    or all hinges and slides of a model that names none so.
    """
    if name:
        return [each for each in spec.joints if each.name == name]
    kinds = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
    own = [each for each in spec.joints if each.name.startswith("joint")]
    return own or [each for each in spec.joints if each.type in kinds]


def add_to(spec: mujoco.MjSpec, field: str, at: str, value: float) -> None:
    """Add to a field of the joint or tendon of a name, or of all: `joint.damping.0` is the first number of
    their damping. Dry friction of a tendon, or at one joint, holds it still.
    """
    kind, name, *k = field.split(".")
    tendons = [each for each in spec.tendons if each.name == (at or each.name)]
    holds = name == "frictionloss" and bool(value) and (kind == "tendon" or bool(at))
    for thing in joints_at(spec, at) if kind == "joint" else tendons:
        if k:
            getattr(thing, name)[int(k[0])] += value
        else:
            setattr(thing, name, getattr(thing, name) + value)
        if holds:
            thing.solref_friction[0] = HELD
    if holds:
        let_rub(spec)


def let_rub(spec: mujoco.MjSpec) -> None:
    """Let dry friction act in a model that has constraints turned off, and no other constraint."""
    off = mujoco.mjtDisableBit
    if spec.option.disableflags & off.mjDSBL_CONSTRAINT:
        spec.option.disableflags &= ~int(off.mjDSBL_CONSTRAINT)
        spec.option.disableflags |= int(off.mjDSBL_EQUALITY | off.mjDSBL_LIMIT | off.mjDSBL_CONTACT)
    spec.option.disableflags &= ~int(off.mjDSBL_FRICTIONLOSS)


def let_hold(spec: mujoco.MjSpec, joint: str) -> None:
    """Let dry friction hold a joint of a model still."""
    let_rub(spec)
    spec.joint(joint).solref_friction[0] = HELD
