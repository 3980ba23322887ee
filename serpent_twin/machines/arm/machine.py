"""Compare an arm's logs with its twin, segment by segment."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, link_frames, markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.effects.discovered import Discovered
from serpent_twin.machines.arm.pieces import camera_noise, cut, markers_of, motors_of, past
from serpent_twin.machines.arm.places import ArmPlaces
from serpent_twin.machines.arm.quantities import quantities
from serpent_twin.machines.arm.track_record import track_record
from serpent_twin.machines.arm.vector import Vector
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import Declared, Output, ParameterVector, Quantity
from serpent_twin.residual import LOADS, MARKERS, Comparison
from serpent_twin.sessions import Session
from serpent_twin.sim import twin_model
from serpent_twin.sim.many_twins import (
    TIMESTEP,
    PrescribedMotion,
    alike,
    coarse_step,
    differentiate,
    impose,
    remember,
)
from serpent_twin.sim.prescribed_motion import STANDING
from serpent_twin.sim.response import Response
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel
from serpent_twin.tables.segments import Segments

_CAMERA, _LOAD = 1e-4, 2e-3  # [m], [fraction of stall] least noise
_PROBE = 0  # seed of the signs of the step that tests tangents
_PROBED = 0.1  # that step, as a share of the parameters' steps
_SLIGHT = 1e-3  # share of a parameter's step by which models differ whose tangents are taken
_WILD = (
    0.5  # [m] by which no step moves a marker: tangents that say so grew along an unstable motion
)
_TRUSTED = 0.93  # least cosine between what it changes and what the tangents predict, for tangents to be used
_TRUSTED_COMPOSED = 0.7
"""The same of composed laws, whose thresholds are passed at other instants after any step"""
_TRUSTED_CABLE = 0.7
"""The same of the parameters of one cable: where its clamp slips, they change something else altogether"""
OUTPUTS = (
    *(
        Output(f"marker {i}{axis}", MARKERS, _CAMERA, alike=f"marker {i}")
        for i in range(1, N_JOINTS + 1)
        for axis in MARKERS.along
    ),
    *(Output(f"load of motor {j}", LOADS, _LOAD) for j in range(1, N_MOTORS + 1)),
)
"""Three coordinates a marker [m], then the loads [fraction of stall], (37,)"""


@dataclass(frozen=True)
class ArmMachine:
    """One arm with first guesses."""

    vector: Vector
    candidates: Mapping[str, Candidate]
    outputs: tuple[Output, ...] = OUTPUTS
    segments: tuple[int, int] = (7, sys.maxsize)
    """How many segments a fit uses while it searches, and the last fit: all"""
    weak_rounds: int = 0
    """None: tangents, not differences, are its derivatives"""
    steps_of_derivative: int = 10

    @property
    def track_record(self) -> Mapping[str, tuple[int, int]]:
        """How often each name was right, and how often it was given, on arms whose faults were known."""
        return track_record()

    @property
    def declared(self) -> Sequence[Declared]:
        """The coordinates of the fit."""
        return self.vector.declared

    @property
    def quantities(self) -> Sequence[Quantity]:
        """The physical quantity of each coordinate."""
        return quantities(self.vector)

    def pieces(self, sessions: Sequence[Session]) -> Segments:
        """Cut sessions into segments of about 40 s that hold every row."""
        return cut(sessions, self.vector.start.built)

    def alike(self, points: Sequence[ParameterVector]) -> Sequence[list[int]]:
        """Those whose models have one structure."""
        return alike([self.vector.design(point) for point in points])

    def coarse_step(self, points: Sequence[ParameterVector]) -> float | None:
        """As long as is stable at the strands' stiffness [s]."""
        coarse = coarse_step([self.vector.design(point) for point in points])
        return coarse if coarse > TIMESTEP else None

    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """Markers and loads of the twins, (D, S, T, 37)."""
        did = self.simulate(points, pieces, timestep)
        return _channels(did.marker, did.load)

    def simulate(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Response:
        """Responses of the twins at these parameter vectors in the segments, (D, S, T)."""
        designs = [self.vector.design(point) for point in points]
        return impose(designs, self._motion(pieces, designs), timestep or TIMESTEP)

    def responses_at_places(self, point: ParameterVector, pieces: Segments) -> ArmPlaces:
        """What changes at the arm's places would show in the segments."""
        did = self.simulate([point], pieces)[0]
        return ArmPlaces(self.vector.design(point), pieces, did)

    def _motion(self, pieces: Segments, designs: Sequence[TwinModel]) -> PrescribedMotion:
        """What drives the twins in the segments."""
        return PrescribedMotion(
            motors_of(pieces),
            pieces.column["joint_angle"][:, 0],
            pieces.column["joint_velocity"][:, 0],
            self.vector.start.parameters.servo_lag,
            pieces.prior_runtime,
            seen=markers_of(pieces)[:, 0],
            past=past(pieces) if any(map(remember, designs)) else None,
        )

    def derivatives(
        self, point: ParameterVector, pieces: Segments, noise: Array
    ) -> dict[str, Array]:
        """By all coordinates, (S, T, 37) each; without those of cables and hinges where effects answer to a
        change so much that tangents, which leave that out, are wrong. Where effects act, a step of all
        coordinates at once is simulated to find out, and one of each cable's alone.
        """
        return self._along(point, pieces, noise) | self._still(point, pieces)

    def _along(self, point: ParameterVector, pieces: Segments, noise: Array) -> dict[str, Array]:
        """Derivatives by the parameters of cables and hinges; without those that grew beyond reason, and none
        where they fail.
        """
        moving, names = self.vector.moving, [each.name for each in self.declared]
        at = [names.index(name) for name in moving]
        steps = np.array([self.declared[k].step for k in at])
        changes = np.zeros((len(at), len(names)))
        changes[range(len(at)), at] = steps
        others = [self.vector.design(point.after(_SLIGHT * change)) for change in changes]
        here = self.vector.design(point)
        did, marker, load = differentiate(here, others, self._motion(pieces, [here]))
        marker, load = marker / _SLIGHT, load / _SLIGHT
        slopes = _channels(marker, load)
        kept = np.abs(marker).reshape(len(marker), -1).max(axis=1) < _WILD
        by = {
            name: each / step
            for name, each, step, sane in zip(moving, slopes, steps, kept, strict=True)
            if sane
        }
        if not any(effect.acts() for effect in here.active) or len(by) < len(moving):
            return by
        known = np.isfinite(pieces.measured)

        def weighed(change: Array) -> Array:
            return np.where(known, change / noise, 0.0).reshape(len(change), -1)

        size = np.linalg.norm(weighed(slopes), axis=1)
        sides = np.random.default_rng(_PROBE).choice([-1.0, 1.0], len(steps))
        sides *= np.minimum(1.0, _PROBED * np.median(size) / np.maximum(size, 1e-9))
        probed = sides * [[True] * len(moving), *_of_each_cable(moving)]
        there = self.respond([point.after(each @ changes) for each in probed], pieces)
        found = weighed(there - _channels(did.marker, did.load))
        told = weighed(np.tensordot(probed, slopes, 1))
        size = np.linalg.norm(found, axis=1) * np.linalg.norm(told, axis=1)
        cosine = (found * told).sum(axis=1) / np.maximum(size, 1e-12)
        composed = any(isinstance(effect, Discovered) for effect in here.active)
        if not cosine[0] > (_TRUSTED_COMPOSED if composed else _TRUSTED):
            return {}
        wrong = probed[1:][(size[1:] > 0) & ~(cosine[1:] > _TRUSTED_CABLE)].any(axis=0)
        return {name: by[name] for name, lost in zip(moving, wrong, strict=True) if not lost}

    def _still(self, point: ParameterVector, pieces: Segments) -> dict[str, Array]:
        """Derivatives by gear friction and by the places of markers and cameras, which move nothing."""
        here = self.vector.design(point)
        gear = here.gear_friction / here.arm.servo.stall_torque
        turning = np.tanh(pieces.column["motor_velocity"] / (STANDING / 3))
        angle = pieces.column["joint_angle"]
        _, rotation = link_frames(angle, here.built)
        names, none, found = self.vector.names, np.zeros_like(pieces.measured), {}
        by = {each.name: n for n, each in enumerate(self.declared)}
        for j, name in enumerate(names["gear"]):
            found[name] = none.copy()
            found[name][..., 3 * N_JOINTS + j] = gear[j] * turning[..., j]
        for k, name in enumerate(names["marker"]):
            i, axis = divmod(k, 3)
            found[name] = none.copy()
            found[name][..., 3 * i : 3 * i + 3] = 1e-3 * rotation[..., i, :, axis]
        seen, one = markers(angle, here.built), np.eye(len(self.declared))
        for name in (*names["camera_shift"], *names["camera_turn"]):
            other = self.vector.design(point.after(one[by[name]])).built
            moved = markers(angle, other) - seen
            found[name] = none.copy()
            found[name][..., : 3 * N_JOINTS] = moved.reshape(*none.shape[:2], -1)
        return found

    def compare(self, point: ParameterVector | None, pieces: Segments) -> Comparison:
        """Measured beside predicted, with the quantities on which the residual may depend."""
        did = self.simulate([point], pieces) if point else self._nominal(pieces)
        arm = self.vector.design(point).built if point else self.vector.start.arm
        anchor, rotation = link_frames(did.joint_angle[0], arm)
        axis = (rotation @ arm.joint_axes[..., None])[..., 0]
        return Comparison(
            session=pieces.session,
            time=pieces.time,
            marker_measured=markers_of(pieces),
            marker_predicted=did.marker[0],
            load_measured=pieces.column["motor_load"],
            load_predicted=did.load[0],
            load_counts=np.isfinite(pieces.measured[..., 3 * N_JOINTS :]),
            motor_angle=pieces.column["motor_position"],
            motor_velocity=pieces.column["motor_velocity"],
            motor_command=pieces.column["motor_velocity_command"],
            joint_angle=did.joint_angle[0],
            tension=did.tension[0],
            joint_anchor=anchor,
            joint_axis=axis,
        )

    def _nominal(self, pieces: Segments) -> Response:
        nominal = replace(self, vector=replace(self.vector, start=NOMINAL_TWIN))
        return nominal.simulate([ParameterVector.nominal(self.declared)], pieces)

    @property
    def error_before_change(self) -> float:
        """Unknown."""
        return 0.0

    def pose_noise(self, pieces: Segments) -> float:
        """The cameras' [m]."""
        return camera_noise(pieces)

    def measured_again(
        self, pieces: Segments, point: ParameterVector, rng: np.random.Generator
    ) -> Segments:
        """Joint angles at the start from markers with the cameras' noise."""
        marker, joint = markers_of(pieces), pieces.column["joint_angle"].copy()
        noise = camera_noise(pieces) * rng.standard_normal(marker.shape)
        arm = self.vector.design(point).built
        joint[:, 0] = joints_from_markers((marker + noise)[:, 0], joint[:, 0], arm)
        return replace(pieces, column={**pieces.column, "joint_angle": joint})

    def write(
        self, point: ParameterVector, noise: Array, path: Path, about: Mapping[str, Any]
    ) -> None:
        """Write twin.json and twin.xml; the loads' noise is the residual of the case's last twin."""
        found = self.vector.design(point)
        load = [each.measure == LOADS for each in self.outputs]
        parameters = replace(found.parameters, load_noise=float(np.median(noise[load])))
        twin_model.write(path, replace(found, parameters=parameters), about)


def _channels(marker: Array, load: Array) -> Array:
    """Markers (D, S, T, 9, 3) and loads (D, S, T, 10) in the order of the outputs, (D, S, T, 37)."""
    return np.concatenate([marker.reshape(*marker.shape[:3], -1), load], axis=-1)


def _of_each_cable(names: Sequence[str]) -> list[list[bool]]:
    """Which coordinates are of each cable: of its strands and of its winch."""
    marks = [(f"cable{n}_", f"motor {n} ") for n in range(1, N_MOTORS + 1)]
    return [[any(mark in f"{name} " for mark in of) for name in names] for of in marks]
