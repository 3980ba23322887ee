"""Say which torques the arm's joints lacked where they were measured.

A slow arm passes through equilibria: where it was measured, cables and gravity balance whatever else acts on
its joints. By as much as they do so otherwise than at the pose of a twin whose motors went the same way, that
twin lacks a torque. However far the arm gave way, and whether cables went slack, changes nothing of that:
the pose is no linear answer to a strong force, but the torques are the sum of what acts.
"""

from collections.abc import Iterator

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS, link_frames
from serpent_twin.arrays import Array
from serpent_twin.machines.places import MissingTorques, PlaceResponse, by_forces
from serpent_twin.sim.arm_places import NAMES, centres_of_mass, levers
from serpent_twin.sim.response import Response
from serpent_twin.sim.statics import PASSES, against_gravity, strand_stiffness
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.tables.segments import Segments

_SIDES = np.tile([1.0, -1.0], N_MOTORS)
_RADII = ARM.pulley_radii


def missing_torques(twin: TwinModel, pieces: Segments, did: Response) -> MissingTorques:
    """Of S segments of T rows, in which a twin did so."""
    angle = pieces.column["joint_angle"]
    measured = np.where(np.isfinite(angle), angle, did.joint_angle)
    more = _tension_there(twin, pieces, did, measured) - did.tension
    winding = (_RADII * (more[..., 0::2] - more[..., 1::2])) @ PASSES
    holding = winding - against_gravity(measured) + against_gravity(did.joint_angle)
    return MissingTorques(-holding, tuple(_responses(measured)))


def _tension_there(twin: TwinModel, pieces: Segments, did: Response, measured: Array) -> Array:
    """Tension that the twin's strands would have in the measured pose [N], (S, T, 20)."""
    stiffness = strand_stiffness(twin)
    loose = np.minimum(_stretch(twin, pieces, did), 0.0)
    stretch = np.where(did.tension > 0, did.tension / stiffness, loose)
    passed = (measured - did.joint_angle) @ PASSES.T
    stretch = stretch - _SIDES * np.repeat(_RADII * passed, 2, axis=-1)
    return stiffness * np.maximum(stretch, 0.0)


def _stretch(twin: TwinModel, pieces: Segments, did: Response) -> Array:
    """Of each strand in the twin's pose, by its calibrated slack [m], (S, T, 20)."""
    ratio = 1.0 + np.asarray(twin.tolerances.winch_radius)
    wound = ratio * pieces.column["motor_position"] - did.joint_angle @ PASSES.T
    wound[..., -1] -= did.jaw_angle.reshape(wound.shape[:-1])
    slack = twin.parameters.strand_slack + np.asarray(twin.tolerances.strand_slack)
    return _SIDES * np.repeat(_RADII * wound, 2, axis=-1) - slack


def _responses(q: Array) -> Iterator[PlaceResponse]:
    """Torques on the joints by what may act on them and on the links, in poses (S, T, 9)."""
    for name, one in zip(NAMES["joint"], np.eye(N_JOINTS), strict=True):
        yield PlaceResponse("joint_torque", name, np.broadcast_to(one, q.shape)[None])
    origin, rotation = link_frames(q)
    middle, lever = centres_of_mass(origin, rotation), levers(q)
    for n, name in enumerate(NAMES["body"]):
        world = np.moveaxis(lever[..., n, :, :], -1, 0)
        for handle, by in by_forces(rotation[..., n, :, :], middle[..., n, :]):
            yield PlaceResponse(handle, name, by(world))
