"""Say what changes at a model's places do to the torques that its motion needs."""

from collections.abc import Iterator, Mapping, Sequence

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import JOINT_FRICTION, READING_SHIFT
from serpent_twin.machines.model.along import Along
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.known_motion import STANDING, rate_column
from serpent_twin.machines.model.places import (
    channels_alone,
    clocks_and_commands,
    few_bodies,
    positions_of_ends,
)
from serpent_twin.machines.model.seen import address
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.machines.places import PlaceResponse, PlacesInRow, by_forces
from serpent_twin.tables.segments import Segments


def places_of_torques(
    machine: Described,
    model: mujoco.MjModel,
    measured: Sequence[str],
    pieces: Segments,
    pose: Array,
) -> PlacesInRow:
    """Responses of the torques of a twin's model in poses (S, T, nq): each in its own row, exactly."""
    rate = {
        each.joint: pieces.column[rate_column(each.column)] / pieces.period[:, None]
        for each in machine.prescribed
    }
    joints = {name: address(model, name) for name in rate}
    bodies = few_bodies(model)
    along = Along.of(model, bodies, [], pose)
    readings = clocks_and_commands(machine, pieces) | positions_of_ends(model, bodies, along)
    for name, at in joints.items():
        readings["joint_angle", name] = pose[..., at]
        readings["joint_velocity", name] = rate[name]
    shape = (*pieces.time.shape, len(measured))
    channel = {name: measured.index(name) for name in machine.efforts}
    found = [*_of_joints(channel, rate, shape), *_of_bodies(model, bodies, along, channel, shape)]
    shifts = [
        PlaceResponse(READING_SHIFT, name, change)
        for name, change in channels_alone(measured, pieces.time.shape)
        if name not in channel  # a shift of its torque
    ]
    return PlacesInRow(readings, [each for each in (*found, *shifts) if each.channels])


def _of_joints(
    channel: Mapping[str, int], rate: Mapping[str, Array], shape: tuple[int, ...]
) -> Iterator[PlaceResponse]:
    """A torque on a joint, which its motor need not give, and friction, which it must overcome."""
    for name, c in channel.items():
        torque, friction = np.zeros((1, *shape)), np.zeros((1, *shape))
        torque[..., c] = -1.0
        friction[..., c] = np.tanh(rate[name] / STANDING)
        yield PlaceResponse("joint_torque", name, torque)
        yield PlaceResponse(JOINT_FRICTION, name, friction)


def _of_bodies(
    model: mujoco.MjModel,
    bodies: Sequence[int],
    along: Along,
    channel: dict[str, int],
    shape: tuple[int, ...],
) -> Iterator[PlaceResponse]:
    """Forces on bodies."""
    single = {model.joint(int(n)).name: int(model.jnt_dofadr[n]) for n in single_joints(model)}
    for k, n in enumerate(bodies):
        push = np.zeros((3, *shape))
        for name, c in channel.items():
            push[..., c] = -np.moveaxis(along.by_joints[k, ..., single[name]], -1, 0)
        for handle, by in by_forces(along.rotation[k], along.middle[k]):
            yield PlaceResponse(handle, model.body(n).name, by(push))
