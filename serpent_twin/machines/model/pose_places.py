"""Say what changes at a model's places do to the poses in which it rests."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import (
    ACTUATOR_COMMAND,
    FORCES,
    HANDLES,
    POSITIONS,
    READING_SHIFT,
    Law,
)
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model.at_rest import TwinAtRest
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.places import (
    channels_alone,
    clocks_and_commands,
    moved_bodies,
)
from serpent_twin.machines.model.pose_changes import PoseChanges
from serpent_twin.machines.model.things import joints_moving, lengths
from serpent_twin.machines.places import PlaceResponse, PlacesInRow, with_more
from serpent_twin.tables.segments import Segments

T = TypeVar("T")
_MOST = 12
"""Joints, bodies or tendons at which laws of poses are sought: each takes a search for rests"""
_SHARE = 0.1
"""Change of a command as a fraction of its scatter in the logs: dry friction absorbs a smaller one"""
_STILL = 1e-9
"""Scatter [rad, m or 1] below which a command is the same in all rows"""
_ROUNDING = 1e-6
"""Fraction of the largest response to one quantity, below which a response is finite-difference error"""


def places_at_rest(
    twin: TwinAtRest,
    respond: Callable[[Sequence[ParameterVector], Segments], Array],
    point: ParameterVector,
    pieces: Segments,
) -> PlacesInRow:
    """Responses of a twin at rest to unit changes at its places; those to torques, forces and slack neglect
    dry friction.
    """
    machine, measured, shape = twin.machine, twin.measured, pieces.time.shape
    laws, followed = _laws(machine), _followed(machine.model)
    readings = {each: np.zeros(shape) for each in followed}
    changes = [np.zeros((HANDLES[law.handle].components, *shape, len(measured))) for law in laws]
    names = {name for _, name in followed} | {law.place for law in laws}
    for which, posed in twin.parts(pieces) if names else ():
        part = PoseChanges(posed, twin.rests, frozenset(names))
        for each in followed:
            readings[each][which] = part.reading(*each)
        for law, change in zip(laws, changes, strict=True):
            change[:, which] = part.change(law)
    found = [
        PlaceResponse(law.handle, law.place, change)
        for law, change in zip(laws, changes, strict=True)
    ]
    commands = _of_commands(machine, respond, point, pieces)
    return PlacesInRow(
        clocks_and_commands(machine, pieces) | readings,
        [*_shown(found), *commands, *_of_readings(twin, shape)],
    )


def _laws(machine: Described) -> list[Law]:
    """A constant change at each place where one is sought: nothing that acts on what is prescribed shows."""
    model, held = machine.model, {each.of for each in machine.prescribed}
    joints = [name for name in _joints(model) if ("joint", name) not in held]
    tendons = [name for name in _tendons(model) if ("tendon", name) not in held]
    bodies = [n for n in moved_bodies(model) if _moves(model, n, held)]
    return [
        *(Law("joint_torque", name) for name in joints),
        *(Law(force, model.body(n).name) for n in _few(bodies) for force in FORCES),
        *(Law("slack", name) for name in tendons),
    ]


def _followed(model: mujoco.MjModel) -> list[tuple[str, str]]:
    """The readings of poses, and of which place each is."""
    bodies = moved_bodies(model)
    ends = [model.body(n).name for n in bodies if n not in model.body_parentid[bodies]]
    return [
        *(("joint_angle", name) for name in _joints(model)),
        *((axis, name) for name in _few(ends) for axis in POSITIONS),
        *(("tension", name) for name in _tendons(model)),
    ]


def _joints(model: mujoco.MjModel) -> list[str]:
    return _few([name for n in range(model.njnt) if (name := model.joint(n).name)])


def _tendons(model: mujoco.MjModel) -> list[str]:
    """Names of a few tendons that have a spring, or drives that set their length [m]."""
    names = [name for n in range(model.ntendon) if (name := model.tendon(n).name)]
    pull = {model.tendon(n).name for n in np.flatnonzero(model.tendon_stiffness)}
    on_tendon = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    servos = np.flatnonzero(on_tendon & (model.actuator_biasprm[:, 1] != 0))
    pull |= {model.tendon(int(n)).name for n in model.actuator_trnid[servos, 0]}
    return _few([name for name in names if name in pull and "m" in lengths(model, "tendon", name)])


def _moves(model: mujoco.MjModel, body: int, held: Collection[tuple[str, str]]) -> bool:
    """Whether a body has a joint, or is on one that has, which is not prescribed."""
    return any(("joint", model.joint(n).name) not in held for n in joints_moving(model, body))


def _few(several: Sequence[T]) -> list[T]:
    """Select at most `_MOST` items, at even steps and the last included: in a long chain, what acts on
    neighbours moves it nearly alike.
    """
    if len(several) <= _MOST:
        return [*several]
    return [several[n] for n in np.linspace(0, len(several) - 1, _MOST).round().astype(int)]


def _shown(found: Sequence[PlaceResponse]) -> Iterator[PlaceResponse]:
    """Keep the responses that show in what is measured, and set what is finite-difference error to zero."""
    for each in found:
        most = max(np.abs(one.change).max() for one in found if one.handle == each.handle)
        change = np.where(np.abs(each.change) > _ROUNDING * most, each.change, 0.0)
        if change.any():
            yield replace(each, change=change)


def _of_readings(twin: TwinAtRest, shape: tuple[int, ...]) -> Iterator[PlaceResponse]:
    """Shifts of the measured angles."""
    joints = [each.angle_of for each in twin.machine.about.measured if each.angle_of]
    for name, change in channels_alone(twin.measured, shape):
        if name in joints:
            yield PlaceResponse(READING_SHIFT, name, change)


def _of_commands(
    machine: Described,
    respond: Callable[[Sequence[ParameterVector], Segments], Array],
    point: ParameterVector,
    pieces: Segments,
) -> list[PlaceResponse]:
    """Responses to commands by finite differences: the twin is settled again for each actuator, with its
    command changed a little.
    """
    laws, steps = [], []
    for (reading, name), x in clocks_and_commands(machine, pieces).items():
        if reading == ACTUATOR_COMMAND and np.std(x) > _STILL:
            laws.append(Law(ACTUATOR_COMMAND, name))
            steps.append(_SHARE * float(np.std(x)))
    if not laws:
        return []
    changed = [with_more(point, law, 0, step) for law, step in zip(laws, steps, strict=True)]
    usual, *found = respond([point, *changed], pieces)
    return [
        PlaceResponse(ACTUATOR_COMMAND, law.place, np.nan_to_num((there - usual)[None] / step))
        for law, there, step in zip(laws, found, steps, strict=True)
    ]
