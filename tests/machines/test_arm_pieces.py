"""Test what is told of the cameras from an arm's logs."""

from dataclasses import replace

import numpy as np
import pytest
from paths import DATA

from serpent_twin.arm.geometry import ARM, markers
from serpent_twin.machines.arm.pieces import ArmPieces, camera_noise, cut
from serpent_twin.sessions import read_session

NOISE = 2.5e-4  # [m]


@pytest.fixture(scope="module")
def rigid() -> ArmPieces:
    """The poses of a logged arm, its markers where rigid links have them, and white noise."""
    log = read_session(DATA / "arm_a" / "session_01.parquet")[:800]
    pieces = cut([log], ARM)
    where = markers(pieces.joint_angle)
    return replace(
        pieces, marker=where + NOISE * np.random.default_rng(1).standard_normal(where.shape)
    )


def test_the_noise_of_the_cameras_is_what_no_pose_explains(rigid):
    assert camera_noise(rigid) == pytest.approx(NOISE, rel=0.05)
    lost = replace(rigid, marker=np.full_like(rigid.marker, np.nan))
    assert camera_noise(lost) == 0.0


def test_what_moves_slowly_beside_every_pose_is_no_noise_of_the_cameras(rigid):
    """Links that twist, or a marker that is knocked: a bar that counted them would pass any such fault."""
    twist = 6e-3 * np.sin(2 * np.pi * rigid.motors.time / 15.0)
    moved = rigid.marker.copy()
    moved[:, :, 3:, 2] += twist[..., None] * np.linspace(0.5, -0.7, 6)
    assert camera_noise(replace(rigid, marker=moved)) == pytest.approx(NOISE, rel=0.1)
