"""Test that a planned motion is replayed exactly, within limits, and refused where it does not fit."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from serpent_twin.arm.control import target_bounds
from serpent_twin.arm.geometry import joint_from_motor
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.limits import Limits
from serpent_twin.recording import motion
from serpent_twin.recording.arm_motions import KINDS, made_targets, simulated
from serpent_twin.recording.collect import collect
from serpent_twin.recording.motion import Motion
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_session
from serpent_twin.sim.twin_model import NOMINAL_TWIN


def planned(steps=24, rate_hz=4.0, **about):
    low, high = target_bounds()
    targets = np.random.default_rng(0).uniform(low, high, (steps, 9))
    return Motion(targets, rate_hz, {"rig": "arm", **about})


def test_the_targets_come_back_to_the_bit(tmp_path):
    motion.write(tmp_path / "motion.parquet", planned())
    config = Collect(tmp_path / "logs", motion=tmp_path / "motion.parquet", sessions=2, workers=1)
    for path in collect(config):
        session = read_session(path)
        np.testing.assert_array_equal(session.joint_target, planned().targets)
        assert "motion_sha256" in session.metadata["config"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_motion_keeps_the_limits_and_ends_straight(kind):
    targets = made_targets(kind, 20.0, 4.0, np.random.default_rng(1))
    low, high = target_bounds()
    assert targets.shape == (80, 9) and (targets >= low).all() and (targets <= high).all()
    assert not targets[-8:].any() and np.abs(targets).max() > np.deg2rad(5)
    session = simulated(NOMINAL_TWIN, targets, 4.0, 1)
    limits = Limits()
    assert np.abs(joint_from_motor(session.motor_position[:, :9])).max() < limits.joint_angle
    assert np.abs(session.motor_velocity_command).max() <= limits.velocity
    assert np.abs(session.motor_load).max() < limits.load
    assert np.abs(joint_from_motor(session.motor_position[-1, :9])).max() < np.deg2rad(3)


def refusal(path, tmp_path, **how):
    with pytest.raises(SerpentError) as caught:
        collect(Collect(tmp_path / "logs", motion=path, sessions=1, workers=1, **how))
    assert not (tmp_path / "logs").exists()
    return str(caught.value)


def test_what_does_not_fit_is_refused_with_what_to_do(tmp_path):
    path = tmp_path / "motion.parquet"
    motion.write(path, planned())
    assert "--rate-hz 4" in refusal(path, tmp_path, rate_hz=10.0)
    assert "--motion" in refusal(path, tmp_path, steps=50)
    motion.write(path, planned(arm="arm_1"))
    assert "Give --arm arm_1" in refusal(path, tmp_path)
    assert (
        len(
            collect(Collect(tmp_path / "of_arm_1", motion=path, sessions=1, workers=1, arm="arm_1"))
        )
        == 1
    )
    motion.write(path, planned(rig="trunk"))
    assert "only the arm" in refusal(path, tmp_path)
    motion.write(path, replace(planned(), targets=planned().targets + 1.0))
    assert "the target of joint" in refusal(path, tmp_path)
    motion.write(path, replace(planned(), targets=np.full((5, 9), np.nan)))
    assert "the target of joint" in refusal(path, tmp_path)


def test_damaged_files_are_refused(tmp_path):
    path = tmp_path / "motion.parquet"
    motion.write(path, planned())
    whole = pq.read_table(path)
    pq.write_table(whole.slice(0, 10), path)
    assert "not those that were planned" in refusal(path, tmp_path)
    path.write_bytes(path.read_bytes()[:200])
    assert "not a whole Parquet file" in refusal(path, tmp_path)
    pq.write_table(whole.replace_schema_metadata({}), path)
    assert "no planned motion" in refusal(path, tmp_path)
