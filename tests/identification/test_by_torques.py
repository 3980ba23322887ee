"""Test that what acts on an arm is found by the torques that its joints lacked, however far it gave way."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from motion import wander

from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import Law
from serpent_twin.identification.discovery.by_torques import screened_by_torques
from serpent_twin.machines.arm.places import ArmPlaces
from serpent_twin.machines.places import PlacesInRow, response_at
from serpent_twin.sim.many_twins import impose
from serpent_twin.sim.twin_model import NOMINAL_TWIN

FORCE = np.array([-0.2, 0.5, 0.1])  # [N]
LINK = "link9"


@pytest.fixture(scope="module")
def pushed():
    """Places of an arm of which the twin does not know that something pushes its last link."""
    motion = wander(160, stretches=3)
    law = Discovered(*FORCE, at=f"force of {LINK}: constant")
    none = replace(law, size=0.0, size_y=1e-9, size_z=0.0)
    both = impose([NOMINAL_TWIN.with_effect(each) for each in (law, none)], motion)
    did, twin_did = (both.each(lambda v, n=n: v[n, :, 20:]) for n in (0, 1))
    pieces = SimpleNamespace(
        column={
            "joint_angle": did.joint_angle,
            "motor_position": motion.motors.angle[:, 20:],
            "motor_velocity": motion.motors.velocity[:, 20:],
        },
        time=motion.motors.time[:, 20:],
        marker=did.marker,
        prior_runtime=np.zeros(3),
        measured=np.zeros((3, 140, 37)),
    )
    return ArmPlaces(NOMINAL_TWIN, pieces, twin_did), did, twin_did


def of_force(residual, changes):
    """The constant force that removes most of a residual."""
    rows = np.moveaxis(changes, 0, -1).reshape(-1, 3)
    return np.linalg.lstsq(rows, residual.reshape(-1), rcond=None)[0]


def test_torques_tell_a_strong_force_where_the_pose_does_not(pushed):
    places, did, twin_did = pushed
    moved = np.linalg.norm(did.marker - twin_did.marker, axis=-1)[..., -1]
    assert np.median(moved) > 0.03  # no small change
    missing = places.missing_torques
    at = Law("force", LINK)
    by_torque = of_force(missing.torque, response_at(missing, at).change)
    off = (did.marker - twin_did.marker).reshape(*moved.shape, -1)
    by_pose = of_force(off, response_at(places, at).change[..., :27])
    assert np.linalg.norm(by_torque - FORCE) < 0.15 * np.linalg.norm(FORCE)
    assert np.linalg.norm(by_pose - FORCE) > 2 * np.linalg.norm(by_torque - FORCE)


def test_the_law_of_a_force_is_among_the_first(pushed):
    places, *_ = pushed
    best = screened_by_torques(places)[0]
    assert best.law.place == LINK and best.share > 0.8


def test_a_machine_that_does_not_say_has_none():
    assert screened_by_torques(PlacesInRow({}, [])) == []
