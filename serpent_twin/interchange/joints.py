"""List the numbers of a twin's joints and of what drives them, and what no list of such numbers expresses."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.interchange.exported import Exported, Given, noted
from serpent_twin.machines.model.drive_table import read_drives
from serpent_twin.machines.model.springs import drives_on, single_joints

_JOINT = mujoco.mjtTrn.mjTRN_JOINT
_ROUNDED = 1e-9
"""Below this, a number is what arithmetic leaves of nothing"""


@dataclass(frozen=True)
class JointDrive:
    """One joint, and the actuator that drives it. At a slide, torques are in N, angles in m."""

    joint: str
    actuator: str
    stiffness: float
    """Torque per error of the position that it is told; 0 if told a torque or a speed [N m/rad]"""
    damping: float
    """[N m s/rad]"""
    told: str
    """What its command is: position, velocity or effort"""
    effort_limit: float
    """[N m]; infinite without one"""
    armature: float
    """[kg m²]"""
    friction: float
    """Coulomb friction of the joint [N m]"""
    viscous: float
    """Viscous friction of the joint [N m s/rad]"""
    delay: float
    """Delay of commands [s]"""
    zero: float
    """Position, speed or torque that a command of 0 asks for"""
    scale: float
    """Position, speed or torque per unit of the command"""

    def steps_late(self, timestep: float) -> int:
        """The delay in whole time steps."""
        return round(self.delay / timestep)


def joint_drives(given: Given) -> list[JointDrive]:
    """The drives of single joints, whose torque is affine in command, position and speed."""
    model = given.model
    found = [
        _drive(model, int(n), a) for n in single_joints(model) for a in drives_on(model, "joint", n)
    ]
    if not found:
        raise SerpentError(
            f"{given.xml}: no actuator drives a single joint by a command, as a servo or a motor does; there "
            "is nothing to export. Use --to mjcf or --to urdf."
        )
    return found


def configurations(given: Given, head: str, group: Callable[[JointDrive, int], str]) -> Exported:
    """A Python module with one configuration an actuator, made of a drive and the time steps it is late."""
    lacks, step = tuple(beside_drives(given)), float(given.model.opt.timestep)
    groups = "".join(group(each, each.steps_late(step)) for each in joint_drives(given))
    said = {"name": given.name, "notes": noted(lacks), "step": step, "groups": groups}
    return Exported(head.format(**said), lacks)


def _drive(model: mujoco.MjModel, joint: int, actuator: int) -> JointDrive:
    gear, dof = model.actuator_gear[actuator, 0], int(model.jnt_dofadr[joint])
    gain, bias = model.actuator_gainprm[actuator, 0], model.actuator_biasprm[actuator]
    stiffness, damping = -bias[1] * gear**2, -bias[2] * gear**2
    told = "position" if bias[1] else "velocity" if bias[2] else "effort"
    unit = {"position": stiffness, "velocity": damping, "effort": 1.0}[told]
    on_joint = (model.actuator_trntype == _JOINT) & (model.actuator_trnid[:, 0] == joint)
    reflected = on_joint * model.actuator_gear[:, 0] ** 2
    return JointDrive(
        joint=model.joint(joint).name,
        actuator=model.actuator(actuator).name,
        stiffness=float(stiffness),
        damping=float(damping),
        told=told,
        effort_limit=float(effort_limit(model, joint, actuator)),
        armature=float(model.dof_armature[dof] + reflected @ model.actuator_armature),
        friction=float(model.dof_frictionloss[dof]),
        viscous=float(model.dof_damping[dof] + reflected @ model.actuator_damping),
        delay=float(model.actuator_delay[actuator]),
        zero=float(bias[0] * gear / unit),
        scale=float(gain * gear / unit),
    )


def effort_limit(model: mujoco.MjModel, joint: int, actuator: int) -> float:
    """The largest torque of an actuator at its joint."""
    least = np.inf
    if model.actuator_forcelimited[actuator]:
        gear = abs(model.actuator_gear[actuator, 0])
        least = gear * np.abs(model.actuator_forcerange[actuator]).max()
    if model.jnt_actfrclimited[joint]:
        least = min(least, np.abs(model.jnt_actfrcrange[joint]).max())
    return least


def beside_drives(given: Given) -> Iterator[str]:
    """Sentences on what of a twin no list of joint drives expresses."""
    model = given.model
    drives = joint_drives(given)
    if given.beside:
        yield f"effects that only twin.json has: {', '.join(given.beside)}"
    if late := _named(model, "sensor", model.sensor_delay > 0):
        yield f"late readings of the sensors {late}: delay the observations by as much"
    for each in drives:
        yield from _of_drive(model, each)
    listed = {each.actuator for each in drives}
    if others := [a for a in (model.actuator(n).name for n in range(model.nu)) if a not in listed]:
        yield f"actuators that drive no single joint by an affine law: {', '.join(others)}"
    if springs := _named(
        model, "joint", (model.jnt_stiffness != 0) | model.jnt_stiffnesspoly.any(1)
    ):
        yield f"springs of the joints {springs}"
    if curved := _named_by_dof(model, model.dof_dampingpoly.any(axis=1)):
        yield f"damping of the joints {curved} that is not in proportion to the speed"
    if model.ntendon:
        yield f"{model.ntendon} tendons"


def _of_drive(model: mujoco.MjModel, drive: JointDrive) -> Iterator[str]:
    """Sentences on what of a drive is no number of it."""
    n, name, table = model.actuator(drive.actuator).id, drive.actuator, read_drives(model)
    if model.actuator_dyntype[n] != mujoco.mjtDyn.mjDYN_NONE:
        yield f"the dynamics of {name}, of {model.actuator_dynprm[n, 0]:.4g} s: filter what it is told"
    if abs(drive.scale - 1) > _ROUNDED or abs(drive.zero) > _ROUNDED:
        yield (
            f"the {drive.told} that {name} is told: command {drive.scale:.6g} × what the twin is told "
            f"{drive.zero:+.6g}"
        )
    if model.actuator_ctrllimited[n]:
        low, high = drive.scale * model.actuator_ctrlrange[n] + drive.zero
        yield f"the range of the {drive.told} that {name} obeys: clip it to {low:.6g} … {high:.6g}"
    low, high = model.actuator_forcerange[n]
    if model.actuator_forcelimited[n] and low != -high:
        yield f"that {name} gives less one way: {low:g} … {high:g} before its gear"
    step = model.opt.timestep
    if abs(late := drive.delay - drive.steps_late(step) * step) > _ROUNDED:
        yield (
            f"{1e3 * late:+.3g} ms of the delay of {name}, {1e3 * drive.delay:.4g} ms, which is no whole "
            f"number of time steps of {1e3 * step:.4g} ms"
        )
    if table is not None and n < len(table.inside) and table.beside and not table.inside[n]:
        yield f"the scale and zero of {name}, which only twin.json has"


def _named(model: mujoco.MjModel, kind: str, which: np.ndarray) -> str:
    """Names of some things of a kind."""
    return ", ".join(
        getattr(model, kind)(int(n)).name or f"number {n}" for n in np.flatnonzero(which)
    )


def _named_by_dof(model: mujoco.MjModel, which: np.ndarray) -> str:
    """Names of the joints of some degrees of freedom."""
    joints = np.unique(model.dof_jntid[which])
    return ", ".join(model.joint(int(n)).name or f"number {n}" for n in joints)
