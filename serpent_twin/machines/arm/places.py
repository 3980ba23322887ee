"""Say, without simulation, what a change at each place of the arm does to its pose and loads.

A slow arm passes through equilibria: where a torque τ is missing at the joints, they are off by K⁻¹ τ, with
the stiffness K of the strands that pull and of gravity. What K⁻¹ τ moves of the markers, and what it
stretches of the cables, is the prediction's change.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS, link_frames
from serpent_twin.arrays import Array
from serpent_twin.effects.law import POSITIONS, READINGS
from serpent_twin.machines.arm.missing_torques import missing_torques
from serpent_twin.machines.arm.pieces import markers_of
from serpent_twin.machines.places import MissingTorques, PlaceResponse, Places, by_forces
from serpent_twin.sim import response
from serpent_twin.sim.arm_places import (
    JOINT_AXES,
    KINDS,
    LINK_MASS,
    LOADS,
    NAMES,
    SHIFTS,
    centres_of_mass,
    levers,
    shift,
)
from serpent_twin.sim.prescribed_motion import STANDING
from serpent_twin.sim.statics import PASSES, gravity_stiffness, of_joints, strand_stiffness
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.tables.segments import Segments

_OBSTACLES = (2, 4, 6, 8)
"""Links whose position laws may follow, as where something stands in the way: links beside move alike"""
_SOFTEST = 0.01
"""[N m/rad] of a joint whose cables are slack: friction holds it"""
_SIDES = np.tile([1.0, -1.0], N_MOTORS)
_RADII = ARM.pulley_radii


@dataclass(frozen=True)
class ArmPlaces(Places):
    """What S segments of T rows show of changes at the arm's places; cables hold the joints, so that an
    error of a start is soon gone.
    """

    twin: TwinModel
    pieces: Segments
    did: response.Response
    """What the twin does in the segments, (S, T)"""

    @cached_property
    def readings(self) -> Mapping[tuple[str, str], Array]:
        """What laws may follow, (S, T), by the reading and its place: of joints and links as they were
        measured, since what acts beyond an angle does so at the arm's, and not at that of a twin without it.
        """
        q = self.pieces.column["joint_angle"]
        time = self.pieces.time
        horn = _RADII * (self.did.tension[..., 0::2] - self.did.tension[..., 1::2])
        several = {
            "joint_angle": q,
            "joint_velocity": self._speed(q),
            "motor_angle": self.pieces.column["motor_position"],
            "motor_velocity": self.pieces.column["motor_velocity"],
            "horn_torque": horn,
            "tension": self.did.tension,
            "time": time[..., None],
            "runtime": (time + self.pieces.prior_runtime[:, None])[..., None],
        }
        found = {
            (name, where): values[..., k]
            for name, values in several.items()
            for k, where in enumerate(NAMES[READINGS[name].kind])
        }
        seen = markers_of(self.pieces)
        marker = np.where(np.isnan(seen), np.asarray(self.did.marker), seen)
        for axis, name in enumerate(POSITIONS):
            for k in _OBSTACLES:
                found[name, NAMES["body"][k]] = marker[..., k, axis]
        return found

    @property
    def responses(self) -> Sequence[PlaceResponse]:
        """Of every quantity at every place."""
        return [*self._of_joints(), *self._of_drives(), *self._of_bodies(), *self._of_sensors()]

    @property
    def twin_angles(self) -> Mapping[str, Array]:
        """Of all joints."""
        return dict(zip(NAMES["joint"], np.moveaxis(self.did.joint_angle, -1, 0), strict=True))

    @property
    def missing_torques(self) -> MissingTorques:
        """Of all joints."""
        return missing_torques(self.twin, self.pieces, self.did)

    def _speed(self, joint_angle: Array) -> Array:
        time = self.pieces.time[..., None]
        return np.gradient(joint_angle, axis=1) / np.gradient(time, axis=1)

    def _late(self) -> Array:
        """Change of the prediction where cameras are late [1/s], (S, T, 37): by the way that markers went
        since the row before, as motors change their speed in rows.
        """
        marker, time = np.asarray(self.did.marker), self.pieces.time
        went = np.diff(marker.reshape(*time.shape, -1), axis=1) / np.diff(time, axis=1)[..., None]
        out = np.zeros(self.pieces.measured.shape)
        out[:, 1:, : 3 * N_JOINTS] = -went
        return out

    @cached_property
    def _frames(self) -> tuple[Array, Array]:
        """Where the links are, as `link_frames` says."""
        return link_frames(self.did.joint_angle, self.twin.built)

    @cached_property
    def _strand(self) -> Array:
        """Stiffness of each strand that pulls [N/m], (S, T, 20)."""
        return np.where(self.did.tension > 0, strand_stiffness(self.twin), 0.0)

    @cached_property
    def _cable(self) -> Array:
        """Torque of each cable per angle [N m/rad], (S, T, 10)."""
        return (self._strand[..., 0::2] + self._strand[..., 1::2]) * _RADII**2

    @cached_property
    def _yields(self) -> Array:
        """K⁻¹ [rad/(N m)], (S, T, 9, 9)."""
        K = of_joints(self._cable) + gravity_stiffness(self.did.joint_angle)
        values, vectors = np.linalg.eigh((K + K.swapaxes(-1, -2)) / 2)
        return np.einsum(
            "...ik,...k,...jk->...ij", vectors, 1 / np.maximum(values, _SOFTEST), vectors
        )

    @cached_property
    def _by_joints(self) -> Array:
        """Change of the prediction by each joint's angle, (9, S, T, 37)."""
        origin, rotation = self._frames
        axis = (rotation @ JOINT_AXES[..., None])[..., 0]
        marker = np.asarray(self.did.marker)
        reach = marker[..., None, :, :] - origin[..., :, None, :]
        moved = np.cross(axis[..., :, None, :], reach) * np.tri(N_JOINTS).T[..., None]
        load = -self._cable[..., None, :] * PASSES.T / ARM.servo.stall_torque
        whole = np.concatenate([moved.reshape(*moved.shape[:-2], -1), load], axis=-1)
        return np.moveaxis(whole, -2, 0)

    @cached_property
    def _by_torques(self) -> Array:
        """Change of the prediction by a torque at each joint, (9, S, T, 37)."""
        return np.einsum("stij,jstc->istc", self._yields, self._by_joints)

    @cached_property
    def _by_loads(self) -> Array:
        """Change of the prediction by a load, as a share of the stall torque, (10, 1, 1, 37)."""
        return np.eye(3 * N_JOINTS + N_MOTORS)[3 * N_JOINTS :, None, None, :]

    def _of_joints(self) -> Iterator[PlaceResponse]:
        resists = -np.tanh(self._speed(self.pieces.column["joint_angle"]) / (STANDING / 3))
        for i, name in enumerate(NAMES["joint"]):
            change = self._by_torques[i]
            yield PlaceResponse("joint_torque", name, change[None])
            yield PlaceResponse("joint_friction", name, (change * resists[..., i, None])[None])

    def _of_drives(self) -> Iterator[PlaceResponse]:
        turns = (
            np.tanh(self.pieces.column["motor_velocity"] / (STANDING / 3)) / ARM.servo.stall_torque
        )
        for j, name in enumerate(NAMES["actuator"]):
            load = np.broadcast_to(self._by_loads[j], self.pieces.measured.shape)
            yield PlaceResponse("motor_torque", name, -load[None] / ARM.servo.stall_torque)
            yield PlaceResponse("gear_friction", name, (load * turns[..., j, None])[None])
            yield PlaceResponse("winch_angle", name, self._wound(j, self._cable[..., j])[None])
        for n, name in enumerate(NAMES["tendon"]):
            pull = -_SIDES[n] * _RADII[n // 2] * self._strand[..., n]
            yield PlaceResponse("slack", name, self._wound(n // 2, pull)[None])

    def _wound(self, j: int, torque: Array) -> Array:
        """Change of the prediction by a torque (S, T) that cable j has more, (S, T, 37)."""
        moved = np.einsum("i,istc->stc", PASSES[j], self._by_torques) + (
            self._by_loads[j] / ARM.servo.stall_torque
        )
        return torque[..., None] * moved

    def _of_bodies(self) -> Iterator[PlaceResponse]:
        lever = levers(self.did.joint_angle)
        origin, rotation = self._frames
        middle = centres_of_mass(origin, rotation)
        for n, name in enumerate(NAMES["body"]):
            world = np.einsum("stjx,jstc->xstc", lever[..., n, :, :], self._by_torques)
            for handle, by in by_forces(rotation[..., n, :, :], middle[..., n, :]):
                yield PlaceResponse(handle, name, by(world))
        inertia = -np.einsum("l,stljx,jstc->xstc", LINK_MASS, lever, self._by_torques)
        yield PlaceResponse("acceleration", NAMES["frame"][0], inertia)

    def _of_sensors(self) -> Iterator[PlaceResponse]:
        marker = np.asarray(self.did.marker)
        for handle in SHIFTS:
            for n, name in enumerate(NAMES[KINDS[handle]]):
                change = np.zeros((3, *self.pieces.measured.shape))
                for axis, along in enumerate(np.eye(3)):
                    moved = shift(handle, n, along, *self._frames, marker)
                    change[axis, ..., : 3 * N_JOINTS] = moved.reshape(*moved.shape[:2], -1)
                yield PlaceResponse(handle, name, change)
        yield PlaceResponse("camera_delay", NAMES["frame"][0], self._late()[None])
        for j, name in enumerate(LOADS):
            load = np.broadcast_to(self._by_loads[j], self.pieces.measured.shape)
            yield PlaceResponse("load_shift", name, load[None])
            yield PlaceResponse("load_scale", name, (self.did.load[..., j, None] * load)[None])
