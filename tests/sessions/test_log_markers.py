"""Test that faults of scale, frame, order and places of the markers are refused by every command."""

import re
from dataclasses import replace

import numpy as np
import pytest
from marker_faults import FAULTS, lost, moved, standing, swapped
from motive_csv import write_take
from paths import ROOT
from takes import CAMERAS, filmed
from typed import typed

from serpent_twin.arm.geometry import joint_from_motor, link_frames
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.errors import SerpentError
from serpent_twin.identification.run import Trace, trace
from serpent_twin.sessions import examine, read_session, refuse_damaged, write_session
from serpent_twin.sessions.merge import Merge, merge
from serpent_twin.training.train import Train, train

DATA = ROOT / "data" / "arm_a"
SHARED = ROOT.parent / "shared" / "logs"
ROWS = 240


@pytest.fixture(scope="module")
def sessions():
    """Four short sessions of an arm that is not the twin, without fault."""
    return [read_session(path)[:ROWS] for path in sorted(DATA.glob("*.parquet"))]


@pytest.fixture(scope="module")
def take(sessions):
    """What cameras saw of the first of them: frames, and markers in the base frame, (F, 9, 3)."""
    session = sessions[0]
    truth = session.marker.reshape(len(session), -1).copy()
    for column in truth.T:
        known = np.isfinite(column)
        column[:] = np.interp(session.time, session.time[known], column[known])
    frame, seen = filmed(session.time, truth.reshape(-1, 9, 3), start=30.0, seed=4, loss=0.0)
    return frame, CAMERAS.inverse().apply(seen)


def folder(path, sessions, fault):
    """Sessions as a run's logs, the second one with a fault."""
    path.mkdir()
    for number, session in enumerate(sessions, 1):
        marker = fault.change(session.marker) if number == 2 else session.marker
        write_session(path / f"session_{number:02d}.parquet", session.having(marker=marker))
    return path


def run(module, *arguments):
    return typed(f"serpent_twin.{module}", *arguments)


def errors(session):
    return [finding.text for finding in examine(session) if finding.level == "error"]


@pytest.mark.parametrize("name", [*FAULTS][::4])  # check, below, names them all
def test_train_and_trace_refuse_the_session_and_name_its_fault(name, sessions, tmp_path):
    logs, says = folder(tmp_path / "logs", sessions, FAULTS[name]), FAULTS[name].says
    with pytest.raises(SerpentError, match=rf"session_02\.parquet: .*({says})"):
        train(Train(logs, tmp_path / "readouts", readout=("linear",)))
    with pytest.raises(SerpentError, match=rf"session_02\.parquet: .*({says})"):
        trace(Trace((logs,), tmp_path / "trace"))
    assert not (tmp_path / "readouts").exists() and not (tmp_path / "trace").exists()


@pytest.mark.parametrize("name", FAULTS)
def test_merge_refuses_the_take_and_writes_nothing(name, sessions, take, tmp_path):
    fault, (frame, place) = FAULTS[name], take
    blind = sessions[0].having(marker=np.full_like(sessions[0].marker, np.nan))
    path = write_session(tmp_path / "session_01.parquet", blind)
    names = [f"{n}" for n in range(1, 10)]
    csv = write_take(tmp_path / "take.csv", frame, names, CAMERAS.apply(fault.change(place)))
    CAMERAS.inverse().save(tmp_path / "frame.json")
    config = Merge(path, csv, tmp_path / "out", frame=tmp_path / "frame.json")
    with pytest.raises(SerpentError, match=f"({fault.of_take or fault.says})|({fault.says})"):
        list(merge(config))
    assert not list((tmp_path / "out").glob("*.parquet"))


@pytest.mark.parametrize("name", FAULTS)
def test_check_names_the_fault_as_an_error(name, sessions):
    session = sessions[1].having(marker=FAULTS[name].change(sessions[1].marker))
    assert [text for text in errors(session) if re.search(FAULTS[name].says, text)], errors(session)


