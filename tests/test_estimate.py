"""Do live estimates say what the readout says of the log, and only what the motor bus tells?"""

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from serpent_twin import design
from serpent_twin.bus.device import running
from serpent_twin.collect import Collect, Real, collect
from serpent_twin.design import NOMINAL_DESIGN
from serpent_twin.errors import SerpentError
from serpent_twin.estimate import Estimate, estimate
from serpent_twin.estimate.draw import Drawing, ellipsoids
from serpent_twin.estimate.follower import COLUMNS, LATENCY, MARKERS, SPREADS, Follower
from serpent_twin.estimate.stream import Page, Sample, Stream
from serpent_twin.log import Session, examine, read_folder, read_session
from serpent_twin.parameters import NOMINAL
from serpent_twin.readout import Readout, find, load
from serpent_twin.readout.belief import Belief
from serpent_twin.readout.live import LiveWindows, Reading
from serpent_twin.readout.windows import Windows, cut, input_size

STEPS = 60


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A readout of windows and an observer, trained on a few rows of the twin at 4 Hz."""
    folder = tmp_path_factory.mktemp("trained")
    collect(Collect(folder / "logs", sessions=2, steps=70, workers=1, seed=5))
    train, validate = (cut([s], 4, drop=10) for s in read_folder(folder / "logs"))
    for name in ("residual", "observer"):
        trained = find(name)()
        trained.fit(train, validate, np.random.default_rng(0))
        trained.save(folder / name)
    return folder


@pytest.fixture(scope="module")
def runs(models, tmp_path_factory):
    """One run of each, the first one drawn."""
    folder = tmp_path_factory.mktemp("runs")
    results = {
        name: estimate(
            Estimate(models / name, folder / name, steps=STEPS, record=name == "residual")
        )
        for name in ("residual", "observer")
    }
    return folder, results


def logged(folder: Path) -> Session:
    return read_session(folder / "session_01.parquet")


def estimated(session: Session) -> np.ndarray:
    return np.stack([session.extra[name] for name in MARKERS], axis=1).reshape(-1, 9, 3)


def spread(session: Session) -> np.ndarray:
    return np.stack([session.extra[name] for name in SPREADS], axis=1)


def followed(trained: Readout, session: Session) -> Belief:
    return trained.follow(cut([session], trained.window, drop=0).sessions[0])


@pytest.mark.parametrize("name", ["residual", "observer"])
def test_live_estimates_are_those_of_the_written_log(name, models, runs):
    session, trained = logged(runs[0] / name), load(models / name)
    offline, first = followed(trained, session), trained.window - 1
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
    soft = replace(NOMINAL_DESIGN, parameters=replace(NOMINAL, strand_stiffness=8e3))
    design.write(tmp_path / "twin.json", soft, {})
    trained = load(models / "observer")
    other = trained.with_twin(soft)  # pyright: ignore
    assert other.arm == soft and trained.arm == NOMINAL_DESIGN  # pyright: ignore
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
    soft = replace(NOMINAL_DESIGN, parameters=replace(NOMINAL, strand_stiffness=8e3))
    twin = tmp_path / "twin.json"
    design.write(twin, soft, {})
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
        ({"simulate": Path("a.json"), "backend": "real"}, "--simulate is the arm to simulate"),
        ({"simulate": Path("none.json")}, "none.json cannot be read"),
        ({"rate_hz": 101.0}, "up to 100 Hz"),
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


# Gaps


@dataclass
class Echo(Readout):
    """A readout whose first marker is the first three numbers of its window's oldest command."""

    name = "echo"
    about = "for tests"
    _learns = False

    def _learn(self, train, validate, rng, progress): ...

    def _estimate(self, x, start):
        return np.tile(x[:, -9:-6], (1, 9))


@pytest.mark.parametrize(("step", "blind"), [(1.4, 0), (1.6, 2), (20.0, 2)])
def test_a_gap_begins_a_window_anew(step, blind):
    echo = Echo(window=3)
    echo.rate_hz = 10.0
    live, time, said = LiveWindows(echo), 0.0, []
    for k in range(12):
        time += (step if k == 6 else 1.0) / 10
        now = Reading(time, np.zeros(10), np.zeros(10), np.zeros(10), np.full(10, float(k)))
        said.append(live.update(now))
    seen = [each is not None for each in said]
    assert seen == [False] * 2 + [True] * 4 + [False] * blind + [True] * (6 - blind)
    for k, each in enumerate(said):
        if each is not None:  # the oldest command is that before the row before
            assert each.marker[0, 0, 0] == k - 1
    assert input_size(3) == 72


