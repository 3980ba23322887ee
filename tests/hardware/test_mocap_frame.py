"""Test that a rigid motion is found where there is one, and an undetermined one is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from serpent_twin.arm.geometry import markers
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import Rigid, fit_rigid
from serpent_twin.hardware.cameras import NoMocap
from serpent_twin.sessions.labels import named
from serpent_twin.sessions.search import masked_correlation


def test_a_known_motion_is_recovered_and_agrees_with_scipy():
    rng = np.random.default_rng(0)
    points, shift = rng.normal(size=(9, 3)), np.array([1.0, -2.0, 3.0])
    turn = Rotation.from_rotvec([0.3, -2.0, 1.0])
    goal = turn.apply(points) + shift + 1e-3 * rng.normal(size=(9, 3))
    found = fit_rigid(points, goal)
    independent, _ = Rotation.align_vectors(goal - goal.mean(axis=0), points - points.mean(axis=0))
    assert found.rotation == pytest.approx(independent.as_matrix(), abs=1e-12)
    left = np.linalg.norm(found.apply(points) - goal, axis=-1)
    assert found.residual == pytest.approx(np.sqrt((left**2).mean())) and found.count == 9
    assert found.inverse().apply(found.apply(points)) == pytest.approx(points)


def test_a_mirror_image_is_not_answered_by_a_reflection():
    points = np.random.default_rng(1).normal(size=(9, 3))
    found = fit_rigid(points, points * [1, 1, -1])
    assert np.linalg.det(found.rotation) == pytest.approx(1.0) and found.residual > 0.1


def test_lost_points_are_left_out_and_planar_ones_suffice():
    points = np.c_[np.random.default_rng(2).normal(size=(6, 2)), np.zeros(6)]
    goal = Rotation.from_rotvec([1.0, 2.0, 0.5]).apply(points)
    goal[2] = np.nan
    found = fit_rigid(points, goal)
    assert found.count == 5 and found.residual < 1e-12 and np.linalg.det(found.rotation) > 0


def test_open_fits_are_refused_but_the_straight_arm_is_not():
    line = np.outer(np.arange(9.0), [1, 2, 3])
    with pytest.raises(SerpentError, match="lie on a line"):
        fit_rigid(line, line)
    with pytest.raises(SerpentError, match="there are 2"):
        fit_rigid(np.eye(3)[:2], np.eye(3)[:2])
    straight = markers(np.zeros(9))
    assert fit_rigid(straight, straight).rotation == pytest.approx(np.eye(3))


def test_a_frame_file_comes_back_and_a_damaged_one_is_refused(tmp_path):
    path = tmp_path / "frame.json"
    rigid = Rigid(Rotation.from_rotvec([1, 2, 3]).as_matrix(), np.array([1.0, 2.0, 3.0]), 0.001, 9)
    rigid.save(path, {"labels": ["a"]})
    again = Rigid.load(path)
    assert np.array_equal(again.rotation, rigid.rotation) and again.count == 9
    path.write_text(path.read_text().replace('"translation_m"', '"translation"'))
    with pytest.raises(SerpentError, match=r"frame\.json: it lacks translation_m"):
        Rigid.load(path)
    Rigid(np.diag([1.0, 1.0, -1.0]), np.zeros(3)).save(path)
    with pytest.raises(SerpentError, match="no rotation matrix"):
        Rigid.load(path)


def test_masked_correlation_is_pearsons_r_of_what_is_seen():
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(2, 40)), rng.normal(size=100)
    y[rng.random(100) < 0.2] = np.nan
    r, pairs = masked_correlation(x, y)
    for lag in (-20, 0, 37, 80):
        i = np.arange(max(0, -lag), min(40, 100 - lag))
        i = i[np.isfinite(y[i + lag])]
        assert pairs[lag + 39] == len(i)
        for n in range(2):
            assert r[n, lag + 39] == pytest.approx(np.corrcoef(x[n, i], y[i + lag])[0, 1])


def test_names_that_end_in_1_to_9_are_labels_and_unlabelled_ones_are_not():
    arm = [f"arm:Marker {n:03d}" for n in range(1, 10)]
    assert named(["Unlabeled 1", *reversed(arm)]) == list(range(9, 0, -1))
    assert named([f"Unlabeled:10{n}" for n in range(1, 10)]) is None
    assert named([*arm, *(f"other{n}" for n in range(1, 10))]) is None
    with pytest.raises(SerpentError, match="the take has no x"):
        named(arm, ["x", *arm[1:]])


def test_no_mocap_is_all_lost():
    with NoMocap() as mocap:
        frame = mocap.read()
    assert frame.position.shape == (9, 3) and np.isnan(frame.position).all()
