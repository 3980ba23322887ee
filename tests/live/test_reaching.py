"""The tip's place and its derivative are MuJoCo's, and poses reach their points."""

import mujoco
import numpy as np
import pytest

from serpent_twin.live.reaching import (
    NEAR,
    TIP,
    JointBounds,
    all_reached,
    reached,
    tip_jacobian,
    tips,
)
from serpent_twin.sim.twin_model import NOMINAL_TWIN

BOUNDS = JointBounds.usual()


@pytest.fixture(scope="module")
def poses():
    rng = np.random.default_rng(3)
    return rng.uniform(BOUNDS.low, BOUNDS.high, (20, 9))


def test_the_tip_and_its_derivative_are_those_of_mujoco(poses):
    model = NOMINAL_TWIN.spec(motors=False).compile()
    data = mujoco.MjData(model)
    joints = [model.joint(f"joint{j}") for j in range(1, 10)]
    link, base = model.body("link9").id, model.body(model.jnt_bodyid[joints[0].id]).parentid[0]
    for q in poses:
        for joint, angle in zip(joints, q, strict=True):
            data.qpos[joint.qposadr[0]] = angle
        mujoco.mj_forward(model, data)
        there = data.xpos[link] + data.xmat[link].reshape(3, 3) @ TIP
        turn = data.xmat[base].reshape(3, 3)
        np.testing.assert_allclose(tips(q), turn.T @ (there - data.xpos[base]), atol=1e-9)
        slope = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, slope, None, there, link)
        own = turn.T @ slope[:, [joint.dofadr[0] for joint in joints]]
        np.testing.assert_allclose(tip_jacobian(q)[1], own, atol=1e-9)


def test_where_a_pose_has_its_tip_a_pose_within_bounds_is_found(poses):
    points = tips(poses)
    for point in points:
        q = reached(point, BOUNDS)
        assert np.linalg.norm(tips(q) - point) < NEAR
        assert (q >= BOUNDS.low).all()
        assert (q <= BOUNDS.high).all()


def test_along_a_path_joints_do_not_jump():
    around = np.linspace(0, 2 * np.pi, 60)
    points = np.array([0.48, 0.0, -0.2]) + 0.03 * np.stack(
        [0 * around, np.cos(around), np.sin(around)], axis=1
    )
    found, short = all_reached(points, BOUNDS)
    assert (short < NEAR).all()
    assert np.abs(np.diff(found, axis=0)).max() < 0.05


def test_beyond_reach_the_nearest_place_is_found():
    q = reached(np.array([0.7, 0.0, 0.0]), BOUNDS)
    np.testing.assert_allclose(tips(q), [0.545, 0.0, 0.0], atol=0.02)
