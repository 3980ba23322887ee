"""Look up the things of a model that a machine.toml names."""

import mujoco
import numpy as np

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.units import TO_SI

OBJECTS = {
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "body": mujoco.mjtObj.mjOBJ_BODY,
}
"""MuJoCo's kinds of what has a name"""
_JOINTS = {
    mujoco.mjtJoint.mjJNT_FREE: "free",
    mujoco.mjtJoint.mjJNT_BALL: "ball",
    mujoco.mjtJoint.mjJNT_SLIDE: "slide",
    mujoco.mjtJoint.mjJNT_HINGE: "hinge",
}
_SENSED = {
    ("m",): "RANGEFINDER TENDONPOS FRAMEPOS SUBTREECOM GEOMDIST GEOMFROMTO",
    ("m/s",): "VELOCIMETER FRAMELINVEL SUBTREELINVEL",
    ("rad/s",): "GYRO BALLANGVEL FRAMEANGVEL",
    ("m/s²",): "ACCELEROMETER FRAMELINACC",
    ("N",): "TOUCH FORCE",
    ("N m",): "TORQUE",
    ("T", "1"): "MAGNETOMETER",
    ("1",): "FRAMEXAXIS FRAMEYAXIS FRAMEZAXIS GEOMNORMAL",
}
"""MuJoCo's sensors by the SI units of what they read; of others, it follows from what they are at"""
_SENSOR_UNITS = {
    int(getattr(mujoco.mjtSensor, f"mjSENS_{name}")): units
    for units, several in _SENSED.items()
    for name in several.split()
}


def names(model: mujoco.MjModel, kind: mujoco.mjtObj) -> list[str]:
    """The names of a model's things of a kind."""
    count = {
        mujoco.mjtObj.mjOBJ_ACTUATOR: len(model.actuator_trntype),
        mujoco.mjtObj.mjOBJ_SITE: model.nsite,
        mujoco.mjtObj.mjOBJ_JOINT: model.njnt,
        mujoco.mjtObj.mjOBJ_TENDON: model.ntendon,
        mujoco.mjtObj.mjOBJ_SENSOR: model.nsensor,
        mujoco.mjtObj.mjOBJ_BODY: model.nbody,
        mujoco.mjtObj.mjOBJ_KEY: model.nkey,
    }[kind]
    return [mujoco.mj_id2name(model, kind, n) or "" for n in range(count)]


def unknown(name: str, model: mujoco.MjModel, kind: mujoco.mjtObj) -> str:
    """What is wrong with a name that a model lacks."""
    there = [each for each in names(model, kind) if each]
    listed = stored.names(there, 40) if there else "none that has a name"
    return f"is {name!r}, which the model lacks; there are: {listed}."


def wrong_unit(unit: str, allowed: tuple[str, ...], kind: str, name: str) -> str:
    """What is wrong with a unit, if its SI unit is none of those allowed; else nothing."""
    is_in = TO_SI[unit][1]
    told = f"is {unit!r}, of {is_in}; {kind} {name!r} is in {' or '.join(allowed)}."
    return "" if is_in in allowed else told


def lengths(model: mujoco.MjModel, kind: str, name: str) -> tuple[str, ...]:
    """SI units of a joint's or tendon's length; a tendon along joints alone may be an angle."""
    if kind == "joint":
        return ("m",) if joint_type(model, name) == "slide" else ("rad",)
    first = model.wrap_type[model.tendon_adr[model.tendon(name).id]]
    return ("m", "rad") if first == mujoco.mjtWrap.mjWRAP_JOINT else ("m",)


def speeds(model: mujoco.MjModel, joint: str) -> tuple[str, ...]:
    """SI units of the velocity of a hinge or slide."""
    return tuple(f"{unit}/s" for unit in lengths(model, "joint", joint))


def sensor_units(model: mujoco.MjModel, name: str, usual: tuple[str, ...]) -> tuple[str, ...]:
    """SI units of what a sensor of the model reads; the usual ones where MuJoCo does not say."""
    sensor = model.sensor(name)
    kind, at = int(sensor.type[0]), int(sensor.objid[0])
    if kind == mujoco.mjtSensor.mjSENS_JOINTPOS:
        return lengths(model, "joint", model.joint(at).name)
    if kind == mujoco.mjtSensor.mjSENS_JOINTVEL:
        return speeds(model, model.joint(at).name)
    return _SENSOR_UNITS.get(kind, usual)


def joint_type(model: mujoco.MjModel, name: str) -> str:
    """Type of a joint: free, ball, slide or hinge."""
    return _JOINTS[mujoco.mjtJoint(int(model.joint(name).type[0]))]


def not_single(model: mujoco.MjModel, name: str) -> str:
    """What a joint is that has more than one angle or length; else nothing."""
    kind = joint_type(model, name)
    return f"a {kind} joint" if kind in ("free", "ball") else ""


def acts_on(model: mujoco.MjModel, actuator: str | int) -> tuple[str, str]:
    """Kind and name of the joint or tendon that an actuator moves; nothing for another thing."""
    n = model.actuator(actuator).id
    target = int(model.actuator_trnid[n, 0])
    match model.actuator_trntype[n]:
        case mujoco.mjtTrn.mjTRN_TENDON:
            return "tendon", model.tendon(target).name
        case mujoco.mjtTrn.mjTRN_JOINT | mujoco.mjtTrn.mjTRN_JOINTINPARENT:
            return "joint", model.joint(target).name
    return "", ""


def winding(model: mujoco.MjModel) -> set[str]:
    """Names of the joints that a tendon is wound by: those of tendons along joints."""
    wrapped = model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_JOINT]
    return {model.joint(int(n)).name for n in wrapped}


def joints_moving(model: mujoco.MjModel, body: int) -> set[int]:
    """Joints that move a body: its own, and those of the bodies that it is on."""
    found = set[int]()
    while body:
        found |= set(np.flatnonzero(model.jnt_bodyid == body).tolist())
        body = int(model.body_parentid[body])
    return found


def tendon_levers(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Change of the length of each tendon with the degrees of freedom, (ntendon, nv), in a pose of which
    MuJoCo has computed the positions.
    """
    out = np.zeros((model.ntendon, model.nv))
    for n, (first, count) in enumerate(zip(model.ten_J_rowadr, model.ten_J_rownnz, strict=True)):
        some = slice(first, first + count)
        out[n, model.ten_J_colind[some]] = data.ten_J[some]
    return out


def chain_ends(model: mujoco.MjModel, data: mujoco.MjData) -> list[int]:
    """Sites on the last body of each chain, each the one that is farthest from its joint, as of a tool; sites
    through which tendons run are none.
    """
    rigid = model.body_weldid
    carries = {int(rigid[model.body_parentid[n]]) for n in range(model.nbody) if rigid[n] == n}
    through = model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE]
    farthest: dict[int, tuple[float, int]] = {}
    for n in range(model.nsite):
        part = int(rigid[model.site_bodyid[n]])
        if model.site(n).name and part not in carries and n not in through:
            away = float(np.linalg.norm(data.site_xpos[n] - data.xpos[part]))
            farthest[part] = max(farthest.get(part, (0.0, n)), (away, n))
    return [n for _, n in farthest.values()]
