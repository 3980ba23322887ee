"""Test that the live recording shows what the log holds, and that drawing never stops the arm."""

import numpy as np
import pytest
from live_runs import STEPS, column, estimated, logged, spread, train_few

from serpent_twin.live.draw import Drawing, ellipsoids
from serpent_twin.live.estimate import estimate
from serpent_twin.live.follower import COLUMNS
from serpent_twin.live.options import Estimate
from serpent_twin.live.sample import Page, Sample
from serpent_twin.live.stream import RerunStream


def test_the_recording_holds_what_the_log_says(tmp_path):
    train_few(tmp_path, ("residual",))
    estimate(Estimate(tmp_path / "residual", tmp_path / "run", steps=STEPS))
    session, path = logged(tmp_path / "run"), tmp_path / "run" / "session_01.rrd"
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


def test_ellipsoids_hold_their_share():
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(4, 3, 3))
    half, turned = ellipsoids(roots @ np.swapaxes(roots, 1, 2))
    for n, root in enumerate(roots):
        error = turned[n].inv().apply(rng.standard_normal((20_000, 3)) @ root.T)
        assert (((error / half[n]) ** 2).sum(axis=1) <= 1).mean() == pytest.approx(0.95, abs=0.01)


def sample(k: int) -> Sample:
    unknown = np.full((9, 3, 3), np.nan)
    nothing = np.full(3, np.nan), np.full((3, 3), np.nan), 1, False
    motors, marker = np.zeros((2, 10)), unknown[..., 0]
    return Sample(k / 4, *motors, marker, marker, unknown, np.nan, *nothing)


def test_a_recording_without_rows_leaves_no_file(tmp_path):
    drawing = Drawing(Page("x", "y", tmp_path / "a.rrd", view=False))
    assert drawing.end() == "" and not list(tmp_path.iterdir())
    drawing = Drawing(Page("x", "y", tmp_path / "a.rrd", view=False))
    drawing.add([sample(0), sample(1)])
    assert drawing.end() == "" and [path.name for path in tmp_path.iterdir()] == ["a.rrd"]


def test_a_drawing_process_that_dies_stops_no_arm(tmp_path, capsys):
    row = dict.fromkeys(COLUMNS, np.nan) | {"time": 0.0, "marker": np.zeros((9, 3))}
    row |= {"motor_position": np.zeros(10), "motor_load": np.zeros(10)}
    with RerunStream(Page("x", "y", tmp_path / "a.rrd", view=False)) as stream:
        stream._process.kill()
        stream._process.join()
        for _ in range(200):
            stream.see(row, np.full((9, 3, 3), np.nan))
    assert "the recording is not whole" in capsys.readouterr().out
