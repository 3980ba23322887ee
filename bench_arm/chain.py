"""Compute mass matrix and bias forces of many chains of hinges side by side."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS
from serpent_twin.arrays import Array

from .parameters import BenchArm

GRAVITY = 9.81

_SKEW = np.zeros((3, 9))  # v @ _SKEW is the flattened matrix of v ×
_SKEW[0, 7], _SKEW[0, 5] = 1, -1
_SKEW[1, 2], _SKEW[1, 6] = 1, -1
_SKEW[2, 3], _SKEW[2, 1] = 1, -1


@dataclass(frozen=True)
class Pose:
    """Where everything is: hinges and bodies of R chains, in the base frame."""

    rotation: Array
    """Frame behind each hinge, (R, H, 3, 3)."""
    origin: Array
    """Each hinge's place [m], (R, H, 3)."""
    axis: Array
    """Each hinge's axis, (R, H, 3)."""
    com: Array
    """Each body's centre of mass [m], (R, B, 3)."""


@dataclass(frozen=True)
class Chain:
    """R chains of H hinges and B bodies, each with its own lengths, axes and masses."""

    turn: tuple[Array, Array, Array]
    """Rotation of a hinge = turn[0] + cos q turn[1] + sin q turn[2], (R, H, 3, 3) each."""
    axis: Array
    """Each hinge's axis in its own frame, (R, H, 3)."""
    step: Array
    """Vector from each hinge to the next one, in the frame behind the first [m], (R, H, 3)."""
    carrier: np.ndarray
    """The hinge behind which a body sits, (B,)."""
    mass: Array
    """[kg], (R, B)."""
    com: Array
    """Centre of mass in the frame of the carrier [m], (R, B, 3)."""
    inertia: Array
    """Principal inertias along the carrier's x, y, z [kg m²], (R, B, 3)."""
    joint: np.ndarray
    """Which hinges are the arm's nine joints, (9,); the others are links that flex."""
    marker: tuple[tuple[np.ndarray, Array], ...]
    """Hinge (9,) and place behind it [m], (R, 9, 3); a marker sits at the mean over the entries."""

    @property
    def n_hinges(self) -> int:
        """H."""
        return self.axis.shape[1]

    def pose(self, q: Array) -> Pose:
        """Forward kinematics at hinge angles q [rad], (R, H)."""
        local = (
            self.turn[0]
            + np.cos(q)[..., None, None] * self.turn[1]
            + np.sin(q)[..., None, None] * self.turn[2]
        )
        rotation = np.empty_like(local)
        rotation[:, 0] = local[:, 0]
        for h in range(1, self.n_hinges):
            rotation[:, h] = rotation[:, h - 1] @ local[:, h]
        origin = np.zeros((*q.shape, 3))
        reach = _apply(rotation, self.step)
        np.cumsum(reach[:, :-1], axis=1, out=origin[:, 1:])
        com = origin[:, self.carrier] + _apply(rotation[:, self.carrier], self.com)
        return Pose(rotation, origin, _apply(rotation, self.axis), com)

    def jacobian(self, pose: Pose) -> Array:
        """Motion of the bodies by each hinge, (R, H, 6 B): rows scaled so that J Jᵀ is the mass matrix.

        The first 3 B columns are √m × velocity of the centre of mass, the others √I × angular
        velocity in the body's frame.
        """
        rows, hinges, bodies = len(pose.com), self.n_hinges, len(self.carrier)
        arm = pose.com.swapaxes(1, 2)[:, None] - pose.origin[..., None]
        jacobian = np.empty((rows, hinges, 2, 3, bodies))
        jacobian[:, :, 0] = _skew(pose.axis) @ arm
        frame = pose.rotation[:, self.carrier].transpose(0, 2, 3, 1).reshape(rows, 3, -1)
        jacobian[:, :, 1] = (pose.axis @ frame).reshape(rows, hinges, 3, bodies)
        jacobian *= self._scale
        jacobian *= self._carried
        return jacobian.reshape(rows, hinges, -1)

    def bias(self, pose: Pose, jacobian: Array, dq: Array, gravity: Array) -> Array:
        """Hinge torques [N m], (R, H), that hold the chain on its course without acceleration.

        The generalised forces of gravity (R, 3) [m/s²], Coriolis and centrifugal terms, so that
        M ddq + bias = torque.
        """
        turned = pose.axis * dq[..., None]
        omega = np.cumsum(turned, axis=1)
        spin = _skew(omega)
        alpha = np.cumsum(((spin @ turned[..., None])[..., 0]), axis=1)
        pull = _skew(alpha) + spin @ spin
        acceleration = np.zeros_like(omega)
        reach = np.diff(pose.origin, axis=1)
        np.cumsum(_apply(pull[:, :-1], reach), axis=1, out=acceleration[:, 1:])
        c = self.carrier
        com = acceleration[:, c] + _apply(pull[:, c], pose.com - pose.origin[:, c])
        force = np.empty((len(dq), 2, 3, len(c)))
        force[:, 0] = (com - gravity[:, None]).swapaxes(1, 2)
        back = pose.rotation[:, c].swapaxes(2, 3)
        w = _apply(back, omega[:, c])
        moment = _apply(back, alpha[:, c])
        moment += _apply(_skew(w), self.inertia * w) / self.inertia
        force[:, 1] = moment.swapaxes(1, 2)
        force *= self._scale[:, 0]
        return (jacobian @ force.reshape(len(dq), -1, 1))[..., 0]

    def energy(self, q: Array, dq: Array, gravity: Array) -> Array:
        """Kinetic energy and gravity's potential [J], (R,), gravity (R, 3) in m/s²."""
        pose = self.pose(q)
        speed = (dq[:, None] @ self.jacobian(pose))[:, 0]
        height = (pose.com @ gravity[..., None])[..., 0]
        return 0.5 * (speed**2).sum(1) - (self.mass * height).sum(1)

    def markers(self, pose: Pose) -> Array:
        """Marker places [m], (R, 9, 3)."""
        seen = [
            pose.origin[:, hinge] + _apply(pose.rotation[:, hinge], place)
            for hinge, place in self.marker
        ]
        return sum(seen[1:], seen[0]) / len(seen)

    def __post_init__(self) -> None:
        scale = np.empty((len(self.mass), 1, 2, 3, len(self.carrier)))
        scale[:, 0, 0] = np.sqrt(self.mass)[:, None]
        scale[:, 0, 1] = np.sqrt(self.inertia).swapaxes(1, 2)
        carried = np.arange(self.n_hinges)[:, None] <= self.carrier
        object.__setattr__(self, "_scale", scale)
        object.__setattr__(self, "_carried", carried[:, None, None].astype(float))


