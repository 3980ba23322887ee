"""Say how forces on its links change the arm's pose and its motors' loads, where motors hold their angles."""

from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arm.mjcf import JOINTS, STRANDS
from serpent_twin.arrays import Array, cross
from serpent_twin.engine.stepper import addresses
from serpent_twin.sim.pushes import links_and_base

_LONGEST = 0.1  # [rad] of a Newton step
_STEPS = 12
_SETTLED = 1e-5  # [N m]
_SOFT = 1e-4  # [N m/rad]: what holds a joint at least, while its pose is sought
_LATER = np.tri(N_JOINTS, dtype=bool).T
_PLAY = 0.02  # [N m/rad]: and against further forces: with slack cables, it turns a little only


@dataclass(frozen=True)
class StretchedStrands:
    """The cables' strands at an instant, in the order of `mjcf.STRANDS`."""

    stretch: Array
    """Beyond their rest lengths, negative where slack [m], (20,)"""
    stiffness: Array
    """[N/m], (20,)"""
    bend: Array
    """How they stiffen [N/m²], (20,)"""
    reach: Array
    """Moment arms of the winches [m], (10,)"""

    def tension(self, stretch: Array) -> Array:
        """Tension of each strand at any stretch [N], (20,)."""
        pulled = np.maximum(stretch, 0.0)
        return (self.stiffness + self.bend * pulled) * pulled

    def slope(self, stretch: Array) -> Array:
        """Derivative of each strand's tension by its stretch [N/m], (20,)."""
        return (self.stiffness + 2 * self.bend * stretch) * (stretch > 0)

    def winches(self, tension: Array) -> Array:
        """Torques of tensions at the winches [N m], (10, …), of tensions (20, …)."""
        reach = self.reach.reshape(-1, *(1,) * (tension.ndim - 1))
        return reach * (tension[0::2] - tension[1::2])


@dataclass(frozen=True)
class Pushed:
    """How the arm answers to a force on any one of its links, at the pose that holds a first one."""

    turned: Array
    """Change of the joint angles by the first force [rad], (9,)"""
    load: Array
    """Change of the motors' loads by the first force, (10,), in N m or as shares of the stall torque"""
    turning: Array
    """Change of the joints by a further force on each link [rad/N], (9 links, 9, 3)"""
    slope: Array
    """Change of the motors' loads by it [1/N], (9 links, 10, 3)"""


@dataclass(frozen=True)
class _Levers:
    """The arm's geometry at a pose, in the world's frame."""

    axis: Array
    """Axes of the joints, (9, 3)"""
    links: Array
    """Velocity of each link's centre of mass by each joint's [m], (9, 3, 9)"""
    mass: Array
    """Velocity of the common centre of mass by each joint's, times the whole mass [kg m], (3, 9)"""

    def bends(self, moved: Array, force: Array) -> Array:
        """Change of the joints' torques by their angles [N m/rad], (9, 9), as a force [N], (3,), keeps its
        direction and what it pulls at moves by (3, 9) [m].
        """
        each = cross(force, self.axis) @ moved
        return np.where(_LATER, each, each.T)


class PushedStatics:
    """The statics of an arm whose motors hold their angles, pushed at the centre of mass of a link.

    Torques of cables, gravity and springs balance those of the force: Newton's method from a pose that the
    twin is in, so that whatever moves there goes on moving. Dry friction of hinges is left out: it takes up
    0.005 N m at each joint. The jaw turns along with its cable.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """`model` is that of an arm without motors."""
        self._model, self._data = model, mujoco.MjData(model)
        self._q, self._v = addresses(model, JOINTS)
        self._joints = [model.joint(name).id for name in JOINTS]
        self._links, self._base, base = links_and_base(model)
        self._spring, self._rest = model.jnt_stiffness[self._joints], model.qpos_spring[self._q]
        self._in_world = base.as_matrix()
        strands = [model.tendon(name).id for name in STRANDS]
        none = self._lengths(np.zeros(N_JOINTS))
        by_joint = [self._lengths(one) - none for one in np.eye(N_JOINTS)]
        self._winding = np.stack(by_joint, axis=1)[strands]  # [m/rad], (20, 9): pulleys are round
        self._winding[-2:] = 0.0  # the jaw's

    def answers(
        self, joint_angle: Array, strands: StretchedStrands, link: int, force: Array
    ) -> Pushed:
        """How the arm at joint angles [rad], (9,), answers to a force on a link, 1 … 9, in the base frame
        [N], (3,), and to further ones; loads in N m.
        """
        at, stretch, levers = joint_angle, strands.stretch, self._levers(joint_angle)
        held, tension, push = (
            self._held(at, levers),
            strands.tension(stretch),
            self._in_world @ force,
        )
        for _ in range(_STEPS * bool(force.any())):
            taken = self._winding.T @ (strands.tension(stretch) - tension)
            left = self._held(at, levers) - held - taken + levers.links[link - 1].T @ push
            if np.abs(left).max() < _SETTLED:
                break
            held_by = self._stiffness(strands.slope(stretch), levers, link, push)
            step = np.linalg.solve(held_by + _SOFT * np.eye(N_JOINTS), left)
            at = at + step * min(1.0, _LONGEST / np.abs(step).max())
            stretch, levers = strands.stretch + self._winding @ (at - joint_angle), self._levers(at)
        pulled = strands.slope(stretch)
        held_by = self._stiffness(pulled, levers, link, push) + _PLAY * np.eye(N_JOINTS)
        turning = np.linalg.inv(held_by) @ np.swapaxes(levers.links, 1, 2) @ self._in_world
        return Pushed(
            turned=at - joint_angle,
            load=strands.winches(strands.tension(stretch) - tension),
            turning=turning,
            slope=strands.winches(pulled[:, None] * self._winding) @ turning,
        )

    def _stiffness(self, strand: Array, levers: _Levers, link: int, push: Array) -> Array:
        """What holds the joints [N m/rad], (9, 9), with strands of so many N/m, (20,), against a force."""
        gravity = levers.bends(levers.mass, self._model.opt.gravity)
        pushed = levers.bends(levers.links[link - 1], push)
        cables = self._winding.T @ (strand[:, None] * self._winding)
        return cables + np.diag(self._spring) - gravity - pushed

    def _held(self, joint_angle: Array, levers: _Levers) -> Array:
        """Torques of gravity and springs at joint angles [N m], (9,)."""
        return levers.mass.T @ self._model.opt.gravity - self._spring * (joint_angle - self._rest)

    def _levers(self, joint_angle: Array) -> _Levers:
        self._put(joint_angle)
        model, data = self._model, self._data
        found, links = np.empty((3, model.nv)), np.empty((N_JOINTS, 3, N_JOINTS))
        for n, link in enumerate(self._links):
            mujoco.mj_jacBodyCom(model, data, found, None, link)
            links[n] = found[:, self._v]
        mujoco.mj_jacSubtreeCom(model, data, found, self._base)
        mass = model.body_subtreemass[self._base] * found[:, self._v]
        return _Levers(data.xaxis[self._joints], links, mass)

    def _lengths(self, joint_angle: Array) -> Array:
        self._put(joint_angle)
        mujoco.mj_tendon(self._model, self._data)
        return self._data.ten_length.copy()

    def _put(self, joint_angle: Array) -> None:
        self._data.qpos[:] = 0.0
        self._data.qpos[self._q] = joint_angle
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
