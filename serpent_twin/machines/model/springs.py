"""Read what pulls in a model, and let it lengthen and soften: tendons, springs and drives of joints."""

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import in_a_row

_SINGLE = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
_TRANSMISSION = {"tendon": mujoco.mjtTrn.mjTRN_TENDON, "joint": mujoco.mjtTrn.mjTRN_JOINT}
_Places = NDArray[np.intp] | slice
_Kept = tuple[Array, _Places, Array, _Places]
"""A field of all runs, its columns, their values in the model, and the springs that they are of"""


class Springs:
    """K springs of n runs side by side, by kind and name: tendons with their own springs and the drives on
    them, then springs of joints and drives of joints.

    A drive that sets a position pulls by k (length − what it is told), as a spring of stiffness k. What does
    not grow with the length, such as the force of a motor, it is told to pull besides.
    """

    def __init__(self, batch: Batch, several: Sequence[tuple[str, str]]) -> None:
        model, n_runs, self._batch = batch.model, len(batch.bind("qpos")), batch
        tendons = [model.tendon(name).id for kind, name in several if kind == "tendon"]
        joints = [_joint(model, *each) for each in several if each[0] != "tendon"]
        self._count = len(tendons)
        self._tendons, self._at = _columns(tendons), in_a_row(model.jnt_qposadr[joints])
        self._lengths, self._qpos = batch.bind("ten_length"), batch.bind("qpos")
        self._arms = batch.bind("ten_J")
        self._entries, self._passed = _passed(model, tendons)
        self._dofs = model.jnt_dofadr[joints]
        self._spring, self._rest = np.zeros((2, n_runs, len(several)))
        self._shifted: list[_Kept] = []
        self._scaled: list[_Kept] = []
        own = [k for k, n in enumerate(tendons) if model.tendon_stiffness[n]]
        self._own("tendon", "tendon_lengthspring", own, [tendons[k] for k in own])
        own = [k for k, (kind, _) in enumerate(several) if kind == "joint"]
        self._own("jnt", "qpos_spring", own, [joints[k - self._count] for k in own])
        drives = [(k, a) for k, each in enumerate(several) for a in _drives(model, *each)]
        self._pulled, self._drives = [k for k, _ in drives], [a for _, a in drives]
        self._gear = model.actuator_gear[self._drives, 0].copy()
        self._gain = batch.expand("actuator_gainprm")[:, self._drives, 0].copy()
        self._bias = batch.expand("actuator_biasprm")[:, self._drives, :3].copy()
        self._servo = model.actuator_biasprm[self._drives, 1] != 0
        self.stiffness: Array = self._spring.copy()
        """Stiffness of all that pulls in each place [N/m or N m/rad], (n, K)"""
        for k, gear, bias in zip(self._pulled, self._gear, self._bias[..., 1].T, strict=True):
            self.stiffness[:, k] -= bias * gear**2
        self.limits = np.array([self._limits(tendons, k) for k in range(len(several))])
        """Least and most that each pulls [N or N m], (2, K)"""
        self.limits = self.limits.reshape(-1, 2).T
        self._stiff = np.where(self.stiffness, self.stiffness, np.inf)
        self._control, self._state = batch.bind("ctrl"), batch.bind("act")
        fields = ("actuator_gainprm", "actuator_biasprm") if self._servo.any() else ()
        self._told_by = [batch.expand(each) for each in fields]

    def _own(self, of: str, shifted: str, k: list[int], which: list[int]) -> None:
        """Take the springs of tendons or joints that have one."""
        if not k:
            return
        at = self._batch.model.jnt_qposadr[which].tolist() if of == "jnt" else which
        fields = (shifted, at), (f"{of}_stiffness", which), (f"{of}_stiffnesspoly", which)
        kept = [_kept(self._batch, field, columns, k) for field, columns in fields]
        self._shifted.append(kept[0])
        self._scaled += kept[1:]
        rest, stiffness = kept[0][2], kept[1][2]
        self._rest[:, k] = rest[..., -1] if rest.ndim > 2 else rest
        self._spring[:, k] = stiffness.reshape(-1, len(k))

    def _limits(self, tendons: list[int], k: int) -> tuple[float, float]:
        model, on = self._batch.model, [n for n, of in enumerate(self._pulled) if of == k]
        if self._spring[:, k].any():
            ends = model.tendon_lengthspring[tendons[k]] if k < self._count else (0.0, 0.0)
            return (0.0, np.inf) if ends[0] < ends[1] else (-np.inf, np.inf)
        if len(on) != 1:
            return -np.inf, np.inf
        force = _range(model, "force", self._drives[on[0]]) * -self._gear[on[0]]
        return float(force.min()), float(force.max())

    def levers(self) -> Array:
        """Change of the tendons' lengths with each degree of freedom, (n, L, nv)."""
        out = np.zeros((len(self._arms), self._count, self._batch.model.nv))
        out[:, self._passed[0], self._passed[1]] = self._arms[:, self._entries]
        return out

    def state(self, rates: Array) -> tuple[Array, Array]:
        """Stretch of each spring beyond its rest [m or rad], and the pull of drives that no length changes
        [N or N m], (n, K) each, at rates of all joints, (n, nv).
        """
        tendons = self._lengths[:, self._tendons]
        length = np.concatenate([tendons, self._qpos[:, self._at]], axis=1)
        pull, besides = self._spring * (length - self._rest), np.zeros_like(length)
        if not self._drives:
            return pull / self._stiff, besides
        rate = np.einsum("nlv,nv->nl", self.levers(), rates)
        rate = np.concatenate([rate, rates[:, self._dofs]], axis=1)
        for n, (k, a) in enumerate(zip(self._pulled, self._drives, strict=True)):
            gear, bias = self._gear[n], self._bias[:, n]
            moved = gear * (bias[:, 1] * length[:, k] + bias[:, 2] * rate[:, k])
            force = self._gain[:, n] * self._told(a) + bias[:, 0] + moved
            if self._servo[n]:
                pull[:, k] -= gear * force
            else:
                besides[:, k] -= gear * np.clip(force, *_range(self._batch.model, "force", a))
        return pull / self._stiff, besides

    def _told(self, actuator: int) -> Array:
        """What an actuator is told, after its own dynamics."""
        model = self._batch.model
        if several := model.actuator_actnum[actuator]:
            return self._state[:, model.actuator_actadr[actuator] + several - 1]
        return np.clip(self._control[:, actuator], *_range(model, "ctrl", actuator))

    def write(self, slack: Array, stiffness: Array) -> None:
        """Let each be longer by a slack [m or rad], and of another stiffness, (n, K) each."""
        has = self.stiffness != 0
        share = np.where(has, stiffness, 1.0) / np.where(has, self.stiffness, 1.0)
        for field, at, base, k in self._shifted:
            field[:, at] = base + slack[:, k].reshape(*base.shape[:2], *(1,) * (base.ndim - 2))
        for field, at, base, k in self._scaled:
            field[:, at] = base * share[:, k].reshape(*base.shape[:2], *(1,) * (base.ndim - 2))
        if not self._told_by:
            return
        gains, biases = self._told_by
        for n, (k, a) in enumerate(zip(self._pulled, self._drives, strict=True)):
            bias, gear = self._bias[:, n], self._gear[n]
            own = np.where(bias[:, 1] != 0, share[:, k], 1.0)
            gains[:, a, 0] = own * self._gain[:, n]
            biases[:, a, 0] = own * (bias[:, 0] - bias[:, 1] * gear * slack[:, k])
            biases[:, a, 1] = own * bias[:, 1]


