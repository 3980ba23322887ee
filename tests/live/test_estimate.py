"""Test that live estimates equal the readout's on the log, and use the motor bus alone."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_runs import STEPS, estimated, logged, spread, train_few

from serpent_twin.arm.geometry import joint_from_motor, markers
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.emulator.child import running
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import Estimator, load
from serpent_twin.estimators.belief import Belief
from serpent_twin.live.estimate import estimate
from serpent_twin.live.follower import LATENCY, Follower
from serpent_twin.live.options import Estimate
from serpent_twin.readouts.windows import Windows, cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect, RealArm
from serpent_twin.sessions import Session, examine, read_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A readout of windows and an observer, trained on a few rows of the twin at 4 Hz."""
    folder = tmp_path_factory.mktemp("trained")
    train_few(folder, ("residual", "observer"))
    return folder


@pytest.fixture(scope="module")
def runs(models, tmp_path_factory):
    """One run of each."""
    folder = tmp_path_factory.mktemp("runs")
    results = {
        name: estimate(Estimate(models / name, folder / name, steps=STEPS, record=False))
        for name in ("residual", "observer")
    }
    return folder, results


def followed(estimator: Estimator, session: Session) -> Belief:
    return estimator.follow(cut([session], estimator.trained.window, drop=0).sessions[0])


@pytest.mark.parametrize("name", ["residual", "observer"])
def test_live_estimates_are_those_of_the_written_log(name, models, runs):
    session, estimator = logged(runs[0] / name), load(models / name)
    offline, first = followed(estimator, session), estimator.trained.window - 1
    live, expected = estimated(session), spread(session)
    np.testing.assert_allclose(live[first:], offline.marker, rtol=0, atol=1e-9)
    np.testing.assert_allclose(expected[first:], offline.spread, rtol=0, atol=1e-9)
    assert np.isnan(live[:first]).all() == (name == "residual")  # an observer knows at once
    assert not [f for f in examine(session) if f.level == "error"]


@pytest.mark.parametrize("name", ["residual", "observer"])
def test_results_are_what_the_log_says(name, models, runs):
    session, found = logged(runs[0] / name), runs[1][name]
    assert json.loads((runs[0] / name / "results.json").read_text()) == found
    far = 1e3 * np.linalg.norm(estimated(session) - session.marker, axis=-1)
    assert found["mean_error_mm"] == pytest.approx(np.nanmean(far))
    assert found["mean_spread_mm"] == pytest.approx(1e3 * np.nanmean(spread(session)))
    offline = followed(load(models / name), session)
    if name == "residual":
        assert found["coverage_95"] == pytest.approx(offline.coverage(session.marker[3:]))
    assert 0.7 < found["coverage_95"] <= 1 and found["mean_error_mm"] < 20
    latency = session.extra[LATENCY]
    assert found["rows"] == STEPS and found["rows_estimated"] == np.isfinite(latency).sum()
    assert found["latency_ms"]["p99"] == pytest.approx(np.nanquantile(latency, 0.99))
    assert found["latency_ms"]["max"] >= found["update_ms"]["max"] > 0
    assert found["missed_deadlines"] is None  # simulated time waits
    assert found["complete"] is True and found["settings"]["rate_hz"] == 4.0
    assert found["settings"]["readout_sha256"].keys() == {"readout.json", "learned.npz"}
    assert found["git_commit"] and found["versions"]


def test_no_readout_sees_a_marker(models, runs, tmp_path):
    for name in ("residual", "observer"):
        config = Estimate(models / name, tmp_path / name, steps=STEPS, record=False, markers=False)
        found, blind = estimate(config), logged(tmp_path / name)
        assert np.isnan(blind.marker).all() and blind.metadata["markers"] == "none"
        np.testing.assert_array_equal(estimated(blind), estimated(logged(runs[0] / name)))
        assert found["mean_error_mm"] is None and found["coverage_95"] is None
        assert found["mean_spread_mm"] == runs[1][name]["mean_spread_mm"]


