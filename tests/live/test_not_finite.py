"""Test that an estimate or a rate that is not finite is refused in a sentence."""

import json
import math

import numpy as np
import pytest
import session_log
from learning_sessions import make_session, make_windows
from paths import DATA
from trainings import write, write_five
from typed import typed

from serpent_twin import sessions
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import WindowEstimator, find
from serpent_twin.live.estimate import estimate
from serpent_twin.live.follower import Follower
from serpent_twin.live.options import Estimate
from serpent_twin.readouts import Readout
from serpent_twin.readouts.linear import Linear
from serpent_twin.readouts.residual_mlp import ResidualMlp
from serpent_twin.training.train import Train, train
from serpent_twin.training.training_run import judged


@pytest.fixture
def linear() -> Readout:
    made = Linear(4)
    made.fit(make_windows(range(1, 4)), make_windows(range(4, 5)), np.random.default_rng(0))
    return made


@pytest.fixture
def spoiled(linear) -> Readout:
    linear.learned["slope"][3, 4] = np.nan
    return linear


def test_a_readout_without_numbers_is_refused_before_a_motor_turns(spoiled, tmp_path):
    with pytest.raises(
        SerpentError, match="linear gives an estimate that is not a number, of an arm that hangs"
    ):
        Follower(WindowEstimator(spoiled), 10)  # fmt: skip
    spoiled.learned["slope"][3, 4] = np.inf
    with pytest.raises(SerpentError, match="not a number"):
        Follower(WindowEstimator(spoiled), 10)


def test_an_observer_whose_covariances_are_no_numbers_is_refused():
    observer = find("observer")(4)
    few = make_windows(range(1, 2), rows=40)
    observer.fit(few, few, np.random.default_rng(0))
    Follower(observer, 10)
    observer.learned["rest"] = np.full_like(observer.learned["rest"], np.nan)
    with pytest.raises(SerpentError, match="observer gives a covariance that is not a number"):
        Follower(observer, 10)


def test_an_estimate_that_ceases_to_be_a_number_ends_the_run(linear, tmp_path, monkeypatch):
    linear.save(tmp_path / "model")
    whole, calls = Linear.predict, []

    def failing(self, x, start=None):
        calls.append(0)
        return whole(self, x, start) * (np.nan if len(calls) > 12 else 1.0)

    monkeypatch.setattr(Linear, "predict", failing)
    with pytest.raises(SerpentError, match=r"not a number, 3.25 s after the first row"):
        estimate(Estimate(tmp_path / "model", tmp_path / "out", steps=40, record=False))
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    assert not found["complete"] and "not a number" in found["ended"]
    assert (
        found["rows"] == 13 == len(sessions.read_session(tmp_path / "out" / "session_01.parquet"))
    )


@pytest.mark.parametrize("command", ["estimate", "replay"])
def test_a_command_says_so_and_exits_1(command, spoiled, tmp_path):
    spoiled.save(tmp_path / "model")
    write(tmp_path, make_session(1, rows=40))
    options = ["--model", "model", "--out", "out", "--steps", "8", "--no-record"]
    if command == "replay":
        options = ["session_01.parquet", "--readout", "model", "--out", "out.rrd"]
    done = typed(f"serpent_twin.{command}", *options, folder=tmp_path)
    assert done.returncode == 1, done.stdout
    assert done.stderr.count("error: ") == 1 and "Traceback" not in done.stderr
    assert not (tmp_path / "out.rrd").exists()


def test_a_score_of_no_number_names_the_readout(spoiled):
    with pytest.raises(SerpentError, match=r"linear gives .* not a number, in session_05"):
        judged(WindowEstimator(spoiled), make_windows(range(5, 6)), 0.0)


def test_a_training_that_diverges_is_no_training():
    network = ResidualMlp(4, width=8, layers=1, epochs=2, rate=1e30)
    windows = make_windows(range(1, 3), rows=60)
    with pytest.raises(SerpentError, match="training of residual_mlp diverged"):
        network.fit(windows, windows, np.random.default_rng(0))


# Rates


@pytest.mark.parametrize("rate", [math.nan, math.inf, -4.0, 0, True, "4", None, 10**400, 1e-9])
def test_a_session_has_a_rate_that_is_a_number(rate):
    with pytest.raises(SerpentError, match=r"session_01: rate_hz is .*, expected a number from"):
        session_log.make_session(rate_hz=rate)


def test_a_session_without_a_rate_says_so_when_asked():
    session = session_log.make_session()
    assert session.rate_hz == 4.0
    del session.metadata["rate_hz"]
    with pytest.raises(SerpentError, match="rate_hz is None"):
        _ = session.rate_hz


def test_a_log_with_such_a_rate_is_not_read(tmp_path):
    path = tmp_path / "session_01.parquet"
    session = session_log.make_session()
    session.metadata["rate_hz"] = math.nan
    with pytest.raises(SerpentError, match=r"session_01.parquet: the metadata: rate_hz is NaN"):
        sessions.write_session(path, session)
    with pytest.raises(SerpentError, match=r"session_02.journal: .*rate_hz is NaN"):
        sessions.Journal(tmp_path / "session_02.journal", session.metadata)


def test_a_readout_whose_rate_is_no_number_takes_no_rows(linear):
    linear.rate_hz = math.nan
    with pytest.raises(SerpentError, match="trained on rows at nan Hz"):
        linear.require_rate(4.0)
    linear.rate_hz = 4.0
    with pytest.raises(SerpentError, match="these come at nan Hz"):
        linear.require_rate(math.nan)


def test_train_ends_with_a_sentence_where_a_stored_readout_is_spoiled(tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    config = Train(write_five(logs), tmp_path / "out", ("linear",), threads=1)
    train(config)
    path = tmp_path / "out" / "models" / "linear" / "learned.npz"
    learned = dict(np.load(path))
    learned["slope"][0, 0] = np.nan
    np.savez(path, **learned)
    with pytest.raises(SerpentError, match="linear"):
        train(config)


def test_the_logs_of_the_project_have_rates():
    folder = DATA / "arm_a"
    assert {session.rate_hz for session in sessions.read_folder(folder)} == {4.0}
