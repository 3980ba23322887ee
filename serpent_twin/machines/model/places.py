"""Say, along one simulated motion, what changes at the places of a model do to what is measured."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import (
    ACTUATOR_COMMAND,
    HANDLES,
    POSITIONS,
    READING_SHIFT,
    READINGS,
    Law,
)
from serpent_twin.engine.row_changes import against
from serpent_twin.machines.model.along import Along
from serpent_twin.machines.model.clocks import clocks_of, session_time
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.drives import commands
from serpent_twin.machines.model.from_sites import placed_joints
from serpent_twin.machines.model.motion import DrivenMotion, RowStates
from serpent_twin.machines.model.row_motion import ForcedRows, adapted, forced_rows
from serpent_twin.machines.model.seen import address
from serpent_twin.machines.model.seen_places import levers_at_rest, of_frame, of_motors, of_sensors
from serpent_twin.machines.model.springs import drives_on, single_joints
from serpent_twin.machines.model.things import joint_type, lengths
from serpent_twin.machines.places import LaggedResponse, Places, Response, by_forces
from serpent_twin.tables.segments import Segments

MOST = 40
"""Joints or bodies of a model at which laws are sought"""
_SLIDES = {"N m": "N", "rad": "m", "rad/s": "m/s"}
"""Units of a slide, in place of a hinge's"""
SI = {"mm": "m", "°": "rad", "1": "1"}
"""Units of commands, by those in which reports state them"""


def only_single(model: mujoco.MjModel) -> bool:
    """Whether all joints are hinges or slides, and few enough."""
    return model.njnt == model.nq == len(single_joints(model)) <= MOST


def units_of_law(machine: Described, law: Law) -> dict[str, str]:
    """The units of a law's size and of its form's parameters, by what turns, slides or is told."""
    told = {each.actuator: SI[machine.control_unit(each)[0]] for each in machine.commanded}
    size, of = HANDLES[law.handle].unit, READINGS[law.reading].unit if law.reading else ""
    size = _SLIDES.get(size, size) if _slides(machine.model, law.place) else size
    of = _SLIDES.get(of, of) if _slides(machine.model, law.where) else of
    size = told[law.place] if law.handle == ACTUATOR_COMMAND else size
    if law.handle == READING_SHIFT:
        size = {each.of[1]: each.measure.base for each in machine.about.measured}[law.place]
    return law.units(size, told[law.where] if law.reading == ACTUATOR_COMMAND else of)


def _slides(model: mujoco.MjModel, name: str) -> bool:
    """Whether what has a name is in metres."""
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
        return joint_type(model, name) == "slide"
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name) >= 0:
        return lengths(model, "tendon", name) == ("m",)
    return False


def clocks_and_commands(machine: Described, pieces: Segments) -> dict[tuple[str, str], Array]:
    """What laws may follow at rest and in motion, (S, T), by the reading and its place."""
    told, rows = commands(machine, pieces), session_time(pieces)
    names = [each.actuator for each in machine.commanded]
    return {
        **{(ACTUATOR_COMMAND, name): told[..., machine.model.actuator(name).id] for name in names},
        ("time", "session"): rows,
        ("runtime", "machine"): rows + clocks_of(pieces).prior_runtime[:, None],
    }


