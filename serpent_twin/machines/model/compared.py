"""Set what was measured of a machine beside what its twin predicts, in blocks that are judged one by one."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model.from_sites import seen_joints
from serpent_twin.residual import POSITION, Comparison
from serpent_twin.tables.segments import Segments

if TYPE_CHECKING:
    from serpent_twin.machines.model.machine import ModelMachine


def compared(machine: "ModelMachine", point: ParameterVector, pieces: Segments) -> Comparison:
    """Measured beside predicted, with what errors may depend on; blocks without a reading are left out."""
    predicted = machine.respond([point], pieces)[0]
    rows = min(machine.block_rows(pieces), pieces.time.shape[1])
    n = pieces.time.shape[1] // rows

    def blocks(values: Array) -> Array:
        return values[:, : n * rows].reshape(len(values) * n, rows, *values.shape[2:])

    known = np.isfinite(blocks(pieces.measured)).any(axis=(1, 2))
    drive = np.stack([pieces.column[column] for column in machine.drives], axis=-1)
    speed = np.gradient(drive, axis=1) / pieces.period[:, None, None]
    pose = len(machine.markers) * machine.outputs[0].measure.dimension
    measured, found = (blocks(values)[known] for values in (pieces.measured, predicted))
    shape = (*measured.shape[:2], len(machine.markers), -1)
    return Comparison(
        session=tuple(np.repeat(np.array(pieces.session), n)[known].tolist()),
        time=blocks(pieces.time)[known],
        marker_measured=measured[..., :pose].reshape(shape),
        marker_predicted=found[..., :pose].reshape(shape),
        marker=machine.outputs[0].measure,
        motor_angle=blocks(drive)[known],
        motor_velocity=blocks(speed)[known],
        marker_names=machine.markers,
        motor_names=tuple(machine.drives.values()),
        motors=machine.motors,
        **_beside_pose(machine, measured[..., pose:], found[..., pose:]),
        **_joints(machine, found, {c: blocks(v)[known] for c, v in pieces.column.items()}),
    )


def _joints(
    machine: "ModelMachine", predicted: Array, columns: Mapping[str, Array]
) -> dict[str, Any]:
    """The twin's hinges, by where it predicts sites among its channels, (S, T, C), and what it predicts of
    joints that are read; nothing where sites leave hinges open.
    """
    if machine.outputs[0].measure != POSITION:
        return {}
    rows = predicted.shape[:2]
    shown = {each.name: predicted[..., n] for n, each in enumerate(machine.outputs)}
    flat = {name: values.ravel() for name, values in {**columns, **shown}.items()}
    places = predicted[..., : 3 * len(machine.markers)].reshape(rows[0] * rows[1], -1)
    seen = seen_joints(machine.described, places, flat)
    if seen is None:
        return {}
    return {
        "joint_names": seen.names,
        "joint_angle": seen.angle.reshape(*rows, -1),
        "joint_anchor": seen.anchor.reshape(*rows, -1, 3),
        "joint_axis": seen.axis.reshape(*rows, -1, 3),
        "carries": seen.moves,
    }


def _beside_pose(machine: "ModelMachine", measured: Array, predicted: Array) -> dict[str, Any]:
    """The channels beside the pose, (S, T, C), as loads; nothing without any."""
    if not measured.shape[-1]:
        return {}
    return {
        "load_measured": measured,
        "load_predicted": predicted,
        "load": machine.outputs[-1].measure,
        "load_names": machine.others,
        "load_counts": np.ones(measured.shape, bool),
    }
