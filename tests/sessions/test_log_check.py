"""Test that damage in a session is named, also by the commands."""

import re
from functools import partial

import numpy as np
import pytest
from session_log import make_session, write_journal
from typed import typed

from serpent_twin import sessions
from serpent_twin.errors import SerpentError

TURN = 2 * np.pi


def put(rows, columns, value):
    """A change of an array: `value`, or a function of what was there, put at rows and columns."""

    def change(x: np.ndarray) -> None:
        x[rows, columns] = value(x[rows, columns]) if callable(value) else value

    return change


def against_the_motion(position: np.ndarray) -> None:
    position[20:, 2] += position[19, 2] - position[20, 2] - 1.2 + TURN


def reboot(position: np.ndarray) -> None:
    position += 3 * TURN
    position[40:, 0] %= TURN


def late(clock: np.ndarray) -> None:
    clock[12:] += 0.4


ALL = slice(None)
DAMAGES = {  # the array, what is done to it, the level and words of the finding that comes first
    "a turn lost": (
        *("motor_position", put(slice(33, None), 6, lambda x: x - TURN)),
        *("error", r"motor7_.*-[01]\.\d\d turns.* row 33"),
    ),
    "a turn gained against the motion": (
        *("motor_position", against_the_motion),
        *("error", r"motor3_.*\+0\.81 turns.* row 20"),
    ),
    "a reboot": ("motor_position", reboot, "error", r"motor1_.*-\d\.\d\d turns.* row 40"),
    "degrees": (
        *("motor_position", put(ALL, 2, lambda x: np.degrees(40 * np.arange(len(x)) % 9))),
        *("error", r"motor3_position jumps in rows 1–59, .* it is not in radians"),
    ),
    "no number": ("motor_load", put(3, 4, np.inf), "error", r"motor5_load.* row 3\."),
    "no target": ("joint_target", put(4, 4, np.nan), "error", r"targets.* row 4\."),
    "millimetres": (
        "marker",
        put(ALL, ALL, lambda x: 1000 * x),
        "error",
        "1000 times .* as if in millimetres",
    ),
    "no marker ever": ("marker", put(ALL, ALL, np.nan), "error", "No marker"),
    "no marker for a while": ("marker", put(slice(20, 30), ALL, np.nan), "warning", "All.* 20–29"),
    "one marker lost": ("marker", put(slice(20, 30), 5, np.nan), "warning", "6 .* 10 .* row 20"),
    "a motor stuck": (
        *("motor_position", put(slice(30, 50), 8, 1.5)),
        *("warning", "Motor 9 stands still in rows 30–49"),
    ),
    "overload": ("motor_load", put(7, 3, -1.3), "warning", r"motor4_load.*±1\.3 in row 7"),
    "a missed deadline": ("time", late, "warning", r"1 of 59 .* row 12; .* 2\.6 periods"),
}


def damaged(name: str) -> sessions.Session:
    """A session that is sound but for one damage."""
    session = make_session()
    array, change, _, _ = DAMAGES[name]
    change(changed := getattr(session, array).copy())
    return session.having(**{array: changed})


@pytest.mark.parametrize("name", DAMAGES)
def test_check_names_injected_damage(name):
    assert [f.level for f in sessions.examine(make_session())] == ["note"]
    session, (_, _, level, says) = damaged(name), DAMAGES[name]
    found, *others = sessions.examine(session)
    assert found.level == level
    assert re.search(says, found.text), found.text
    if level == "error":
        with pytest.raises(SerpentError, match=says):
            sessions.refuse_damaged([make_session(), session])
    else:
        assert [f.level for f in others] == ["note"]
        sessions.refuse_damaged([session])


def test_commands(tmp_path):
    command = partial(typed, "serpent_twin.log")
    write_journal(tmp_path, make_session())
    recovered = command("recover", tmp_path)
    assert recovered.returncode == 0 and "60 rows recovered" in recovered.stdout
    info = command("info", tmp_path)
    assert info.returncode == 0
    for part in ("nominal", "seed: 7", "14.75", "lost markers [%]", "0.56", "recovered"):
        assert part in info.stdout
    assert command("check", tmp_path).returncode == 0
    sessions.write_session(tmp_path / "session_02.parquet", damaged("a turn lost"))
    (tmp_path / "session_03.parquet").write_bytes(b"PAR1")
    check = command("check", tmp_path)
    assert check.returncode == 1
    assert "jumps" in check.stdout and "session_03.parquet: cannot be used" in check.stdout
    assert "2 of 3 sessions" in check.stderr and "Traceback" not in check.stderr
    absent = command("info", tmp_path / "absent")
    assert absent.returncode == 2 and absent.stderr.startswith("error: There is no")


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_a_turn_lost_in_a_long_gap_is_found_and_a_gap_alone_is_none(turns):
    """A reboot leaves a gap: 2 s in which the motor also went on as commanded, or not at all."""
    session = make_session()
    time = np.where(np.arange(len(session)) < 30, session.time, session.time + 1.75)
    command = np.zeros_like(session.motor_velocity_command)
    command[29] = 0.4
    for moved in (0.0, 0.4 * (time[30] - time[29])):
        position = np.zeros_like(session.motor_position)
        position[30:, 4] = moved + turns * 2 * np.pi
        position[30:, :4] = position[30:, 5:9] = moved
        changed = session.having(time=time, motor_position=position, motor_velocity_command=command)
        found = [
            f.text for f in sessions.examine(changed) if "turns" in f.text and f.level == "error"
        ]
        assert bool(found) == bool(turns)
        assert all("motor5_position" in text and "row 30" in text for text in found)