def test_the_commands_exit_1_with_a_sentence(sessions, tmp_path):
    logs = folder(tmp_path / "logs", sessions, FAULTS["x swapped"])
    done = run("log", "check", logs)
    assert done.returncode == 1 and "x of markers 3 and 5 are swapped, in all rows" in done.stdout
    assert "session_01.parquet: 240 rows, sound" in done.stdout
    for module in ("train", "trace"):
        done = run(module, "--logs", logs, "--out", tmp_path / module)
        assert done.returncode == 1 and "Traceback" not in done.stderr
        assert "x of markers 3 and 5 are swapped" in done.stderr


def test_good_logs_pass_with_assembly_tolerances_and_all(sessions):
    """Markers glued on to ±3 mm along each axis, a frame off by 1°, a scale by 0.3 %."""
    rng = np.random.default_rng(1)
    for session in sessions:
        assert not errors(session)
        joint = joints_from_markers(session.marker, joint_from_motor(session.motor_position[:, :9]))
        _, turn = link_frames(joint)
        glued = session.marker + (turn @ rng.uniform(-3e-3, 3e-3, (9, 3))[:, :, None])[..., 0]
        lean = np.eye(3) + np.cross(np.eye(3), np.radians(rng.uniform(-1, 1, 3)))
        assert not errors(session.having(marker=1.003 * glued @ lean.T))


@pytest.mark.parametrize("arm", sorted(p.name for p in SHARED.glob("arm_*")) or ["none"])
def test_every_arm_that_was_logged_passes(arm):
    if not SHARED.exists():
        pytest.skip(f"there is no {SHARED}")
    for path in sorted((SHARED / arm).glob("*.parquet"))[:2]:
        assert not errors(read_session(path))


def test_a_fault_in_some_rows_is_told_with_them_and_a_moment_is_a_warning(sessions):
    session = sessions[0]
    part = session.having(marker=swapped(3, 5, rows=slice(100, 160))(session.marker))
    (text,) = errors(part)
    assert text.startswith("Markers 3 and 5 are swapped, in rows 100–159.")
    brief = session.having(marker=swapped(3, 5, rows=slice(100, 103))(session.marker))
    assert not errors(brief)
    assert any("in rows 100–102: one was mistaken" in f.text for f in examine(brief))


def test_old_frames_and_another_sessions_markers_are_found(sessions):
    session, frozen = sessions[0], sessions[0].marker.copy()
    frozen[60:120] = frozen[60]
    (text,) = errors(session.having(marker=frozen))
    assert "keep the same numbers in rows 61–119 while the motors move" in text
    (text,) = errors(session.having(marker=sessions[1].marker))
    assert text.startswith("The markers do not move as the motors do")


def test_logs_without_markers_and_with_gaps_are_no_error(sessions):
    session = sessions[0]
    none = session.having(marker=np.full_like(session.marker, np.nan))
    assert not errors(replace(none, metadata=session.metadata | {"markers": "none"}))
    gap = session.marker.copy()
    gap[:100, 8] = np.nan
    assert not errors(session.having(marker=gap))
    refuse_damaged([session.having(marker=gap)])


@pytest.mark.parametrize(
    "change", [moved(5, [np.inf, 0, 0]), moved(5, [1e300, 0, 0]), lost(*range(5, 10))]
)
def test_absurd_numbers_are_refused_without_a_warning_of_numpy(change, sessions):
    with np.errstate(all="raise"):
        assert errors(sessions[0].having(marker=change(sessions[0].marker)))


def test_random_markers_are_of_no_single_fault(sessions):
    marker = np.random.default_rng(0).uniform(-0.5, 0.5, sessions[0].marker.shape)
    (text,) = errors(sessions[0].having(marker=marker))
    assert "no single fault of scale, frame, order or place explains it" in text
    assert errors(sessions[0].having(marker=standing(1)(sessions[0].marker)))
