"""Say how forces on its links change the arm's pose and its motors' loads, where motors hold their angles."""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arm.mjcf import JOINTS, STRANDS
from serpent_twin.arrays import Array
from serpent_twin.sim.stepper import addresses

_STEP = 1e-5  # [rad]
_LONGEST = 0.1  # [rad] of a Newton step
_STEPS = 12
_SETTLED = 1e-4  # [N m]
_SOFT = 0.05  # [N m/rad]: what holds a joint at least, so that a slack cable leaves no pose undetermined


@dataclass(frozen=True)
class Strands:
    """The cables' strands at an instant, in the order of `mjcf.STRANDS`."""

    stretch: Array
    """Beyond their rest lengths, negative where slack [m], (20,)"""
    stiffness: Array
    """[N/m], (20,)"""
    bend: Array
    """How they stiffen [N/m²], (20,)"""
    reach: Array
    """Of the winches [m], (10,)"""

    def tension(self, stretch: Array) -> Array:
        """At any stretch [N], (20,)."""
        pulled = np.maximum(stretch, 0.0)
        return (self.stiffness + self.bend * pulled) * pulled

    def slope(self, stretch: Array) -> Array:
        """Of the tension by the stretch [N/m], (20,)."""
        return (self.stiffness + 2 * self.bend * stretch) * (stretch > 0)

    def winches(self, tension: Array) -> Array:
        """Torques of tensions at the winches [N m], (10, …), of tensions (20, …)."""
        reach = self.reach.reshape(-1, *(1,) * (tension.ndim - 1))
        return reach * (tension[0::2] - tension[1::2])


@dataclass(frozen=True)
class Pushed:
    """How the arm answers to a force on any one of its links, at the pose that holds a first one."""

    turned: Array
    """By how much that first force turned the joints [rad], (9,)"""
    load: Array
    """And changed the motors' loads, (10,), in N m or as shares of the stall torque"""
    turning: Array
    """Change of the joints by a further force on each link [rad/N], (9 links, 9, 3)"""
    slope: Array
    """Change of the motors' loads by it [1/N], (9 links, 10, 3)"""


class PushedStatics:
    """The statics of an arm whose motors hold their angles, pushed at the centre of mass of a link.

    Torques of cables, gravity and springs balance those of the force: Newton's method from a pose that the
    twin is in, so that whatever moves there goes on moving. Dry friction of hinges is left out: it takes up
    0.005 N m at each joint.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """`model` is that of an arm without motors."""
        self._model, self._data = model, mujoco.MjData(model)
        self._q, self._v = addresses(model, JOINTS)
        joints = [model.joint(name).id for name in JOINTS]
        self._spring, self._rest = model.jnt_stiffness[joints], model.qpos_spring[self._q]
        self._links, self._gravity = model.jnt_bodyid[joints], np.zeros(model.nv)
        base = model.body_parentid[self._links[0]]
        self._to_base = (
            Rotation.from_quat(model.body_quat[base], scalar_first=True).inv().as_matrix()
        )
        self._strands = [model.tendon(name).id for name in STRANDS]
        none = np.zeros(N_JOINTS)
        self._winding = np.stack(
            [self._lengths(one) - self._lengths(none) for one in np.eye(N_JOINTS)], axis=1
        )  # [m/rad], (20, 9): pulleys are round

    def answers(self, joint_angle: Array, strands: Strands, link: int, force: Array) -> Pushed:
        """How the arm at joint angles [rad], (9,), answers to a force on a link, 1 … 9, in the base frame
        [N], (3,), and to further ones; loads in N m.
        """
        at, stretch = joint_angle, strands.stretch
        held, tension = self._held(at), strands.tension(stretch)
        levers, stiffness = self._levers(at), self._stiffness(at, strands, stretch)
        for _ in range(_STEPS * bool(force.any())):
            taken = self._winding.T @ (strands.tension(stretch) - tension)
            left = self._held(at) - held - taken + levers[link - 1].T @ force
            if np.abs(left).max() < _SETTLED:
                break
            step = np.linalg.solve(stiffness, left)
            at = at + step * min(1.0, _LONGEST / np.abs(step).max())
            stretch = strands.stretch + self._winding @ (at - joint_angle)
            levers, stiffness = self._levers(at), self._stiffness(at, strands, stretch)
        by_torque = np.linalg.inv(stiffness)
        turning = np.einsum("ab,lxb->lax", by_torque, levers)
        pulled = strands.slope(stretch)[:, None] * self._winding
        by_angle = strands.winches(pulled)
        return Pushed(
            turned=at - joint_angle,
            load=strands.winches(strands.tension(stretch) - tension),
            turning=turning,
            slope=by_angle @ turning,
        )

    def _levers(self, joint_angle: Array) -> Array:
        """Velocity of each link's centre of mass by each joint's, in the base frame [m], (9, 3, 9)."""
        self._put(joint_angle)
        out = np.empty((N_JOINTS, 3, N_JOINTS))
        found = np.empty((3, self._model.nv))
        for n, link in enumerate(self._links):
            mujoco.mj_jacBodyCom(self._model, self._data, found, None, link)
            out[n] = self._to_base @ found[:, self._v]
        return out

    def _stiffness(self, joint_angle: Array, strands: Strands, stretch: Array) -> Array:
        """What holds the joints [N m/rad], (9, 9)."""
        here = self._held(joint_angle)
        steps = [self._held(joint_angle + _STEP * one) - here for one in np.eye(N_JOINTS)]
        by_strand = strands.slope(stretch)[:, None] * self._winding
        held = self._winding.T @ by_strand - np.stack(steps, axis=1) / _STEP
        return held + _SOFT * np.eye(N_JOINTS)

    def _held(self, joint_angle: Array) -> Array:
        """Torques of gravity and springs at joint angles [N m], (9,)."""
        self._put(joint_angle)
        mujoco.mj_rne(self._model, self._data, 0, self._gravity)
        return -self._gravity[self._v] - self._spring * (joint_angle - self._rest)

    def _lengths(self, joint_angle: Array) -> Array:
        self._put(joint_angle)
        mujoco.mj_tendon(self._model, self._data)
        return self._data.ten_length[self._strands]

    def _put(self, joint_angle: Array) -> None:
        self._data.qpos[:] = 0.0
        self._data.qpos[self._q] = joint_angle
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