def test_the_arm_moves_as_if_nobody_estimated(runs, tmp_path):
    (path,) = collect(Collect(tmp_path / "logs", sessions=1, steps=STEPS, workers=1))
    alone, beside = read_session(path), logged(runs[0] / "observer")
    for name in ("time", "motor_position", "motor_load", "motor_velocity_command", "marker"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(beside, name))


def test_a_windowed_readout_takes_its_own_rate_and_an_observer_any(models, tmp_path):
    with pytest.raises(SerpentError, match=r"residual was trained on rows at 4 Hz.*at 20 Hz"):
        estimate(Estimate(models / "residual", tmp_path / "out", rate_hz=20.0))
    assert not (tmp_path / "out").exists()
    config = Estimate(models / "observer", tmp_path / "o", steps=30, rate_hz=20.0, record=False)
    assert estimate(config)["mean_error_mm"] < 20


def test_an_observer_takes_another_twin_and_stays_as_sure(models, runs, tmp_path):
    soft = replace(NOMINAL_TWIN, parameters=replace(NOMINAL, strand_stiffness=8e3))
    twin_model.write(tmp_path / "twin.json", soft, {})
    trained = load(models / "observer")
    other = trained.with_twin(soft)  # pyright: ignore
    assert other.arm == soft and trained.arm == NOMINAL_TWIN  # pyright: ignore
    assert other.learned is trained.learned and other.rate_hz == 4.0
    np.testing.assert_array_equal(other.covariance, trained.covariance)
    config = Estimate(models / "observer", tmp_path / "out", steps=STEPS, record=False)
    found = estimate(replace(config, twin=tmp_path / "twin.json"))
    here, before = logged(tmp_path / "out"), logged(runs[0] / "observer")
    np.testing.assert_array_equal(here.motor_position, before.motor_position)  # the arm is the same
    live, offline = estimated(here)[other.window - 1 :], followed(other, here).marker
    np.testing.assert_allclose(live, offline, rtol=0, atol=1e-9)
    assert found["mean_error_mm"] > runs[1]["observer"]["mean_error_mm"] + 1
    assert found["settings"]["twin_sha256"]


