"""Test the calls in Python that load a robot with its logs, simulate it, and trace it."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from strange_robots import Form, written

import serpent_twin as st
from serpent_twin.errors import SerpentError
from serpent_twin.robots import CorrectedTwin


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("robot")
    written(Form("h", seed=4), place, seconds=8.0, logs=3)
    return place


@pytest.fixture(scope="module")
def robot(folder):
    return st.Machine.load(folder / "robot.xml", logs=f"{folder}/logs/*.csv")


def test_a_pattern_names_the_logs_in_order_and_nothing_is_written(robot, folder):
    assert [each.name for each in robot.logs] == ["run_1.csv", "run_2.csv", "run_3.csv"]
    assert sorted(each.name for each in folder.iterdir()) == ["logs", "robot.xml"]
    assert "[[drive]]" in robot.description


def test_the_residual_is_what_is_measured_minus_what_the_model_shows(robot):
    shown = st.simulate(robot)
    (name, left), *others = shown.residual.items()
    assert not others and left.shape == (*shown.time.shape, 1)
    assert st.residual(robot)[name] == pytest.approx(np.sqrt(np.nanmean(left**2)))
    assert 1e-5 < st.residual(robot)[name] < 0.05  # [rad], masses are 4 % off
    assert isinstance(shown.figure, Figure)


def test_the_machine_toml_of_init_is_loaded_alike(robot, folder, tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(robot.description)
    (tmp_path / "robot.xml").write_text((folder / "robot.xml").read_text())
    again = st.Machine.load(path, logs=[folder / "logs"])
    assert st.residual(again) == pytest.approx(st.residual(robot))


def test_logs_that_are_not_there_are_named():
    with pytest.raises(SerpentError, match=r"no file is named nowhere/\*\.csv"):
        st.Machine.load("robot.xml", logs="nowhere/*.csv")


@pytest.mark.parametrize("name", ["robot.xml", "machine.toml"])
def test_without_logs_a_sentence_says_what_to_give(name):
    with pytest.raises(SerpentError, match=r"no logs are given\. Name the robot's logs"):
        st.Machine.load(name)


def test_one_log_cannot_judge_itself(folder):
    one = st.Machine.load(folder / "robot.xml", logs=folder / "logs/run_1.csv")
    with pytest.raises(SerpentError, match="of 1 log, 1 cannot be held out"):
        st.trace(one)


def test_a_twin_is_saved_once(robot, tmp_path):
    case, _ = robot.open()
    point = st.robots.ParameterVector.nominal(case.declared)
    twin = CorrectedTwin(case, point, {"arm": "robot"})
    path = twin.save(tmp_path / "twin")
    assert path.with_suffix(".xml").exists()
    with pytest.raises(SerpentError, match="not overwritten"):
        twin.save(tmp_path / "twin")
    assert st.residual(robot, twin) == pytest.approx(st.residual(robot))


@pytest.mark.slow
def test_a_late_command_is_named_from_raw_logs(tmp_path):
    written(Form("h", seed=6, late=3), tmp_path, seconds=20.0, logs=3)
    robot = st.Machine.load(tmp_path / "robot.xml", logs=f"{tmp_path}/logs/*.csv")
    found = st.trace(robot, minutes=4, discover=False)
    (effect,) = found.effects
    delay = effect.parameters["delay"]
    assert effect.name.startswith("command_delay") and delay.low < 0.03 < delay.high
    assert found.error["corrected"] < found.error["calibrated"] < found.error["nominal"]
    assert "Command delay" in str(found) and "<html" in found._repr_html_()
    assert found.report(tmp_path / "page").exists()
    assert found.twin.save(tmp_path / "twin").exists()
