"""Test that a take's markers are merged into the rows of the log where they belong."""

import json
from dataclasses import replace

import numpy as np
import pytest
from motive_csv import DIALECTS, write_take
from paths import SHARED
from scipy.interpolate import CubicSpline
from takes import CAMERAS, DRIFT, NOISE, filmed, merged, simulated

from serpent_twin.errors import SerpentError
from serpent_twin.sessions import read_session, write_session
from serpent_twin.sessions.align import Clock, refine
from serpent_twin.sessions.film import Film
from serpent_twin.sessions.merge import Merge, merge
from serpent_twin.sim.twin import replay_motors

BENCH = SHARED / "logs" / "arm_a" / "session_01.parquet"


def check_clock(session, start, most=4e-3):
    facts = session.metadata["mocap"]
    error = abs(facts["offset_s"] - start)
    assert error < most
    assert error < 3 * facts["offset_std_s"] < 3 * most
    assert abs(facts["drift_ppm"] - 1e6 * DRIFT) < 3 * facts["drift_std_ppm"]


@pytest.fixture(scope="module")
def recording():
    return simulated(240, seed=11)


def true_rows(session, times, truth):
    return CubicSpline(times, truth)(session.time)


def test_clock_frame_and_markers_are_recovered_with_shuffled_labels_and_a_ghost(
    recording, tmp_path
):
    session, times, truth = recording
    frame, seen = filmed(times, truth, start=83.4321, seed=1)
    ghost = CAMERAS.apply(np.array([0.3, 0.25, -0.1])) * np.ones((len(frame), 1, 3))
    order = np.array([4, 8, 0, 2, 6, 1, 9, 3, 5, 7])
    everything = np.concatenate([seen, ghost], axis=1)[:, order]
    names = [f"Unlabeled:{100 + n}" for n in range(10)]
    take = write_take(tmp_path / "take.csv", frame, names, everything)
    result = merged(tmp_path, session, take)
    check_clock(result, 83.4321)
    facts = result.metadata["mocap"]
    assert facts["labels"] == [names[list(order).index(n)] for n in range(9)]
    error = np.linalg.norm(result.marker - true_rows(*recording), axis=-1)
    assert np.sqrt(np.nanmean(error**2)) < 2.5 * NOISE  # noise in three coordinates, and the frame
    assert np.isnan(result.marker).mean() < 0.01  # single lost frames are bridged
    assert result.metadata["markers"] == "motive"
    assert facts["explained"] > 0.99 > 0.7 > facts["explained_second_best"]
    for name in ("time", "motor_position", "motor_load", "joint_target"):
        assert np.array_equal(getattr(result, name), getattr(session, name))


def test_a_given_frame_is_used_and_a_long_gap_stays_lost(recording, tmp_path):
    session, times, truth = recording
    frame, seen = filmed(times, truth, start=40.0, seed=2, loss=0.0)
    seen[4800 - frame[0] : 6000 - frame[0], 5] = np.nan  # the log's first 10 s
    names = [f"arm:Marker {n:03d}" for n in range(1, 10)]
    take = write_take(tmp_path / "take.csv", frame, names, seen, DIALECTS["1.24"])
    CAMERAS.inverse().save(tmp_path / "frame.json")
    result = merged(tmp_path, session, take, frame=tmp_path / "frame.json")
    check_clock(result, 40.0)
    assert np.isnan(result.marker[:40, 5]).all() and np.isfinite(result.marker[40:-1]).all()
    error = (result.marker - true_rows(*recording))[1:-1]
    assert np.nanstd(error) < 1.3 * NOISE and abs(np.nanmean(error)) < NOISE / 5
    assert result.metadata["mocap"]["frame_source"] == "frame file frame.json"


def test_markers_on_the_base_give_the_frame(recording, tmp_path):
    session, times, truth = recording
    frame, seen = filmed(times, truth, start=30.0, seed=3)
    glued = {
        "base:a": [-0.05, 0.04, 0.0],
        "base:b": [-0.1, -0.05, 0.02],
        "base:c": [-0.3, 0.0, 0.05],
    }
    fixed = np.broadcast_to(CAMERAS.apply(list(glued.values())), (len(frame), 3, 3))
    (tmp_path / "base.json").write_text(json.dumps(glued))
    names = [f"Marker{n}" for n in range(1, 10)] + list(glued)
    take = write_take(tmp_path / "take.csv", frame, names, np.concatenate([seen, fixed], axis=1))
    result = merged(tmp_path, session, take, base_markers=tmp_path / "base.json")
    rotation = np.array(result.metadata["mocap"]["camera_to_base"]["rotation"])
    assert np.abs(rotation - CAMERAS.rotation.T).max() < 1e-4  # the file holds 6 decimals of a mm
    check_clock(result, 30.0)


def test_a_marker_whose_label_changes_is_joined_and_a_swap_is_undone(recording, tmp_path):
    session, times, truth = recording
    frame, seen = filmed(times, truth, start=60.0, seed=4, loss=0.0)
    lost, swap = 7200 - frame[0] + 2400, 7200 - frame[0] + 3600
    fragment = np.full((len(frame), 1, 3), np.nan)
    fragment[lost:, 0], seen[lost:, 7] = seen[lost:, 7].copy(), np.nan
    seen[swap:, [2, 5]] = seen[swap:, [5, 2]]
    names = [f"U{n}x" for n in range(9)] + ["Unlabeled 2000"]
    columns = np.concatenate([seen, fragment], axis=1)
    take = write_take(tmp_path / "take.csv", frame, names, columns)
    result = merged(tmp_path, session, take)
    check_clock(result, 60.0)
    error = np.linalg.norm(result.marker - true_rows(*recording), axis=-1)
    assert np.nanmax(error) < 10 * NOISE and np.isnan(error).mean() < 0.01
    assert set(result.metadata["mocap"]["frames_by_label"][7]) == {"U7x", "Unlabeled 2000"}
    assert set(result.metadata["mocap"]["frames_by_label"][2]) == {"U2x", "U5x"}


