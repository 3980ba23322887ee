"""A law that no catalogue lists is composed for a machine of which only an MJCF and CSV logs are known."""

import json

import moving_models
import numpy as np
import posed_models
import pytest

from serpent_twin.identification import Trace, trace
from serpent_twin.machines.machine import ParameterVector, effects_at
from serpent_twin.recording.traced import read

STOP = 1.2  # [N m/rad]
YIELDS, BEYOND = 0.5, 0.3  # of what the elbow is told beyond an angle [rad]


@pytest.fixture(scope="module")
def traced(tmp_path_factory):
    """A trace of a two-link arm whose elbow meets a bumper; its folder and what diagnosis.json holds."""
    folder = tmp_path_factory.mktemp("arm")
    path = moving_models.machine(folder)
    path.write_text('candidates = ["gravity"]\n' + path.read_text())
    for n in (1, 2, 3):
        moving_models.log(folder / "logs" / f"session_{n}.csv", n, stop=STOP)
    found = trace(Trace((folder / "logs",), folder / "trace", machine=path))
    return folder / "trace", found


@pytest.mark.slow
def test_a_bumper_is_composed_at_its_joint(traced):
    _, found = traced
    (law,) = found["effects"]
    assert law["name"] == "discovered"
    assert law["place"] == {"kind": "joint", "name": "elbow"}
    assert (law["changes"], law["law"]) == ("joint_torque", "beyond")
    assert law["depends_on"] == ["joint angle of elbow"]
    assert law["look_for"] == "a bumper, a hose or a spring"
    size, threshold = (law["parameters"][name] for name in ("size", "threshold"))
    assert size["value"] == pytest.approx(-STOP, rel=0.15)
    assert size["low"] < -STOP < size["high"]
    assert threshold["value"] == pytest.approx(0.1, abs=0.02)
    assert size["unit"] == "N m per rad"
    error = found["error_deg"]
    assert error["corrected"] < 0.1 * error["calibrated"]
    assert not found["unexplained"]["is"]


@pytest.mark.slow
def test_the_twin_and_the_plan_know_a_composed_law(traced):
    folder, _ = traced
    twin = json.loads((folder / "twin.json").read_text())
    assert any("joint_torque of elbow: beyond" in json.dumps(each) for each in twin["effects"])
    again = read(folder)
    (effect,) = effects_at(ParameterVector(again.fit.point.declared, again.fit.point.effects))
    assert effect.things == {"elbow"}
    assert [each for each in again.case.candidates if each.startswith("discovered@")]


def yielding(goals):
    """What reaches the motors if the elbow's gives half of what it is told beyond an angle."""
    return goals - np.array([0.0, YIELDS]) * np.maximum(goals - BEYOND, 0.0)


def test_a_drive_that_yields_is_composed_from_poses_at_rest(tmp_path):
    path = posed_models.machine(tmp_path / "arm")
    path.write_text('candidates = ["gravity"]\n' + path.read_text())
    for n in range(3):
        posed_models.log(tmp_path / "logs" / f"poses_{n}.csv", n, given=yielding)
    found = trace(Trace((tmp_path / "logs",), tmp_path / "trace", machine=path))
    (law,) = found["effects"]
    assert law["place"] == {"kind": "actuator", "name": "at_elbow"}
    assert (law["changes"], law["law"]) == ("command", "beyond")
    assert law["depends_on"] == ["command of at_elbow"]
    size, threshold = (law["parameters"][name] for name in ("size", "threshold"))
    assert size["value"] == pytest.approx(-YIELDS, rel=0.1)
    assert size["low"] < -YIELDS < size["high"]
    assert threshold["value"] == pytest.approx(BEYOND, abs=0.03)
    assert (size["unit"], threshold["unit"]) == ("rad per rad", "rad")
    assert found["error_mm"]["corrected"] < 0.6  # 0.48 mm is the mean length of its noise