@dataclass(frozen=True)
class Payloads:
    """One point mass in each of R arms."""

    mass: Array
    """[kg], (R,)."""
    link: np.ndarray
    """Which link, from 0, (R,)."""
    at: Array
    """Behind that link's joint [m], (R,)."""


def chain(arms: Sequence[BenchArm], payload: Payloads, flexes: str = "") -> Chain:
    """Arms with payloads.

    Where links flex, each is cut at its middle into two equal halves (together they have the
    link's mass, centre and inertia) joined by hinges about the axes `flexes`, such as "zy" to bend.
    """
    length = np.array(ARM.link_length) * [a.length_ratio for a in arms]
    mass = np.array(ARM.link_mass) * [a.mass_ratio for a in arms]
    part = length / 2 if flexes else length
    per_link = ("joint", *flexes)
    kinds = [("zy"[i % 2] if k == "joint" else k) for i in range(N_JOINTS) for k in per_link]
    stride = len(per_link)
    joint = np.arange(N_JOINTS) * stride
    end = joint + stride - 1
    axis = np.tile(np.eye(3)[["xyz".index(k) for k in kinds]], (len(arms), 1, 1))
    axis[:, joint] = _tilted(axis[:, joint], np.array([a.axis_tilt for a in arms]))
    step = np.zeros((len(arms), len(kinds), 3))
    step[:, ::stride, 0] = part
    if flexes:
        step[:, stride - 1 :: stride, 0] = part
    carrier = np.stack([joint, end], 1).ravel() if flexes else joint
    pieces = 2 if flexes else 1
    body_mass = np.repeat(mass / pieces, pieces, axis=1)
    body_length = np.repeat(part, pieces, axis=1)
    com = np.zeros((*body_mass.shape, 3))
    com[..., 0] = body_length / 2
    inertia = body_mass[..., None] * np.array([ARM.inertia_along, *2 * [ARM.inertia_across]])
    inertia[..., 1:] += (body_mass * body_length**2 / 12)[..., None]
    middle = part[np.arange(len(arms)), payload.link]
    beyond = payload.at > middle if flexes else np.zeros(len(payload.at), bool)
    body = pieces * payload.link + beyond
    _load(body_mass, com, inertia, payload.mass, body, payload.at - beyond * middle)
    at = ARM.markers_in_links + np.array([a.marker_offset for a in arms])
    marker = ((joint, at),)
    if flexes:
        far = (end, at - np.stack([part, 0 * part, 0 * part], -1))
        outer = ARM.markers_in_links[:, 0] > np.array(ARM.link_length) / 2
        near = (np.where(outer, far[0], joint), np.where(outer[:, None], far[1], at))
        marker = (near, far)
    return Chain(_turns(axis), axis, step, carrier, body_mass, com, inertia, joint, marker)


def _tilted(axis: Array, tilt: Array) -> Array:
    """Unit axes (R, 9, 3) that lean by tilts (R, 9, 2) along their links and across both."""
    along = np.array([1.0, 0.0, 0.0])
    leaning = axis + tilt[..., :1] * along + tilt[..., 1:] * np.cross(along, axis)
    return leaning / np.linalg.norm(leaning, axis=-1, keepdims=True)


def _load(
    mass: Array, com: Array, inertia: Array, payload: Array, body: np.ndarray, place: Array
) -> None:
    """Put a point mass [kg], (R,), at x = `place` of one body of each row, in place."""
    at = np.arange(len(payload)), body
    own, total = mass[at].copy(), mass[at] + payload
    apart = place - com[at][:, 0]
    com[(*at, 0)] += payload * apart / total
    inertia[(*at, slice(1, 3))] += (payload * own / total * apart**2)[:, None]
    mass[at] = total


def _turns(axis: Array) -> tuple[Array, Array, Array]:
    """Rodrigues' formula for hinges about `axis`, (R, H, 3)."""
    along = axis[..., None] * axis[..., None, :]
    return along, np.eye(3) - along, _skew(axis)


def _skew(v: Array) -> Array:
    """The matrix of v ×, (..., 3, 3), for v (..., 3)."""
    return (v @ _SKEW).reshape(*v.shape, 3)


def _apply(matrix: Array, v: Array) -> Array:
    """Multiply matrix (..., 3, 3) by v (..., 3)."""
    return (matrix @ v[..., None])[..., 0]