def drives_on(model: mujoco.MjModel, kind: str, which: int) -> list[int]:
    """The actuators on a joint or a tendon whose force is affine in what they are told and in its length."""
    affine = (model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED) & np.isin(
        model.actuator_biastype, (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
    )
    there = (model.actuator_trntype == _TRANSMISSION[kind]) & (model.actuator_trnid[:, 0] == which)
    return np.flatnonzero(affine & there).tolist()


def single_joints(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Hinges and slides."""
    return np.flatnonzero(np.isin(model.jnt_type, _SINGLE))


def _columns(several: Sequence[int]) -> _Places:
    """Columns as a slice, where they can be."""
    return in_a_row(np.array(several, np.intp))


def _joint(model: mujoco.MjModel, kind: str, name: str) -> int:
    """The joint that a spring or a drive is of."""
    return int(model.actuator(name).trnid[0]) if kind == "drive" else model.joint(name).id


def _drives(model: mujoco.MjModel, kind: str, name: str) -> list[int]:
    """The actuators that are part of a spring."""
    if kind == "tendon":
        return drives_on(model, kind, model.tendon(name).id)
    return [model.actuator(name).id] if kind == "drive" else []


def _passed(
    model: mujoco.MjModel, tendons: Sequence[int]
) -> tuple[NDArray[np.intp], tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Where the levers of tendons are in MuJoCo's Jacobian, and of which tendon and degree of freedom."""
    firsts, counts = model.ten_J_rowadr[tendons], model.ten_J_rownnz[tendons]
    spans = [np.arange(n, n + count) for n, count in zip(firsts, counts, strict=True)]
    entries = np.concatenate([np.zeros(0, np.intp), *spans]).astype(np.intp)
    of = np.repeat(np.arange(len(tendons), dtype=np.intp), counts)
    return entries, (of, model.ten_J_colind[entries].astype(np.intp))


def _kept(batch: Batch, field: str, which: list[int], k: list[int]) -> _Kept:
    """A field of some things in all runs, to be written, and what it is now."""
    values, at = batch.expand(field), _columns(which)
    return values, at, values[:, at].copy(), _columns(k)


def _range(model: mujoco.MjModel, what: str, actuator: int) -> Array:
    """Range of an actuator's control or force; infinite where it is not limited."""
    if not getattr(model, f"actuator_{what}limited")[actuator]:
        return np.array([-np.inf, np.inf])
    return getattr(model, f"actuator_{what}range")[actuator]
