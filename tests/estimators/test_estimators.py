"""Test that every estimator answers what callers ask, and that one file adds one."""

import re
import sys

import numpy as np
import pytest
from paths import ROOT

from serpent_twin import estimators
from serpent_twin.arm.geometry import joint_from_motor, markers
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import available, find, load
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.readouts.windows import Windows, cut
from serpent_twin.sessions import Session
from serpent_twin.sim.twin_model import NOMINAL_TWIN

LAG = 0.5


def windows(seed: int, rows: int = 60) -> Windows:
    """Windows of an arm with stiff cables whose motors wander, at 4 Hz."""
    time = np.arange(rows) / 4
    motor = np.cumsum(np.random.default_rng(seed).normal(0, 0.02, (rows, 10)), axis=0)
    arrays = {n: np.zeros((rows, 10)) for n in ("motor_velocity", "motor_load")}
    session = Session(
        None,
        {"rate_hz": 4.0},
        {
            "time": time,
            "joint_target": np.zeros((rows, 9)),
            "motor_position": motor,
            "motor_velocity_command": np.zeros((rows, 10)),
            "marker": markers(joint_from_motor(motor[:, :9])),
            **arrays,
        },
    )
    return cut([session], 4, drop=10)


@pytest.mark.parametrize("name", available())
def test_what_callers_ask_is_answered_before_training(name):
    estimator = find(name)()
    assert estimator.name == estimator.trained.name == name
    assert estimator.takes_twin == estimator.trained.takes("twin")
    assert estimator.own_twin == (NOMINAL_TWIN if estimator.takes_twin else None)
    assert estimator.warm_up_rows == 5 and not estimator.states_covariance
    if not estimator.takes_twin:
        with pytest.raises(SerpentError, match=f"{name} has no twin that could be replaced"):
            estimator.with_twin(NOMINAL_TWIN)


@pytest.mark.parametrize("name", ["linear", "residual"])
def test_a_readout_identifies_nothing_and_learns_nothing_from_markers_seen_later(name):
    estimator, seen = find(name)(), windows(2)
    estimator.trained.fit(windows(1), seen, np.random.default_rng(0))
    session = seen.sessions[0]
    live, told = estimator.live(), []
    for now in readings(session.log):
        told.append(live.update(now))
        live.correct(np.zeros((9, 3)))
    assert live.weighed() == {} and estimator.states_covariance
    followed = np.concatenate([belief.marker for belief in told[-len(session) :] if belief])
    np.testing.assert_allclose(followed, estimator.follow(session).marker, rtol=0, atol=1e-12)


@pytest.fixture
def added(tmp_path, monkeypatch):
    """The estimator of the documentation, as a file among the others."""
    text = (ROOT / "docs" / "extending.md").read_text()
    examples = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    (example,) = [each for each in examples if "TrainedEstimator)" in each]
    (tmp_path / "lagged_pose.py").write_text(example)
    monkeypatch.setattr(estimators, "__path__", [*estimators.__path__, str(tmp_path)])
    for cached in (estimators._kinds, available):
        cached.cache_clear()
    yield
    sys.modules.pop("serpent_twin.estimators.lagged_pose")
    for cached in (estimators._kinds, available):
        cached.cache_clear()


def test_a_file_is_all_that_a_new_estimator_takes(added, tmp_path):
    """It is found, trained, saved, loaded, and follows a session as a first-order lag does."""
    estimator, seen = find("lagged_pose")(lag=LAG), windows(2)
    estimator.trained.fit(windows(1), seen, np.random.default_rng(0))
    estimator.trained.save(tmp_path / "saved")
    again, session = load(tmp_path / "saved"), seen.sessions[0]
    angle = session.log.motor_position[0, :9].copy()
    expected = []
    for now in session.log.motor_position[:, :9]:
        angle = now + np.exp(-0.25 / LAG) * (angle - now)
        expected.append(markers(joint_from_motor(angle)))
    belief = again.follow(session)
    np.testing.assert_allclose(belief.marker, expected[-len(session) :], rtol=0, atol=1e-12)
    assert again.states_covariance and again.name == "lagged_pose"
    with pytest.raises(SerpentError, match="Did you mean lagged_pose"):
        find("lagged_poses")
