"""Test that windows hold what was published, and that a damaged session is left out."""

from itertools import product

import numpy as np
import pytest
from learning_sessions import make_session, make_windows

from serpent_twin.errors import SerpentError
from serpent_twin.readouts import find, load
from serpent_twin.readouts import windows as win
from serpent_twin.training.split import split


@pytest.mark.parametrize("window", [1, 2, 4, 7])
def test_windows_agree_with_a_literal_loop(window):
    session = make_session(3, rows=40)
    found = win.cut([session], window, drop=5).sessions[0]
    s = np.concatenate([session.motor_position[:, :9], session.motor_load[:, :9]], axis=1)
    u = session.motor_velocity_command[:, :9]
    first = max(5, window - 1)
    for t in range(first, 40):
        literal = [s[t - k] for k in range(window)] + [u[t - k] for k in range(1, window)]
        np.testing.assert_array_equal(found.x[t - first], np.concatenate(literal))
    assert found.x.shape == (40 - first, 27 * window - 9)
    np.testing.assert_array_equal(found.marker, session.marker[first:])


def test_a_sequence_holds_the_windows_rows_oldest_first_without_the_newest_command():
    x = make_windows(range(1, 2)).x
    sequence = win.steps(x, 4)
    session = make_session(1)
    np.testing.assert_array_equal(sequence[0, 0, :9], session.motor_position[7, :9])
    np.testing.assert_array_equal(sequence[0, 3, 9:18], session.motor_load[10, :9])
    np.testing.assert_array_equal(sequence[0, 2, 18:], session.motor_velocity_command[9, :9])
    assert not sequence[:, 3, 18:].any()


def test_without_loads_63_numbers_of_a_window_of_four_are_left():
    kept = win.columns_without_loads(4)
    assert len(kept) == 4 * 9 + 3 * 9
    x = make_windows(range(1, 2)).x
    changed = x.copy()
    for k, j in product(range(4), range(9)):
        changed[:, 18 * k + 9 + j] = np.nan
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(changed[0])), kept)


def test_a_lost_turn_count_is_named_with_file_row_and_motor():
    session = make_session(1)
    position = session.motor_position.copy()
    position[200:, 2] -= 2 * np.pi
    broken = session.having(motor_position=position)
    with pytest.raises(SerpentError, match=r"session_01: motor3_position jumps .* row 200"):
        win.cut([broken], 4)


def test_too_short_a_session_and_too_few_sessions_are_named():
    with pytest.raises(SerpentError, match="session_01 has 90 rows; with the first 100 dropped"):
        win.cut([make_session(1, rows=90)], 4)
    with pytest.raises(SerpentError, match="2 sessions are too few"):
        split([make_session(1), make_session(2)])


def test_sessions_are_split_as_published():
    names = split([make_session(n, rows=20) for n in range(1, 24)]).names()
    assert names["train"] == [f"session_{n:02d}" for n in range(1, 21)]
    assert names["validate"] == ["session_21", "session_22"]
    assert names["test"] == ["session_23"]
    few = split([make_session(n, rows=20) for n in range(1, 5)]).names()
    assert [len(few[part]) for part in ("train", "validate", "test")] == [2, 1, 1]
    chosen = split([make_session(n, rows=20) for n in range(1, 5)], ["session_02"], ["session_01"])
    assert chosen.names() == {
        "train": ["session_03", "session_04"],
        "validate": ["session_02"],
        "test": ["session_01"],
    }


def test_a_readout_refuses_rows_at_another_rate(tmp_path):
    """Trained at 4 Hz, it is not shown 10 Hz, not even after it was saved and loaded."""
    sessions = [make_session(number, rows=60) for number in (1, 2)]
    windows = win.cut(sessions, 4, drop=0)
    trained = find("linear")(4)
    trained.fit(windows, windows, np.random.default_rng(0))
    trained.save(tmp_path)
    loaded = load(tmp_path)
    loaded.require_rate(sessions[0].rate_hz)
    with pytest.raises(SerpentError, match="4 Hz, these come at 10 Hz"):
        loaded.require_rate(10.0)