def test_wrong_or_short_takes_are_refused_and_nothing_is_written(recording, tmp_path):
    session, times, truth = recording
    names = [f"{n}" for n in range(1, 10)]
    other = simulated(240, seed=12)
    unrelated = write_take(tmp_path / "a.csv", *with_names(filmed(*other[1:], 50.0, 5), names))
    with pytest.raises(SerpentError, match=r"session_01.*no place of the take"):
        merged(tmp_path, session, unrelated)
    frame, seen = filmed(times, truth, 50.0, 6)
    part = slice(0, (15 + 10) * 120)
    short = write_take(tmp_path / "b.csv", frame[part], names, seen[part])
    with pytest.raises(SerpentError, match=r"session_01.*holds less than 50%"):
        merged(tmp_path, session, short)
    twice = np.concatenate([seen, seen])
    doubled = write_take(tmp_path / "c.csv", np.arange(len(twice)), names, twice)
    with pytest.raises(SerpentError, match=r"two places of the take"):
        merged(tmp_path, session, doubled)
    assert not list(tmp_path.glob("out*/*.parquet"))


def with_names(film, names):
    return film[0], names, film[1]


def test_sessions_of_a_folder_are_found_one_by_one_and_the_missing_one_is_named(tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    takes = [simulated(rows, seed) for rows, seed in ((120, 21), (90, 22), (100, 23))]
    for number, (session, _, _) in enumerate(takes, 1):
        metadata = session.metadata | {"session": number}
        write_session(logs / f"session_{number:02d}.parquet", replace(session, metadata=metadata))
    first = filmed(*takes[1][1:], start=20.0, seed=7)
    second = filmed(*takes[2][1:], start=20.0, seed=8)
    joined = np.concatenate([first[1], second[1]])
    names = [f"m{n}" for n in range(1, 10)]
    take = write_take(tmp_path / "take.csv", np.arange(len(joined)) + first[0][0], names, joined)
    done = []
    with pytest.raises(SerpentError, match=r"1 not merged. session_01"):
        for session, _ in merge(Merge(logs, take, tmp_path / "out")):
            done.append(session)
    offsets = [session.metadata["mocap"]["offset_s"] for session in done]
    assert offsets == pytest.approx([20.0, 20.0 + len(first[0]) / 120], abs=5e-3)
    with pytest.raises(SerpentError, match="holds session_02"):
        list(merge(Merge(logs, take, tmp_path / "out")))


def test_the_reported_error_covers_the_truth(recording):
    session, times, truth = recording
    predicted = replay_motors(session.time, session.motor_position).marker
    stray = []
    for seed in range(20):
        frame, seen = filmed(times, truth, start=50.0, seed=seed)
        seen += 3e-3 * np.random.default_rng(seed).standard_normal(seen.shape)
        film = Film(float(frame[0]) / 120, 120.0, seen)
        clock, _ = refine(session.time, predicted, film, Clock(50.02), CAMERAS.inverse())
        stray.append((clock.offset - 50.0) / clock.offset_std)
    assert 0.3 < np.sqrt(np.mean(np.square(stray))) < 1.5


def test_fast_rows_are_merged_too(tmp_path):
    session, times, truth = simulated(3000, seed=31, rate=100.0)
    frame, seen = filmed(times, truth, start=33.3, seed=9)
    take = write_take(tmp_path / "t.csv", frame, [f"{n}" for n in range(1, 10)], seen)
    result = merged(tmp_path, session, take)
    check_clock(result, 33.3)


def test_an_arm_unlike_the_twin_is_found_with_an_honest_error(tmp_path):
    if not BENCH.exists():
        pytest.skip(f"there is no {BENCH}")
    log = read_session(BENCH)[:600]
    truth = log.marker.reshape(len(log), -1).copy()
    for column in truth.T:
        known = np.isfinite(column)
        column[:] = np.interp(log.time, log.time[known], column[known])
    truth = truth.reshape(log.marker.shape)
    frame, seen = filmed(log.time, truth, start=70.02, seed=10)
    names = [f"Unlabeled {n}" for n in (11, 35, 22, 47, 58, 63, 70, 84, 99)]
    order = [3, 1, 8, 0, 5, 2, 7, 4, 6]
    take = write_take(tmp_path / "t.csv", frame, names, seen[:, order])
    CAMERAS.inverse().save(tmp_path / "frame.json")
    blind = log.having(marker=np.full_like(log.marker, np.nan))
    result = merged(tmp_path, blind, take, frame=tmp_path / "frame.json")
    check_clock(result, 70.02, most=25e-3)
    assert result.metadata["mocap"]["labels"] == [names[order.index(n)] for n in range(9)]
    error = np.linalg.norm(result.marker - truth, axis=-1)
    speed = np.linalg.norm(np.gradient(truth, log.time, axis=0), axis=-1)
    assert np.nanmean(error) < 2 * NOISE + 12e-3 * speed.mean()
