"""Compare an arm's logs with its twin, segment by segment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, joint_axis, link_frames
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.machines.arm.pieces import Pieces, camera_noise, cut, past
from serpent_twin.machines.arm.quantities import quantities
from serpent_twin.machines.arm.vector import Vector
from serpent_twin.machines.machine import Candidate, Declared, ParameterVector, Quantity, Stopwatch
from serpent_twin.residual import Comparison
from serpent_twin.sessions import Session
from serpent_twin.sim import twin_model
from serpent_twin.sim.many_twins import (
    TIMESTEP,
    Response,
    Stretches,
    alike,
    coarse_step,
    differentiate,
    impose,
    remember,
)
from serpent_twin.sim.prescribed_motion import STANDING
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

_AT_ONCE = 3.0e6  # numbers that one call keeps in memory: designs × rows × (markers and loads)
_PROBE = 0  # seed of the signs of the step that tests tangents
_PROBED = 0.1  # that step, as a share of the parameters' steps
_TRUSTED = 0.93  # cosine of what it does and what the tangents say, from which they are taken


@dataclass(frozen=True)
class ArmCase:
    """One arm's logs with first guesses."""

    vector: Vector
    candidates: Mapping[str, Candidate]
    unseen: Mapping[str, str]
    """Candidates that the logs cannot show, and why"""
    marker_noise: Array
    """Weighs each marker's coordinates [m], (9,)"""
    load_noise: Array
    """Weighs each motor's load [fraction of stall], (10,)"""
    clock: Stopwatch = field(default_factory=Stopwatch)
    """Time spent in simulation"""
    channels: int = 3 * N_JOINTS + N_MOTORS
    """Numbers that a residual has for each row of a log"""
    segments: tuple[int, int] = (7, 12)
    """How many a fit uses while it searches, and the last"""

    @property
    def declared(self) -> Sequence[Declared]:
        """The coordinates of the fit."""
        return self.vector.declared

    @property
    def quantities(self) -> Sequence[Quantity]:
        """The physical quantity of each coordinate."""
        return quantities(self.vector)

    def pieces(self, sessions: Sequence[Session]) -> Pieces:
        """Cut sessions into segments of 40 s."""
        return cut(sessions, self.vector.start.tolerances.marker_offset)

    def take(self, pieces: Pieces, which: Sequence[int]) -> Pieces:
        """Some of the segments."""
        n = list(which)
        arrays = {
            name: value[n] for name, value in vars(pieces).items() if isinstance(value, np.ndarray)
        }
        return replace(pieces, session=tuple(pieces.session[k] for k in n), **arrays)

    def residual(
        self, points: Sequence[ParameterVector], pieces: Pieces, rough: bool = False
    ) -> Array:
        """Measured minus predicted over noise, (points, S, T · 37): markers, then loads."""
        at_once = max(1, int(_AT_ONCE / (pieces.time.size * self.channels)))
        designs = [self.vector.design(point) for point in points]
        timestep = coarse_step(designs) if rough else TIMESTEP
        out = np.empty((len(points), len(pieces), pieces.time.shape[1] * self.channels), np.float32)
        for group in alike(designs):
            for n in range(0, len(group), at_once):
                some = group[n : n + at_once]
                did = self.respond([points[k] for k in some], pieces, timestep)
                error = pieces.marker - did.marker, pieces.load - did.load
                out[some] = self._weigh(*error, pieces)
        return out

    @property
    def noise(self) -> Array:
        """Noise of each number of a row, (37,): three coordinates a marker [m], then the loads [1]."""
        return np.r_[np.repeat(self.marker_noise, 3), self.load_noise]

    def _weigh(self, marker: Array, load: Array, pieces: Pieces) -> Array:
        """Errors (D, S, T, 9, 3) and (D, S, T, 10) as one row of numbers per segment, (D, S, T · 37)."""
        lost = np.isnan(pieces.marker)
        marker = np.where(lost, 0.0, marker / self.marker_noise[:, None])
        load = np.where(pieces.moving, load / self.load_noise, 0.0)
        flat = marker.reshape(*marker.shape[:3], -1)
        return (
            np.concatenate([flat, load], axis=-1).reshape(*marker.shape[:2], -1).astype(np.float32)
        )

    def respond(
        self, points: Sequence[ParameterVector], pieces: Pieces, timestep: float = TIMESTEP
    ) -> Response:
        """Responses of the twins at these parameter vectors in the segments."""
        designs = [self.vector.design(point) for point in points]
        with self.clock:
            return impose(designs, self._stretches(pieces, designs), timestep)

    def _stretches(self, pieces: Pieces, designs: Sequence[TwinModel]) -> Stretches:
        """What drives the twins in the segments."""
        restart = np.zeros(pieces.time.shape[1], bool)
        restart[0] = True
        return Stretches(
            pieces.time,
            pieces.motor_angle,
            pieces.motor_velocity,
            pieces.joint_angle,
            restart,
            self.vector.start.parameters.servo_lag,
            pieces.prior_runtime,
            joint_velocity=pieces.joint_velocity,
            past=past(pieces) if any(map(remember, designs)) else None,
        )

    def jacobian(self, point: ParameterVector, pieces: Pieces) -> Array:
        """Derivatives of the residual by the declared parameters, (declared, S, T · 37).

        NaN for those of cables and hinges where effects answer to a change so much that tangents, which
        leave that out, are wrong: a step of all parameters at once tells.
        """
        shape = (len(self.declared), len(pieces), pieces.time.shape[1] * self.channels)
        out = np.empty(shape, np.float32)
        moving = self.vector.moving
        out[len(moving) :] = self._still(point, pieces)
        at_once = max(1, int(_AT_ONCE * len(pieces) / out[: len(moving)].size * 4))
        for n in range(0, len(pieces), at_once):
            which = range(n, min(n + at_once, len(pieces)))
            out[: len(moving), which] = self._along(point, self.take(pieces, which))
        return out

    def _along(self, point: ParameterVector, pieces: Pieces) -> Array:
        """Derivatives by the parameters of cables and hinges, (80, S, T · 37); NaN where they fail."""
        steps = np.array([self.declared[k].step for k in self.vector.moving])
        changes = np.eye(len(steps), len(self.declared)) * steps[:, None]
        others = [self.vector.design(point.after(change)) for change in changes]
        with self.clock:
            here = self.vector.design(point)
            did, marker, load = differentiate(here, others, self._stretches(pieces, [here]))
        slopes = self._weigh(-marker, -load, pieces)
        base = self._weigh(pieces.marker - did.marker, pieces.load - did.load, pieces)[0]
        size = np.linalg.norm(slopes.reshape(len(slopes), -1), axis=1)
        sides = np.random.default_rng(_PROBE).choice([-1.0, 1.0], len(steps))
        sides *= np.minimum(1.0, _PROBED * np.median(size) / np.maximum(size, 1e-9))
        found = (self.residual([point.after(sides @ changes)], pieces)[0] - base).ravel()
        told = np.tensordot(sides, slopes, 1).ravel()
        if not found @ told > _TRUSTED * np.linalg.norm(found) * np.linalg.norm(told):
            return np.full_like(slopes, np.nan)
        return slopes / steps.astype(np.float32)[:, None, None]

    def _still(self, point: ParameterVector, pieces: Pieces) -> Array:
        """Derivatives by gear friction and marker places, which move nothing, (10 + 27, S, T · 37)."""
        friction = self.vector.design(point)
        gear = friction.parameters.gear_friction * np.exp(friction.tolerances.gear_friction)
        gear = gear / friction.arm.servo.stall_torque
        turning = np.tanh(pieces.motor_velocity / (STANDING / 3))
        shape = (*pieces.time.shape, N_JOINTS, 3)
        none_load, none_marker = np.zeros_like(pieces.load), np.zeros(shape)
        _, rotation = link_frames(pieces.joint_angle)
        rows = []
        for j in range(N_MOTORS):
            load = none_load.copy()
            load[..., j] = -gear[j] * turning[..., j]
            rows.append(self._weigh(none_marker[None], load[None], pieces)[0])
        for k in range(3 * N_JOINTS):
            marker = none_marker.copy()
            marker[..., k // 3, :] = -1e-3 * rotation[..., k // 3, :, k % 3]
            rows.append(self._weigh(marker[None], none_load[None], pieces)[0])
        return np.array(rows)

    def reweighted(self, point: ParameterVector, pieces: Pieces) -> "ArmCase":
        """Weigh every marker and motor by the rms that this twin leaves of it."""
        did = self.respond([point], pieces)
        marker = np.sqrt(np.nanmean((pieces.marker - did.marker[0]) ** 2, axis=(0, 1, 3)))
        error = np.where(pieces.moving, pieces.load - did.load[0], np.nan)
        load = np.sqrt(np.nanmean(error**2, axis=(0, 1)))
        load = np.where(np.isfinite(load), load, self.load_noise)
        return replace(
            self, marker_noise=np.maximum(marker, 1e-4), load_noise=np.maximum(load, 2e-3)
        )

    def compare(self, point: ParameterVector | None, pieces: Pieces) -> Comparison:
        """Measured beside predicted, with the quantities on which the residual may depend."""
        did = self.respond([point], pieces) if point else self._nominal(pieces)
        anchor, rotation = link_frames(did.joint_angle[0])
        axis = np.stack([rotation[..., i, :, :] @ joint_axis(i) for i in range(N_JOINTS)], axis=-2)
        return Comparison(
            session=pieces.session,
            time=pieces.time,
            marker_measured=pieces.marker,
            marker_predicted=did.marker[0],
            load_measured=pieces.load,
            load_predicted=did.load[0],
            load_counts=pieces.moving,
            motor_angle=pieces.motor_angle,
            motor_velocity=pieces.motor_velocity,
            motor_command=pieces.motor_command,
            joint_angle=did.joint_angle[0],
            tension=did.tension[0],
            joint_anchor=anchor,
            joint_axis=axis,
        )

    def _nominal(self, pieces: Pieces) -> Response:
        nominal = replace(self, vector=replace(self.vector, start=NOMINAL_TWIN))
        return nominal.respond([ParameterVector(np.zeros(len(self.declared)))], pieces)

    def expected(
        self,
        fit: ParameterVector,
        drawn: Sequence[ParameterVector],
        pieces: Pieces,
        rng: np.random.Generator,
    ) -> float:
        """Mean marker error [mm] of twins drawn from the fit's covariance, from starts with camera noise."""
        noise = camera_noise(pieces)
        truth, errors = self.respond([fit], pieces).marker[0], []
        for point in drawn:
            seen = pieces.marker + noise * rng.standard_normal(pieces.marker.shape)
            start = joints_from_markers(
                seen[:, 0],
                pieces.joint_angle[:, 0],
                self.vector.design(fit).tolerances.marker_offset,
            )
            joint = pieces.joint_angle.copy()
            joint[:, 0] = start
            moved = self.respond([point], replace(pieces, joint_angle=joint)).marker[0]
            moved = moved + noise * rng.standard_normal(moved.shape)
            errors.append(np.nanmean(np.linalg.norm(moved - truth, axis=-1)))
        return 1e3 * float(np.mean(errors))

    def write(self, point: ParameterVector, path: Path, about: Mapping[str, Any]) -> None:
        """Write twin.json and twin.xml; the loads' noise is the residual of the case's last twin."""
        found = self.vector.design(point)
        parameters = replace(found.parameters, load_noise=float(np.median(self.load_noise)))
        twin_model.write(path, replace(found, parameters=parameters), about)
