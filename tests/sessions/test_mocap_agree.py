"""Test that markers that do not agree with the motors are refused, with the reason."""

import json
from dataclasses import replace

import numpy as np
import pytest
from motive_csv import write_take
from scipy.spatial.transform import Rotation
from takes import CAMERAS, filmed, merged, simulated

from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import IDENTITY, Rigid
from serpent_twin.numerals import counted
from serpent_twin.sessions import write_session
from serpent_twin.sessions.agree import refuse_another_arm
from serpent_twin.sessions.align import Clock, refine
from serpent_twin.sessions.film import Film
from serpent_twin.sessions.match import match
from serpent_twin.sessions.merge import Merge, line, merge
from serpent_twin.sim.twin import replay_motors

NAMES = [f"arm:{n}" for n in range(1, 10)]
START = 40.0
GLUED = {"base:a": [-0.05, 0.04, 0.0], "base:b": [-0.1, -0.05, 0.02], "base:c": [-0.3, 0.0, 0.05]}


@pytest.fixture(scope="module")
def recording():
    """A session, its prediction, and the frames and positions that cameras saw."""
    session, times, truth = simulated(120, seed=41)
    predicted = replay_motors(session.time, session.motor_position).marker
    return session, predicted, *filmed(times, truth, START, seed=41)


def found(recording, seen=None, time=None, predicted=None, names=NAMES):
    session, marker, frame, whole = recording
    film = Film(float(frame[0]) / 120, 120.0, whole if seen is None else seen)
    time = session.time if time is None else time
    return match(time, marker if predicted is None else predicted, film, names)


def refusal(recording, **changes):
    with pytest.raises(SerpentError) as caught:
        found(recording, **changes)
    return str(caught.value)


@pytest.mark.parametrize("order", ["213456789", "123456798", "123564789", "123654789"])
def test_swapped_names_are_refused_and_say_whom_they_look_like(recording, order):
    true = [int(n) - 1 for n in order]
    text = refusal(recording, seen=recording[3][:, true])
    for n, m in enumerate(true):
        told = f"'arm:{n + 1}', given as marker {n + 1}, looks like marker {m + 1} in" in text
        assert told == (n != m)


def test_names_swapped_midway_are_refused_with_the_time(recording):
    _, _, frame, seen = recording
    seen, swap = seen.copy(), round((START + 12.0) * 120) - frame[0]
    seen[swap:, [3, 5]] = seen[swap:, [5, 3]]
    text = refusal(recording, seen=seen)
    assert "'arm:4', given as marker 4, looks like marker 6 in" in text
    assert "'arm:6', given as marker 6, looks like marker 4 in" in text
    at = float(text.split("frames from ")[1].split(" s ")[0])
    assert at == pytest.approx(START + 12.0, abs=0.1)


def test_an_arm_whose_markers_are_all_somewhat_off_is_another_arm(recording):
    predicted = recording[1]
    aside = np.where(np.arange(9) % 2, 0.045, -0.045)[:, None] * [0, 1, 0]
    refuse_another_arm(predicted, predicted + 0.8 * aside)
    with pytest.raises(SerpentError, match=r"are 45 mm rms from .* more than 40 mm.*: 1 45, 2 45"):
        refuse_another_arm(predicted, predicted + aside)


def test_one_marker_elsewhere_is_seen_although_the_others_agree(recording, tmp_path):
    session, _, frame, seen = recording
    seen = seen.copy()
    seen[:, 8] = CAMERAS.apply([0.1, 0.3, 0.2])
    take = write_take(tmp_path / "take.csv", frame, NAMES, seen)
    with pytest.raises(SerpentError, match=r"Marker 9 (is elsewhere|keeps the same numbers)"):
        merged(tmp_path, session, take)


def test_what_cannot_be_found_at_all_is_said_in_its_own_words(recording):
    session, predicted, _, seen = recording
    still = predicted.mean(axis=0) + 0.05 * (predicted - predicted.mean(axis=0))
    assert "less than 10 mm, so it cannot be found" in refusal(recording, predicted=still)
    for rows in (1, 2, 5):
        text = refusal(recording, time=session.time[:rows], predicted=predicted[:rows])
        assert (
            f"of {counted(rows, 'row')} lasts {session.time[rows - 1]:.2f} s; one shorter than 2 s"
            in text
        )
    assert "shows no marker in any frame" in refusal(recording, seen=np.full_like(seen, np.nan))
    text = refusal(recording, seen=seen[:, :2], names=NAMES[:2])
    assert "only 2 markers; three are needed" in text
    fleeting = seen.copy()
    fleeting[5 * 120 :, 2:] = np.nan  # the others before the session only
    assert "no place of the take shows three markers" in refusal(recording, seen=fleeting)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (Rigid(np.eye(3), np.array([0.0, 0.0, 0.08])), r"80 mm away .*turned by 0°"),
        (Rigid(Rotation.from_rotvec([0.5, 0, 0]).as_matrix(), np.zeros(3)), "turned by 29°"),
    ],
)
def test_a_wrong_frame_is_refused_with_its_name_and_distance(recording, tmp_path, change, told):
    session, _, frame, seen = recording
    take = write_take(tmp_path / "take.csv", frame, NAMES, seen)
    right = CAMERAS.inverse()
    wrong = Rigid(change.rotation @ right.rotation, change.apply(right.translation))
    wrong.save(tmp_path / "old.json")
    with pytest.raises(SerpentError, match=rf"by the frame file old\.json, the markers .*{told}"):
        merged(tmp_path, session, take, frame=tmp_path / "old.json")


