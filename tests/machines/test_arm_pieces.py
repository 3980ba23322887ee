"""Test what is told of the cameras from an arm's logs."""

from dataclasses import replace

import numpy as np
import pytest
from paths import DATA

from serpent_twin.arm.geometry import ARM, markers
from serpent_twin.errors import SerpentError
from serpent_twin.machines.arm.pieces import (
    camera_noise,
    cut,
    gaps,
    markers_of,
    segment_rows,
    segment_starts,
)
from serpent_twin.sessions import read_session
from serpent_twin.tables.segments import Segments

NOISE = 2.5e-4  # [m]


def with_markers(pieces: Segments, marker: np.ndarray) -> Segments:
    measured = pieces.measured.copy()
    measured[..., :27] = marker.reshape(*measured.shape[:2], 27)
    return replace(pieces, measured=measured)


@pytest.fixture(scope="module")
def rigid() -> Segments:
    """The poses of a logged arm, its markers where rigid links have them, and white noise."""
    log = read_session(DATA / "arm_a" / "session_01.parquet")[:800]
    pieces = cut([log], ARM)
    where = markers(pieces.column["joint_angle"])
    noise = NOISE * np.random.default_rng(1).standard_normal(where.shape)
    return with_markers(pieces, where + noise)


def test_the_noise_of_the_cameras_is_what_no_pose_explains(rigid):
    assert camera_noise(rigid) == pytest.approx(NOISE, rel=0.05)
    lost = with_markers(rigid, np.full_like(markers_of(rigid), np.nan))
    assert camera_noise(lost) == 0.0


def test_what_moves_slowly_beside_every_pose_is_no_noise_of_the_cameras(rigid):
    """Links that twist, or a marker that is knocked: a bar that counted them would pass any such fault."""
    twist = 6e-3 * np.sin(2 * np.pi * rigid.time / 15.0)
    moved = markers_of(rigid).copy()
    moved[:, :, 3:, 2] += twist[..., None] * np.linspace(0.5, -0.7, 6)
    assert camera_noise(with_markers(rigid, moved)) == pytest.approx(NOISE, rel=0.1)


@pytest.mark.parametrize("rows", [800, 600, 240, 613, 133])
def test_every_row_of_a_session_is_compared_once(rows):
    log = read_session(DATA / "arm_a" / "session_01.parquet")[:rows]
    pieces = cut([log], ARM)
    counted = pieces.first[:, None] + np.arange(pieces.time.shape[1])
    compared = np.isfinite(pieces.measured).any(axis=-1)
    assert sorted(counted[compared]) == list(range(rows))
    moving = log.motor_load[np.abs(log.motor_velocity) > 0.1]
    loads = pieces.measured[..., 27:]
    assert np.nansum(loads) == pytest.approx(moving.sum())
    assert compared.size < 1.1 * rows


def test_segments_end_at_gaps_and_a_short_stretch_counts_too():
    log = read_session(DATA / "arm_a" / "session_01.parquet")[:400]
    log = log.having(time=log.time + np.where(np.arange(400) < 60, 0.0, 7.0))
    pieces = cut([log], ARM)
    assert pieces.first[0] == 0 and pieces.first[1] == 60
    assert np.isfinite(pieces.measured).any(axis=-1).sum() == 400
    steps = np.diff(pieces.time, axis=1)
    assert steps == pytest.approx(0.25, abs=0.02)
    beyond = pieces.column["motor_velocity"][0, 60:]
    assert not beyond.any() and np.isnan(pieces.measured[0, 60:]).all()


def test_gaps_are_rows_after_a_pause():
    time = 0.25 * np.arange(10.0)
    time[6:] += 0.3
    assert np.flatnonzero(gaps(time)).tolist() == [6]
    with pytest.raises(SerpentError, match="at least two rows"):
        gaps(time[:1])


def test_sessions_of_several_lengths_share_segments_of_one():
    assert segment_rows([600, 600], 160) == 150
    assert segment_rows([80], 80) == 80
    rows = segment_rows([1200, 1200, 613], 160)
    assert 120 <= rows <= 200
    starts = segment_starts(613, rows)
    assert starts[0] == 0 and starts[-1] + rows == 613
    assert max(np.diff(starts)) <= rows
