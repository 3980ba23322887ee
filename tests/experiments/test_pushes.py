"""Test how felt pushes are scored against logged pulses, on made-up torques and on the real pendulum."""

import json

import numpy as np
import pytest
from paths import SHARED

from experiments.pushes import __main__ as command
from experiments.pushes.logged import FREE, PUSHED, Recorded, pulses
from experiments.pushes.score import scored
from experiments.result_page import markdown
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.external_torque import ExternalTorque
from serpent_twin.tables.log import Log

TIME = np.arange(0.0, 20.0, 0.01)
MEASURED = SHARED / "measured"


def pulse(at, size, width=0.1):
    return size * np.exp(-0.5 * ((TIME - at) / width) ** 2)


def made(name, shoulder, elbow, **columns):
    """A log, and external torques felt in it."""
    log = Log(None, {}, {"time": TIME} | columns, label=name)
    return log, ExternalTorque(("shoulder", "elbow"), TIME, np.stack([shoulder, elbow], axis=1))


@pytest.fixture
def found():
    """Scores of a pulse that is felt, one that is not, a push at the other joint, and a false alarm."""
    rng = np.random.default_rng(0)
    noise = [[np.convolve(x, np.ones(9) / 9, "same") for x in 0.1 * rng.standard_normal((2, len(TIME)))]
             for _ in range(3)]  # fmt: skip
    (training, a), (judging, b) = made("training", *noise[0]), made("judging", *noise[1])
    torque = {"tau_pert1": pulse(5, -0.6), "tau_pert2": pulse(10, 0.6)}
    pushed, c = made(
        "pushed",
        0.1 * noise[2][0] + pulse(5.02, -0.5) + pulse(15, 0.4),
        0.1 * noise[2][1] + pulse(5, 0.3),
        tau_con1=0 * TIME,
        tau_meas1=pulse(5, -0.6) + pulse(15, 0.4),
        **torque,
    )
    logs = Recorded([training], [judging], [pushed])
    return scored(logs, [a, b, c], 5.0, 0.01)


def test_pulses_are_those_that_the_log_says(found):
    assert [(each["joint"], round(each["time"], 2)) for each in found["pulses"]] == [
        ("shoulder", 5.0),
        ("elbow", 10.0),
    ]
    felt, missed = (each["felt"] for each in found["pulses"])
    assert felt["time"] == pytest.approx(5.02, abs=0.02)
    assert felt["size"] == pytest.approx(-0.5, abs=0.02) and missed is None


def test_a_push_at_the_other_joint_is_no_false_alarm(found):
    (other,), (alarm,) = found["other_joint"], found["alarms"]
    assert (other["joint"], alarm["joint"]) == ("elbow", "shoulder")
    assert alarm["time"] == pytest.approx(15, abs=0.02) and alarm["log"] == "pushed"
    assert alarm["undelivered"] == pytest.approx(0.4, abs=0.1)
    assert found["seconds"]["unpushed"] == pytest.approx(20, abs=0.1)
    assert found["seconds"]["pushed"] == pytest.approx(20 - 2 * 0.49, abs=0.1)


def test_a_log_without_pulses_has_none():
    log, _ = made("quiet", TIME, TIME, tau_pert1=0 * TIME, tau_pert2=0 * TIME)
    assert pulses(log) == []


def test_a_folder_without_logs_is_named(tmp_path):
    with pytest.raises(
        SerpentError, match=rf"{FREE} holds no \*\.csv\. docs/results/measured-logs"
    ):
        command.main(command.Pushes(tmp_path, tmp_path / "out"))


@pytest.mark.slow
@pytest.mark.skipif(not MEASURED.exists(), reason="logs of measured machines are not here")
def test_pulses_of_the_real_pendulum_are_felt(tmp_path):
    data = tmp_path / "data"
    (data / FREE).mkdir(parents=True)
    for log in (MEASURED / "dfki_double_pendulum").glob("C0_*.csv"):
        (data / FREE / log.name).symlink_to(log)
    (data / PUSHED).symlink_to(MEASURED / PUSHED)
    command.main(command.Pushes(data, tmp_path / "out", shortest=(0.17,)))
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    of = results["durations"][0]["twins"]["corrected"]
    assert [each["joint"] for each in of["pulses"]] == ["elbow", "shoulder"]
    for each in of["pulses"]:
        assert each["felt"]["time"] == pytest.approx(each["time"], abs=0.03)
        assert each["felt"]["size"] == pytest.approx(each["size"], abs=0.15)
    assert not of["other_joint"] and len(of["alarms"]) <= 3
    assert "| shoulder | 3.90 | -0.59 |" in markdown(results)