@dataclass(frozen=True)
class ModelPlaces(Places):
    """What S segments of T rows show of changes at a model's places. Readings are of the twin, and sensors
    need not show the pose.
    """

    machine: Described
    model: mujoco.MjModel
    """The twin's, of its first run"""
    measured: tuple[str, ...]
    """The thing that each channel is of, (C,)"""
    driven: DrivenMotion
    states: RowStates
    forced: ForcedRows
    pieces: Segments

    @classmethod
    def of(
        cls,
        machine: Described,
        measured: Sequence[str],
        motion: DrivenMotion,
        pieces: Segments,
    ) -> "ModelPlaces":
        """Responses to changes at a model's places along a motion of one twin."""
        states, varies = motion.recorded(), commands(machine, pieces).std(axis=(0, 1))
        forced = forced_rows(motion.driven, states, motion.seen, varies, few_bodies(machine.model))
        forced = replace(forced, motion=adapted(forced.motion, measured, motion, forced.free))
        model = motion.driven.models[0]
        return cls(machine, model, tuple(measured), motion, states, forced, pieces)

    @cached_property
    def readings(self) -> Mapping[tuple[str, str], Array]:
        """What laws may follow, (S, T), by the reading and its place."""
        found = clocks_and_commands(self.machine, self.pieces)
        motors = self.machine.winches if self._placed else ()
        for name, dof in self._joints:
            of = "motor" if name in motors else "joint"
            found[f"{of}_angle", name] = np.nan_to_num(self.states.pose[..., dof])
            found[f"{of}_velocity", name] = np.nan_to_num(self._mean_rate[..., dof])
        found |= positions_of_ends(self.machine.model, self._bodies, self._along)
        for k, n in enumerate(self._tendons):
            if not drives_on(self.model, "tendon", n):
                found["tension", self.model.tendon(n).name] = self._along.tension[k]
        efforts = self.machine.efforts if self._placed else ()
        levers = levers_at_rest(self.model)[self._tendons] if efforts else np.zeros((0, 0))
        for motor in efforts:
            by = levers[:, int(self.model.joint(motor).dofadr[0])]
            if by.any():
                found["horn_torque", motor] = np.tensordot(by, self._along.tension, axes=1)
        return found

    @cached_property
    def _mean_rate(self) -> Array:
        """Mean of the rates from each row to the next, (S, T, nv)."""
        out = self.states.rate.copy()
        out[:, :-1] = self.states.steps.velocity.mean(axis=2)
        return out

    @cached_property
    def responses(self) -> Sequence[Response]:
        """Responses to each quantity at each place where it shows: none of bodies of prescribed motion."""
        bodies, tendons = [*self._of_bodies()], [*self._of_tendons()]
        every = [
            *self._of_joints(),
            *bodies,
            *tendons,
            *self._of_commands(),
            *self._of_readings(),
            *self._of_placed(bodies, tendons),
        ]
        return [each for each in every if each.channels]

    @cached_property
    def _placed(self) -> bool:
        """Whether measured sites place joints."""
        return bool(placed_joints(self.machine))

    def _of_placed(
        self, bodies: Sequence[LaggedResponse], tendons: Sequence[LaggedResponse]
    ) -> Iterator[Response]:
        """Responses to changes at sensors, at motors whose motion is known and at the frame, where sites
        place the joints.
        """
        if not self._placed:
            return
        forces = {each.place: each for each in bodies if each.handle == "force"}
        yield from of_sensors(self.machine, self.driven, self.states, [*forces])
        yield from of_motors(
            self.machine, self.model, self.states, {each.place: each for each in tendons}
        )
        yield from of_frame(self.model, forces)

    @property
    def starts(self) -> Array | None:
        """Changes of the prediction by all states in which segments begin, (S, D, T, C), where readings say
        these; else None.
        """
        rows = self.forced.motion
        return rows.of_starts() if rows.adapts is not None else None

    @property
    def _joints(self) -> list[tuple[str, int]]:
        """Names of the machine's own joints, and their degrees of freedom, which are their place in the
        twin's pose: links that bend have further ones.
        """
        own = self.machine.model
        names = [name for n in range(own.njnt) if (name := own.joint(n).name)]
        return [(name, address(self.model, name)) for name in names]

    def _of_joints(self) -> Iterator[Response]:
        """Responses of joints whose motion is not prescribed: a prescribed joint absorbs any torque, which no
        sensor of MuJoCo shows.
        """
        prescribed = {each.joint for each in self.machine.prescribed}
        for name, dof in self._joints:
            if name in prescribed:
                continue
            own, rubs = self.forced.force_shows[dof], against(self.states.rate[..., [dof]])
            yield self._lagged("joint_torque", name, self.forced.by_force[dof][None], own[None])
            push = self.forced.by_friction[dof]
            yield self._lagged("joint_friction", name, push[None], (rubs * own)[None])

    def _lagged(self, handle: str, name: str, push: Array, own: Array) -> LaggedResponse:
        return LaggedResponse(handle, name, self.forced.motion, push, own)

    def _of_bodies(self) -> Iterator[LaggedResponse]:
        none = np.zeros((3, *self.pieces.measured.shape))
        for k, n in enumerate(self._bodies):
            push = np.einsum("stxv,vstd->xstd", self._along.by_joints[k], self.forced.by_force)
            shows = self.forced.push_shows
            own = none if shows is None else shows[k]
            name = self.machine.model.body(n).name
            for handle, by in by_forces(self._along.rotation[k], self._along.middle[k]):
                yield self._lagged(handle, name, by(push), by(own))

    @property
    def _bodies(self) -> list[int]:
        return few_bodies(self.machine.model)

    def _of_tendons(self) -> Iterator[LaggedResponse]:
        """Responses to the slack of tendons with a spring, where the spring pulls."""
        sprung = np.flatnonzero(self.model.tendon_stiffness).tolist()
        for n in self._tendons:
            of = sprung.index(n)
            push, own = self.forced.by_slack[of], self.forced.slack_shows[of]
            yield self._lagged("slack", self.model.tendon(n).name, push[None], own[None])

    @property
    def _tendons(self) -> list[int]:
        """Tendons with a spring and a name, if they are few; not those whose motion is prescribed."""
        model, held = self.model, {each.tendon for each in self.machine.prescribed}
        names = {int(n): model.tendon(n).name for n in np.flatnonzero(model.tendon_stiffness)}
        found = [n for n, name in names.items() if name and name not in held]
        found = [n for n in found if "m" in lengths(model, "tendon", names[n])]
        return found if len(found) <= MOST else []

    @cached_property
    def _along(self) -> Along:
        return Along.of(self.model, self._bodies, self._tendons, self.states.pose)

    def _of_commands(self) -> Iterator[Response]:
        for each in self.machine.commanded:
            n = self.machine.model.actuator(each.actuator).id
            push, own = self.forced.by_command[n], self.forced.command_shows[n]
            if push.any():
                yield self._lagged(ACTUATOR_COMMAND, each.actuator, push[None], own[None])

    def _of_readings(self) -> Iterator[Response]:
        known = self.machine.efforts if self._placed else ()
        for name, change in channels_alone(self.measured, self.pieces.time.shape):
            if name in known:  # a shift of its load
                continue
            yield self._lagged(READING_SHIFT, name, 0.0 * self.forced.by_force[:1], change)