def test_the_arm_to_simulate_is_another_flag(models, tmp_path):
    soft = replace(NOMINAL_TWIN, parameters=replace(NOMINAL, strand_stiffness=8e3))
    twin = tmp_path / "twin.json"
    twin_model.write(twin, soft, {})
    (path,) = collect(Collect(tmp_path / "logs", sessions=1, steps=20, workers=1, twin=twin))
    asked = (
        {"model": models / "residual", "twin": twin},
        {"model": models / "observer", "simulate": twin},
    )
    for number, options in enumerate(asked):
        out = tmp_path / str(number)
        estimate(Estimate(out=out, steps=20, record=False, **options))
        np.testing.assert_array_equal(logged(out).marker, read_session(path).marker)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"twin": Path("twin.json"), "backend": "real"}, r"residual in .* has no twin"),
        ({"twin": Path("twin.json"), "simulate": Path("a.json")}, r"residual in .* has no twin"),
        ({"simulate": Path("a.json"), "backend": "real"}, "--simulate is for --backend sim"),
        ({"simulate": Path("none.json")}, "none.json cannot be read"),
        ({"rate_hz": 101.0}, "from 0.01 to 100 Hz"),
        ({"steps": 0}, "--steps is 0"),
        ({"backend": "real"}, "no port"),
        ({"model": Path("nowhere")}, "nowhere holds no trained readout"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_written(options, told, models, tmp_path):
    with pytest.raises(SerpentError, match=told):
        estimate(Estimate(**{"model": models / "residual", "out": tmp_path / "out"} | options))
    assert not (tmp_path / "out").exists()


def test_nothing_is_overwritten(models, runs, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SerpentError, match=r"not empty and holds no estimate\.json"):
        estimate(Estimate(models / "residual", tmp_path))
    out = runs[0] / "observer"
    before = {path: path.read_bytes() for path in out.iterdir()}
    config = Estimate(models / "observer", out, steps=STEPS, record=False)
    with pytest.raises(SerpentError, match=r"holds a run already \(session_01\.parquet, results"):
        estimate(config)
    with pytest.raises(SerpentError, match="seed was 0, now 1"):
        estimate(replace(config, seed=1))
    assert before == {path: path.read_bytes() for path in out.iterdir()}


def test_a_run_that_is_stopped_keeps_its_rows_and_its_figures(models, tmp_path, monkeypatch):
    going_on = Follower.columns

    def stop(self, step):
        if self.rows == 20:
            raise KeyboardInterrupt
        return going_on(self, step)

    monkeypatch.setattr(Follower, "columns", stop)
    with pytest.raises(KeyboardInterrupt):
        estimate(Estimate(models / "residual", tmp_path / "out", steps=STEPS, record=False))
    session = logged(tmp_path / "out")
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    assert len(session) == found["rows"] == 20 and found["rows_estimated"] == 17
    assert (found["complete"], found["ended"]) == (False, "stopped by hand")


# Over the wire


def test_over_the_wire_estimates_are_those_of_the_twin(models, tmp_path):
    """Step by step; the device shows no markers."""
    quiet = replace(NOMINAL, load_noise=0.0)
    config = Estimate(
        models / "residual", tmp_path / "sim", steps=40, record=False, parameters=quiet
    )
    estimate(config)
    with running("--lockstep", "--load-noise", "0") as device:
        real = RealArm(port=device.port, setup=tmp_path / "none.toml")
        own = {"backend": "real", "real": real, "parameters": NOMINAL}
        found = estimate(replace(config, out=tmp_path / "real", **own))
    here, there = logged(tmp_path / "sim"), logged(tmp_path / "real")
    np.testing.assert_array_equal(estimated(there), estimated(here))
    assert there.metadata["estimate"]["readout"] == "residual"
    assert "motor1_tick_ms" in there.extra and found["missed_deadlines"] == 0


def test_in_real_time_over_the_wire(models, tmp_path):
    with running("--realtime") as device:
        options = ["--backend", "real", "--port", device.port, "--setup", tmp_path / "none.toml"]
        options += ["--steps", 12, "--no-record", "--out", tmp_path / "out"]
        command = [sys.executable, "-m", "serpent_twin.estimate", "--model", models / "observer"]
        done = subprocess.run(
            [str(word) for word in command + options], capture_output=True, text=True
        )
    assert done.returncode == 0, done.stderr
    assert "12 of 12 rows estimated at 4 Hz." in done.stdout
    session = logged(tmp_path / "out")
    assert session.time[-1] >= 11 / 4 - 0.05  # it took its time
    offline = load(models / "observer").follow(one_row_windows(session))
    np.testing.assert_allclose(estimated(session), offline.marker, rtol=0, atol=1e-9)
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    assert found["missed_deadlines"] == session.metadata["loop"]["missed_deadlines"]
    assert found["mean_error_mm"] is None and found["mean_spread_mm"] > 0


def one_row_windows(session: Session):
    """Its windows from the first row on, of a session that shows no marker."""
    stiff = session.having(marker=markers(joint_from_motor(session.motor_position[:, :9])))
    windows: Windows = cut([stiff], 1, drop=0)
    return windows.sessions[0]


def test_markers_correct_a_readout_that_is_told_to_learn_and_no_other(models, tmp_path):
    """An arm whose strands give way more than those of the arm that the readout was trained on."""
    softer = replace(NOMINAL, strand_stiffness=0.6 * NOMINAL.strand_stiffness, marker_noise=2e-4)
    kept = {
        name: estimate(
            Estimate(
                models / "observer",
                tmp_path / name,
                steps=4 * STEPS,
                record=False,
                learn=name == "learns",
                parameters=softer,
            )
        )
        for name in ("is told nothing", "learns")
    }
    alone, learnt = (estimated(logged(tmp_path / name)) for name in kept)
    measured = logged(tmp_path / "learns").marker
    np.testing.assert_array_equal(alone[0], learnt[0])
    off = [np.nanmean(np.linalg.norm(m - measured, axis=-1)[2 * STEPS :]) for m in (alone, learnt)]
    assert off[1] < 0.7 * off[0]