def test_the_residual_told_is_that_of_the_frame_in_use(recording, tmp_path):
    session, _, frame, seen = recording
    take = write_take(tmp_path / "take.csv", frame, NAMES, seen)
    right = CAMERAS.inverse()
    Rigid(right.rotation, right.translation + [0.0, 0.005, 0.0]).save(tmp_path / "frame.json")
    result = merged(tmp_path, session, take, frame=tmp_path / "frame.json")
    facts = result.metadata["mocap"]
    assert facts["residual_rms_m"] == pytest.approx(0.005, abs=1e-3)
    assert facts["fit_residual_rms_m"] < 3e-3 and facts["frame_from_fit_m"] > 0.004
    assert float(line(result).split()[5]) == pytest.approx(5, abs=1)


def test_base_markers_in_centimetres_or_hidden_are_refused(recording, tmp_path):
    session, _, frame, seen = recording
    fixed = np.broadcast_to(CAMERAS.apply(list(GLUED.values())), (len(frame), 3, 3)).copy()
    path, places = tmp_path / "base.json", GLUED
    path.write_text(json.dumps({k: [100 * x for x in v] for k, v in places.items()}))
    everything = np.concatenate([seen, fixed], axis=1)
    take = write_take(tmp_path / "take.csv", frame, NAMES + list(GLUED), everything)
    with pytest.raises(SerpentError, match=r"base:a \d+, base:b \d+, base:c \d+\).* in metres"):
        merged(tmp_path, session, take, base_markers=path)
    path.write_text(json.dumps(places))
    everything[:, -1] = np.nan
    take = write_take(tmp_path / "hidden.csv", frame, NAMES + list(GLUED), everything)
    with pytest.raises(SerpentError, match=r"base:c, which no frame of the take shows"):
        merged(tmp_path, session, take, base_markers=path)


def test_markers_of_a_log_are_replaced_only_if_asked(recording, tmp_path):
    session, predicted, frame, seen = recording
    take = write_take(tmp_path / "take.csv", frame, NAMES, seen)
    live = predicted.copy()
    live[::2] = np.nan
    extra = {name: np.ones(len(session)) for name in ("camera_time", "marker_age", "recoveries")}
    metadata = session.metadata | {"markers": "natnet"}
    session = replace(session.having(marker=live, **extra), metadata=metadata)
    with pytest.raises(SerpentError, match=r"holds markers already, in 50%.*natnet.*--replace"):
        merged(tmp_path, session, take)
    result = merged(tmp_path, session, take, replace=True)
    assert np.isfinite(result.marker[:-1]).mean() > 0.99 and set(result.extra) == {"recoveries"}
    assert result.metadata["markers"] == "motive"


def test_short_sessions_of_one_take_agree_about_its_clock(recording, tmp_path):
    session, predicted, _, seen = recording
    noisy = seen + 3e-3 * np.random.default_rng(5).standard_normal(seen.shape)
    for first in (0, 40, 80):
        rows = slice(first, first + 40)
        clock = found(recording, noisy, session.time[rows], predicted[rows]).clock
        assert abs(clock.drift - 30e-6) < 60e-6 and clock.drift_std < 51e-6


def test_an_arm_that_lags_more_and_more_is_no_proof_of_a_drift():
    rng = np.random.default_rng(6)
    pace, size, phase = rng.uniform(0.3, 1.5, (8, 1, 1)), rng.normal(size=(2, 8, 9, 3)), 0.05
    middle, error = rng.normal(size=(9, 3)) * 0.2, size[1] * 2e-3

    def places(time, size):
        turns = pace * time[:, None, None, None] + phase * np.arange(27).reshape(9, 3)
        return middle + (size * np.sin(turns)).sum(axis=1)

    time, fine = np.arange(0.0, 250.0, 0.25), np.arange(-1.0, 251.0, 1 / 120)
    predicted = places(time - 0.02 * time / 250.0, size[0] * 0.02 + error)  # seems to be 80 ppm
    film = Film(-1.0, 120.0, places(fine, size[0] * 0.02))
    clock, rigid = refine(time, predicted, film, Clock(0.0), IDENTITY)
    assert 3e-3 < rigid.residual < 3e-2
    assert abs(clock.drift) < 1.5 * clock.drift_std < 1e-4


def test_a_folder_goes_on_after_a_one_row_session(recording, tmp_path):
    session, _, frame, seen = recording
    take = write_take(tmp_path / "take.csv", frame, NAMES, seen)
    logs = tmp_path / "logs"
    logs.mkdir()
    write_session(logs / "session_01.parquet", session[:1])
    write_session(logs / "session_02.parquet", session)
    done = []
    with pytest.raises(SerpentError, match=r"1 not merged\. session_01.*lasts 0\.00 s"):
        done.extend(s.name for s, _ in merge(Merge(logs, take, tmp_path / "out")))
    assert (tmp_path / "out" / "session_02.parquet").exists()
