"""Read what is measured out of simulations, as the log has it."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from serpent_twin.arrays import Array
from serpent_twin.machines.model.coordinates import CAMERAS, scales_of, zeros_of
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MeasuredColumns
from serpent_twin.machines.model.misread import Views
from serpent_twin.machines.model.prescribed import NO_EFFORTS, Efforts
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.tables.segments import Segments

_READ = (
    *("site_xpos", "site_xmat", "sensordata", "ten_length", "actuator_force"),
    *("qvel", "qacc", "qfrc_applied"),
)

_RATES, _FORCES = int(mujoco.mjtStage.mjSTAGE_VEL), int(mujoco.mjtStage.mjSTAGE_ACC)


class Seen:
    """What is measured of a machine, its sites in the frame of the cameras. Its runs are as many of each of
    some twins, one after the other, at coordinates of the fit.
    """

    def __init__(
        self, machine: Described, frame: Mapping[str, Any], twins: Sequence[Mapping[str, float]]
    ) -> None:
        self._machine, self._about, self._frame, self._twins = machine, machine.about, frame, twins
        self._cameras, self._driven = self._of_cameras(), list[str]()
        self._sites: dict[str, NDArray[np.intp]] = {}
        self.efforts = NO_EFFORTS
        """What drives the joints of which that is measured"""
        self.of_forces = any(_is_force(machine.model, each) for each in self._about.measured)
        """Whether anything that is measured depends on the forces that act"""
        rates = [_is_rate(machine.model, e) for e in self._about.measured for _ in e.columns]
        self._rates = np.flatnonzero(rates)
        self.stage = int(_FORCES if self.of_forces or len(self._rates) else _RATES)
        """What MuJoCo must compute of a row before it is read"""

    def _of_site(self, batch: Batch, field: str, name: str) -> Array:
        """A field of a site in all runs."""
        if name in self._sites:
            return batch.bind(field)[np.arange(len(self._sites[name])), self._sites[name]]
        return batch.bind(field)[:, batch.model.site(name).id]

    def views(self, batch: Batch) -> Views:
        """How laws change what is seen."""
        return Views(self._machine, batch, partial(self._of_site, batch, "site_xpos"))

    @property
    def sites(self) -> NDArray[np.intp]:
        """Which channels are of sites."""
        each = [bool(one.site) for one in self._about.measured for _ in one.columns]
        return np.flatnonzero(each)

    def repeated(self, times: int) -> "Seen":
        """Repeat the runs of one twin several times, one set after the other."""
        return Seen(self._machine, self._frame, [*self._twins] * times)

    def bind(self, batch: Batch, models: Sequence[mujoco.MjModel] = ()) -> None:
        """Let the batch keep what is read, before its first step; of the runs' models, where forces drive."""
        self._driven = [e.joint for e in self._about.measured if models and e.of_effort and e.joint]
        self.efforts = Efforts.at(models, self._driven) if self._driven else NO_EFFORTS
        several = {id(each): each for each in models}
        if len(several) > 1:  # an effect may add a site, after which all others have another number
            names = [each.site for each in self._about.measured if each.site]
            of = {n: [model.site(name).id for name in names] for n, model in several.items()}
            self._sites = dict(zip(names, np.array([of[id(m)] for m in models]).T, strict=True))
        for field in _READ:
            batch.bind(field)

    def read(self, batch: Batch, older: Array | None = None) -> Array:
        """What is measured now, (n, C), velocities as they will be where rates are so much older than angles
        [s], (n,).
        """
        found = self._read(batch)
        if older is None or not len(self._rates):
            return found
        rate = batch.bind("qvel")
        before = rate.copy()
        rate += older[:, None] * batch.bind("qacc")
        batch.forward(stage=_RATES)
        found[:, self._rates] = self._read(batch)[:, self._rates]
        rate[...] = before
        batch.forward(stage=self.stage)
        return found

    def _read(self, batch: Batch) -> Array:
        """What is measured now, (n, C)."""
        model, found = batch.model, []
        efforts = self.efforts.read(batch) if self._driven else np.zeros((1, 0))
        for each in self._about.measured:
            kind, name = each.of
            if kind == "site":
                turn = self._of_site(batch, "site_xmat", name).reshape(-1, 3, 3)
                at = self._of_site(batch, "site_xpos", name) + turn @ np.array(each.point)
                at = in_frame(batch, model, each.frame, at) if each.frame else at
                found.append(self._by_cameras(at) if each.cameras else at)
            elif kind == "joint" and each.of_effort:
                found.append(efforts[:, [self._driven.index(name)]])
            elif kind == "joint":
                found.append(batch.bind("qpos")[:, [address(model, name)]].copy())
            elif kind == "tendon" and each.of_effort:
                found.append(_pull(batch, model.tendon(name).id))
            elif kind == "tendon":
                found.append(batch.bind("ten_length")[:, [model.tendon(name).id]].copy())
            elif kind == "actuator":
                found.append(batch.bind("actuator_force")[:, [model.actuator(name).id]].copy())
            else:
                sensor = model.sensor(name)
                first = int(sensor.adr[0])
                found.append(batch.bind("sensordata")[:, first : first + int(sensor.dim[0])].copy())
            if scales := scales_of(each):
                scale = np.array([[np.exp(-x[of]) for of in scales] for x in self._twins])
                found[-1] *= scale.repeat(len(found[-1]) // len(scale), axis=0)
            if zeros := zeros_of(each):
                zero = np.array([[x[of] for of in zeros] for x in self._twins])
                found[-1] += zero.repeat(len(found[-1]) // len(zero), axis=0)
        return np.concatenate(found, axis=1)

    def _of_cameras(self) -> tuple[Array, Array]:
        """Turn of the cameras' frame in each twin, (D, 1, 3, 3), and where that puts the pivot, (D, 1, 3)."""
        if not any(each.site and each.cameras for each in self._about.measured):
            return np.empty(0), np.empty(0)
        turned, along = (
            np.array([[x[n] for n in names] for x in self._twins]) for names in CAMERAS
        )
        turn = Rotation.from_rotvec(np.radians(turned)).as_matrix()
        place = np.array(self._frame["pivot"]) + np.array(self._frame["shift"]) + 1e-3 * along
        return turn[:, None], place[:, None]

    def _by_cameras(self, at: Array) -> Array:
        """Places in the world in the frame of the cameras [m], (n, 3)."""
        turn, place = self._cameras
        away = at.reshape(len(self._twins), -1, 3) - np.array(self._frame["pivot"])
        return ((turn @ away[..., None])[..., 0] + place).reshape(at.shape)


def _pull(batch: Batch, tendon: int) -> Array:
    """What the spring of a tendon pulls [N or N m], (n, 1): a polynomial of its stretch, as MuJoCo has it."""
    length, ends = batch.bind("ten_length")[:, tendon], batch.expand("tendon_lengthspring")
    stretch = length - np.clip(length, ends[:, tendon, 0], ends[:, tendon, 1])
    stiffness = batch.expand("tendon_stiffness")[:, tendon]
    more = batch.expand("tendon_stiffnesspoly")[:, tendon]
    return (stretch * (stiffness + stretch * (more[:, 0] + stretch * more[:, 1])))[:, None]


def in_frame(batch: Batch, model: mujoco.MjModel, frame: str, at: Array) -> Array:
    """Places in the world in the frame of a site [m], (n, 3)."""
    n = model.site(frame).id
    turn = batch.bind("site_xmat")[:, n].reshape(-1, 3, 3)
    return np.einsum("nij,ni->nj", turn, at - batch.bind("site_xpos")[:, n])


def _is_force(model: mujoco.MjModel, measured: MeasuredColumns) -> bool:
    """Whether what is measured depends on the forces that act."""
    kind, name = measured.of
    if kind != "sensor":
        return kind == "actuator" or (kind == "joint" and measured.of_effort)
    return int(model.sensor(name).needstage[0]) == _FORCES


def _is_rate(model: mujoco.MjModel, measured: MeasuredColumns) -> bool:
    """Whether what is measured depends on rates, and on no force."""
    sensor = measured.sensor
    return bool(sensor) and int(model.sensor(sensor).needstage[0]) == _RATES


def beginning(model: mujoco.MjModel, machine: Described) -> Array:
    """Where runs of a model begin, (nq,): its own joints as ever, those that effects add at zero."""
    own, out = machine.model, model.qpos0.copy()
    if model.nq == own.nq:
        return machine.begin
    for n in range(own.njnt):
        first = own.jnt_qposadr[n]
        size = (own.jnt_qposadr[n + 1] if n + 1 < own.njnt else own.nq) - first
        at = address(model, own.joint(n).name)
        out[at : at + size] = machine.begin[first : first + size]
    return out


def address(model: mujoco.MjModel, joint: str) -> int:
    """Address of a hinge or slide in qpos."""
    return int(model.joint(joint).qposadr[0])


def joint_angles(model: mujoco.MjModel, pose: Array) -> dict[str, Array]:
    """Angles of hinges and positions of slides that have names, (...), by name, in poses, (..., nq)."""
    joints = [model.joint(int(n)).name for n in single_joints(model)]
    return {name: pose[..., address(model, name)] for name in joints if name}


def segments_of(pieces: Segments) -> list[tuple[str, float, int]]:
    """What tells each segment of a log from all others."""
    rows = pieces.time.shape[1]
    return [
        (name, float(time[0]), rows) for name, time in zip(pieces.session, pieces.time, strict=True)
    ]
