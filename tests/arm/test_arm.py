"""Test the arm's numbers and kinematics against ARM.md and MuJoCo."""

import mujoco
import numpy as np
import pytest

from serpent_twin.arm import geometry, mjcf
from serpent_twin.arm.geometry import ARM


@pytest.fixture(scope="module")
def model():
    return mjcf.build().compile()


def test_numpy_forward_kinematics_is_mujocos(model):
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    for q in rng.uniform(-np.pi, np.pi, (50, 9)):
        data.qpos[10:19] = q
        mujoco.mj_forward(model, data)
        sensed = np.stack([data.sensor(f"marker{i}").data for i in range(1, 10)])
        assert np.abs(sensed - geometry.markers(q)).max() < 1e-9


def test_leading_axes_are_free():
    q = np.random.default_rng(1).uniform(-1, 1, (4, 5, 9))
    assert np.array_equal(geometry.markers(q)[2, 3], geometry.markers(q[2, 3]))


def test_rotations_are_rotations():
    q = np.random.default_rng(2).uniform(-3, 3, (20, 9))
    rotation = geometry.link_frames(q)[1]
    assert np.allclose(rotation @ np.swapaxes(rotation, -1, -2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(rotation), 1)


def test_signs_of_odd_and_even_joints():
    """Positive odd joints swing the arm to +y, positive even ones to −z (right-handed about y)."""
    assert geometry.markers(np.eye(9)[0] * 0.1)[8, 1] > 0.05
    assert geometry.markers(np.eye(9)[1] * 0.1)[8, 2] < -0.04


def test_coupling_inverts_and_is_the_published_matrix():
    q = np.random.default_rng(3).normal(size=(7, 9))
    assert np.allclose(geometry.motor_from_joint(q), q @ geometry.COUPLING.T)
    assert np.allclose(geometry.joint_from_motor(geometry.motor_from_joint(q)), q)


def test_published_length_mass_and_radii():
    assert sum(ARM.link_length) == pytest.approx(0.545)
    assert sum(ARM.link_mass) == pytest.approx(0.308)
    assert ARM.pulley_radius[:2] == pytest.approx((0.020, 0.018))
    assert ARM.pulley_radius[8:] == pytest.approx((0.004, 0.004))
    assert ARM.joint_offset[8, 0] + sum(ARM.joint_offset[:8, 0]) == pytest.approx(0.440)


def test_compiled_masses_are_the_published_ones(model):
    moving = sum(model.body(f"link{i}").mass[0] for i in range(1, 10)) + model.body("jaw").mass[0]
    assert moving == pytest.approx(0.308, abs=1e-12)
    assert model.body_mass.sum() == pytest.approx(1.476, abs=1e-12)


def test_link_9_and_jaw_together_have_link_9s_inertia(model):
    """Composite inertia about link 9's centre by the parallel axis theorem, to the XML's nine digits."""
    link, jaw = model.body("link9"), model.body("jaw")
    centre = np.array([0.0525, 0, 0])
    total = np.zeros(3)
    for body, offset in ((link, np.zeros(3)), (jaw, jaw.pos)):
        d = offset + body.ipos - centre
        total += body.inertia + body.mass[0] * (d @ d - d**2)
    assert total == pytest.approx(ARM.link_inertia(8), rel=1e-8)
    masses = link.mass[0] * link.ipos + jaw.mass[0] * (jaw.pos + jaw.ipos)
    assert masses / 0.071 == pytest.approx(centre, abs=1e-9)