def test_without_a_known_rate_there_is_no_gap():
    live = LiveWindows(Echo(window=1 + 1))
    none = np.zeros(10)
    said = [live.update(Reading(t, none, none, none, none)) for t in (0.0, 1.0, 50.0)]
    assert [each is not None for each in said] == [False, True, True]


# Rerun


def test_the_recording_holds_what_the_log_says(runs):
    session, path = logged(runs[0] / "residual"), runs[0] / "residual" / "session_01.rrd"
    live = estimated(session)
    for kind, marker in (("estimated", live), ("measured", session.marker)):
        steps, points = column(path, f"/markers/{kind}", "Points3D:positions")
        assert steps == list(range(STEPS))
        for k in range(STEPS):
            known = marker[k][np.isfinite(marker[k]).all(axis=-1)]
            np.testing.assert_allclose(np.reshape(points[k], (-1, 3)), known, atol=1e-6)
    steps, far = column(path, "/plots/error/measured", "Scalars:scalars")
    distance = 1e3 * np.linalg.norm(live - session.marker, axis=-1)[3:].mean(axis=-1)
    assert steps == list(range(3, STEPS))
    np.testing.assert_allclose(np.ravel(far), distance, rtol=1e-5)
    steps, expected = column(path, "/plots/error/expected_rms", "Scalars:scalars")
    np.testing.assert_allclose(
        np.ravel(expected), 1e3 * spread(session)[3:].mean(axis=1), rtol=1e-5
    )
    steps, half = column(path, "/markers/expected", "Ellipsoids3D:half_sizes")
    size = np.sqrt((np.array(half[5]) ** 2).sum(axis=-1) / 7.814728)  # 95 % of chi² of three
    np.testing.assert_allclose(size, spread(session)[5], rtol=1e-4)
    assert column(path, "/arm/link9", "Transform3D:translation")[0] == steps


def column(path, entity, component):
    """Steps and values of one component, from all batches."""
    found = []
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            if component in batch.schema.names:
                found += zip(batch["step"].to_pylist(), batch[component].to_pylist(), strict=True)
    found.sort(key=lambda pair: pair[0])
    return [step for step, _ in found], [value for _, value in found]


def test_ellipsoids_hold_their_share():
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(4, 3, 3))
    half, turned = ellipsoids(roots @ np.swapaxes(roots, 1, 2))
    for n, root in enumerate(roots):
        error = turned[n].inv().apply(rng.standard_normal((20_000, 3)) @ root.T)
        assert (((error / half[n]) ** 2).sum(axis=1) <= 1).mean() == pytest.approx(0.95, abs=0.01)


def sample(k: int) -> Sample:
    unknown = np.full((9, 3, 3), np.nan)
    return Sample(
        k / 4, np.zeros(10), np.zeros(10), unknown[..., 0], unknown[..., 0], unknown, np.nan
    )


def test_a_recording_without_rows_leaves_no_file(tmp_path):
    drawing = Drawing(Page("x", "y", tmp_path / "a.rrd", view=False))
    assert drawing.end() == "" and not list(tmp_path.iterdir())
    drawing = Drawing(Page("x", "y", tmp_path / "a.rrd", view=False))
    drawing.add([sample(0), sample(1)])
    assert drawing.end() == "" and [path.name for path in tmp_path.iterdir()] == ["a.rrd"]


def test_a_drawing_process_that_dies_stops_no_arm(tmp_path, capsys):
    row = dict.fromkeys(COLUMNS, np.nan) | {"time": 0.0, "marker": np.zeros((9, 3))}
    row |= {"motor_position": np.zeros(10), "motor_load": np.zeros(10)}
    with Stream(Page("x", "y", tmp_path / "a.rrd", view=False)) as stream:
        stream._process.kill()
        stream._process.join()
        for _ in range(200):
            stream.see(row, np.full((9, 3, 3), np.nan))
    assert "the recording is not whole" in capsys.readouterr().out


# Over the wire


def test_over_the_wire_estimates_are_those_of_the_twin(models, tmp_path):
    """Step by step; the device shows no markers."""
    quiet = replace(NOMINAL, load_noise=0.0)
    config = Estimate(
        models / "residual", tmp_path / "sim", steps=40, record=False, parameters=quiet
    )
    estimate(config)
    with running("--lockstep", "--load-noise", "0") as device:
        real = Real(port=device.port, setup=tmp_path / "none.toml")
        found = estimate(replace(config, out=tmp_path / "real", backend="real", real=real))
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
    stiff = replace(session, marker=np.zeros_like(session.marker))
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
