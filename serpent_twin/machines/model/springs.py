"""Read what pulls in a model, and let it lengthen and soften: tendons, springs and drives of joints."""

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array

_SINGLE = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
_TRANSMISSION = {"tendon": mujoco.mjtTrn.mjTRN_TENDON, "joint": mujoco.mjtTrn.mjTRN_JOINT}


class Spring:
    """A tendon with its own spring and the drives on it, the spring of a joint, or a joint's drive, in n runs
    side by side.

    A drive that sets a position pulls by k (length − what it is told), as a spring of stiffness k. What does
    not grow with the length, such as the force of a motor, it is told to pull besides.
    """

    def __init__(self, batch: Batch, kind: str, name: str) -> None:
        model, n_runs = batch.model, len(batch.bind("qpos"))
        self._batch, least = batch, -np.inf
        self._spring, self._rest = np.zeros(n_runs), np.zeros(n_runs)
        self._arms, self._entries = batch.bind("ten_J"), None
        self._shifted: list[tuple[Array, Array]] = []
        self._scaled: list[tuple[Array, Array]] = []
        self._drives = [model.actuator(name).id] if kind == "drive" else []
        if kind == "tendon":
            n = model.tendon(name).id
            first = int(model.ten_J_rowadr[n])
            self._entries = slice(first, first + int(model.ten_J_rownnz[n]))
            self._dofs = model.ten_J_colind[self._entries]
            self._length = batch.bind("ten_length")[:, n]
            self._drives = drives_on(model, kind, n)
            ends = model.tendon_lengthspring[n]
            self._own("tendon", n, "tendon_lengthspring", n)
            least = 0.0 if self._spring.any() and ends[0] < ends[1] else least
        else:
            n = int(model.actuator(name).trnid[0]) if kind == "drive" else model.joint(name).id
            at = int(model.jnt_qposadr[n])
            self._dofs = model.jnt_dofadr[[n]]
            self._length = batch.bind("qpos")[:, at]
            if kind == "joint":
                self._own("jnt", n, "qpos_spring", at)
        self._gear = model.actuator_gear[self._drives, 0].copy()
        self._gain = batch.expand("actuator_gainprm")[:, self._drives, 0].copy()
        self._bias = batch.expand("actuator_biasprm")[:, self._drives, :3].copy()
        self._servo = model.actuator_biasprm[self._drives, 1] != 0
        self.stiffness: Array = self._spring - self._bias[..., 1] @ self._gear**2
        """Of all that pulls here [N/m or N m/rad], (n,)"""
        self.limits: tuple[float, float] = (least, np.inf)
        """Least and most that it pulls [N or N m]"""
        if len(self._drives) == 1 and not self._spring.any():
            ends = _range(model, "force", self._drives[0]) * -self._gear
            self.limits = float(ends.min()), float(ends.max())
        self._control, self._state = batch.bind("ctrl"), batch.bind("act")
        of = ("actuator_gainprm", "actuator_biasprm") if self._servo.any() else ()
        self._told_by = [batch.expand(each) for each in of]

    def _own(self, of: str, which: int, shifted: str, at: int) -> None:
        """Take the spring of a tendon or a joint, where it has one."""
        if getattr(self._batch.model, f"{of}_stiffness")[which]:
            self._spring = _kept(self._batch, f"{of}_stiffness", which)[1][:, 0]
            self._shifted = [_kept(self._batch, shifted, at)]
            self._rest = self._shifted[0][1][:, -1]
            fields = (f"{of}_stiffness", f"{of}_stiffnesspoly")
            self._scaled = [_kept(self._batch, each, which) for each in fields]

    def state(self, rates: Array) -> tuple[Array, Array, Array, Array]:
        """Its length and rate, the stretch beyond its rest [m or rad], and what it is told to pull besides
        [N or N m], (n,) each, at rates of all joints, (n, nv).
        """
        length = self._length.copy()
        rate = (self._levers() * rates[:, self._dofs]).sum(axis=1)
        pull, besides = self._spring * (length - self._rest), np.zeros_like(length)
        for a, gear, gain, bias, servo in zip(
            self._drives,
            self._gear,
            self._gain.T,
            self._bias.T.swapaxes(0, 1),
            self._servo,
            strict=True,
        ):
            force = gain * self._told(a) + bias[0] + gear * (bias[1] * length + bias[2] * rate)
            if servo:
                pull = pull - gear * force
            else:
                besides = besides - gear * np.clip(force, *_range(self._batch.model, "force", a))
        return length, rate, pull / np.where(self.stiffness, self.stiffness, np.inf), besides

    def _levers(self) -> Array | float:
        """Change of its length with the joints that it passes."""
        return self._arms[:, self._entries] if self._entries else 1.0

    def pull(self, forces: Array, tension: Array) -> None:
        """Add a tension [N or N m], (n,), to the forces on all joints, (n, nv)."""
        forces[:, self._dofs] -= self._levers() * tension[:, None]

    def _told(self, actuator: int) -> Array:
        """What an actuator is told, after its own dynamics."""
        model = self._batch.model
        if several := model.actuator_actnum[actuator]:
            return self._state[:, model.actuator_actadr[actuator] + several - 1]
        return np.clip(self._control[:, actuator], *_range(model, "ctrl", actuator))

    def write(self, slack: Array, stiffness: Array) -> None:
        """Let it be longer by a slack [m or rad], and of another stiffness, (n,) each."""
        has = self.stiffness != 0
        share = np.where(has, stiffness, 1.0) / np.where(has, self.stiffness, 1.0)
        for values, base in self._shifted:
            values[...] = base + slack[:, None]
        for values, base in self._scaled:
            values[...] = base * share[:, None]
        if not self._told_by:
            return
        gains, biases = self._told_by
        for a, gear, gain, bias in zip(
            self._drives, self._gear, self._gain.T, self._bias.T.swapaxes(0, 1), strict=True
        ):
            own = np.where(bias[1] != 0, share, 1.0)
            gains[:, a, 0] = own * gain
            biases[:, a, 0] = own * (bias[0] - bias[1] * gear * slack)
            biases[:, a, 1] = own * bias[1]


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


def _kept(batch: Batch, field: str, which: int) -> tuple[Array, Array]:
    """The numbers of one thing in all runs, (n, ·), to be written, and what they are now."""
    values = batch.expand(field)[:, which : which + 1]
    values = values[:, 0] if values.ndim > 2 else values
    return values, values.copy()


def _range(model: mujoco.MjModel, what: str, actuator: int) -> Array:
    """Of an actuator's control or force; infinite where it is not limited."""
    if not getattr(model, f"actuator_{what}limited")[actuator]:
        return np.array([-np.inf, np.inf])
    return getattr(model, f"actuator_{what}range")[actuator]