def positions_of_ends(
    model: mujoco.MjModel, bodies: Sequence[int], along: Along
) -> dict[tuple[str, str], Array]:
    """Places [m], (S, T), of bodies that carry no other of them, by the reading and the body's name."""
    return {
        (axis, model.body(n).name): along.middle[k][..., x]
        for k, n in enumerate(bodies)
        if n not in model.body_parentid[bodies]
        for x, axis in enumerate(POSITIONS)
    }


def channels_alone(measured: Sequence[str], shape: tuple[int, ...]) -> Iterator[tuple[str, Array]]:
    """Each thing of which one channel is, among those of all channels, (C,); and that channel changed by 1 in
    every row, (1, S, T, C).
    """
    for k, name in enumerate(measured):
        if measured.count(name) == 1:
            change = np.zeros((1, *shape, len(measured)))
            change[..., k] = 1.0
            yield name, change


def moved_bodies(model: mujoco.MjModel) -> list[int]:
    """Bodies with joints and names."""
    return [n for n in range(1, model.nbody) if model.body_dofnum[n] and model.body(n).name]


def few_bodies(model: mujoco.MjModel) -> list[int]:
    """Bodies with joints and names, if they are at most `MOST`; else none."""
    found = moved_bodies(model)
    return found if len(found) <= MOST else []
