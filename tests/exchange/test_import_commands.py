"""Test that commands are held until the next one, and readings interpolated."""

import numpy as np
import pytest
from recordings import ANGLE, TIME, angle, imported, json_mcap, positions, table

from serpent_twin.errors import SerpentError
from serpent_twin.exchange.importing import machine_of
from serpent_twin.exchange.writing import summary

SLOW = np.arange(0.0, 6.0, 0.1)
TOLD = np.round(0.8 * np.sin(2 * SLOW), 3)
MAP = """rate_hz = 50
[[stream]]
topic = "/js"
fields = [{{ field = "position[0]", column = "q", unit = "rad" }}]
[[stream]]
topic = "{topic}"
{stated}
fields = [{{ field = "position[0]", column = "{column}", unit = "rad" }}]
"""
MACHINE = """schema_version = 1
model = "model.xml"
rows = "motion"
time = { column = "time", unit = "s" }
[[drive]]
actuator = "servo"
column = "x"
[[measured]]
joint = "elbow"
columns = ["q"]
unit = "rad"
"""


def in_force(time):
    """The command that was sent last."""
    return TOLD[np.searchsorted(SLOW, time + 1e-6) - 1]


def recording(path, topic, times=SLOW, values=TOLD):
    return json_mcap(path, ("/js", TIME, positions(ANGLE)), (topic, times, positions(values)))


def machine(folder):
    path = folder / "machine.toml"
    path.write_text(MACHINE)
    return path


@pytest.mark.parametrize(
    ("topic", "column", "stated", "described"),
    [
        ("/x", "x", "hold = true", False),
        ("/arm/goal_position", "x", "", False),
        ("/x", "jointCommand1", "", False),
        ("/x", "u1", "", False),
        ("/joint_states_2", "x", "", True),  # whatever its topic is called
    ],
)
def test_a_command_that_comes_less_often_than_rows_is_held(
    tmp_path, topic, column, stated, described
):
    """A straight line to the next one has half of it before it was sent, which a trace took for a delay."""
    text = MAP.format(topic=topic, column=column, stated=stated)
    file = recording(tmp_path / "run.mcap", topic)
    found, log = imported(tmp_path, [file], text, machine(tmp_path) if described else None)
    np.testing.assert_allclose(log[column], in_force(log["time"]), atol=1e-9)
    np.testing.assert_allclose(log["q"], angle(log["time"]), atol=1e-6)
    assert f"held until the next one: {column}." in summary(found)


def test_a_machine_toml_beside_the_map_says_what_commands_are(tmp_path):
    assert machine_of(None, tmp_path / "map.toml", tmp_path / "logs") is None
    path = machine(tmp_path)
    assert machine_of(None, tmp_path / "map.toml", tmp_path / "else" / "logs") == path
    assert machine_of(None, tmp_path / "maps" / "map.toml", tmp_path / "logs") == path
    assert machine_of(tmp_path, tmp_path / "maps" / "map.toml", tmp_path / "else" / "logs") == path


def test_what_may_be_either_is_asked(tmp_path):
    text = MAP.format(topic="/x", column="x", stated="")
    with pytest.raises(SerpentError, match=r"x of /x come every 100 ms.*every 20 ms.*hold = true"):
        imported(tmp_path, [recording(tmp_path / "run.mcap", "/x")], text)


def test_a_slow_camera_is_interpolated(tmp_path):
    """Held, it would be late by half of the time between pictures."""
    times = np.arange(0.0, 6.0, 1 / 30)
    file = recording(tmp_path / "run.mcap", "/camera", times, angle(times))
    text = MAP.format(topic="/camera", column="seen", stated="hold = false")
    _, log = imported(tmp_path, [file], text)
    np.testing.assert_allclose(log["seen"], angle(log["time"]), atol=2e-3)


def test_the_last_command_is_in_force_to_the_end(tmp_path):
    file = recording(tmp_path / "run.mcap", "/cmd", [0.0, 1.0, 2.5], [0.1, 0.5, -0.3])
    _, log = imported(tmp_path, [file], MAP.format(topic="/cmd", column="x", stated=""))
    time = log["time"]
    assert time[-1] == pytest.approx(TIME[-1], abs=1e-6)
    wanted = np.where(time < 1 - 1e-6, 0.1, np.where(time < 2.5 - 1e-6, 0.5, -0.3))
    np.testing.assert_allclose(log["x"], wanted, atol=1e-9)


def test_a_command_within_a_row_acts_for_its_share_of_it(tmp_path):
    """No command comes early or late on the whole: sums of commands over time are those that were sent."""
    times = SLOW + 0.007
    file = recording(tmp_path / "run.mcap", "/cmd", times)
    _, log = imported(tmp_path, [file], MAP.format(topic="/cmd", column="x", stated=""))
    rows = log["time"] + times[0]  # the log begins with the first command
    changed = np.isclose((rows - 0.007) % 0.1, 0.08, atol=1e-3)
    assert np.isin(np.round(log["x"][~changed], 9), np.round(TOLD, 9)).all()
    sent = np.interp(rows[-1], np.r_[times, 6.007], np.r_[0, np.cumsum(TOLD * 0.1)])
    assert 0.02 * log["x"][:-1].sum() == pytest.approx(sent, abs=1e-6)


def test_a_switch_is_on_or_off(tmp_path):
    times = np.arange(0.0, 6.0, 0.25) + 0.008
    values = np.arange(len(times)) % 2
    file = recording(tmp_path / "run.mcap", "/cmd", times, values)
    _, log = imported(tmp_path, [file], MAP.format(topic="/cmd", column="x", stated=""))
    assert set(log["x"]) == {0.0, 1.0}


def test_a_field_of_a_table_may_be_held_where_others_are_not(tmp_path):
    slow = np.repeat(TOLD, 5)
    file = table(tmp_path / "run.csv", t=TIME, q=ANGLE, x=slow)
    text = """rate_hz = 400
[[stream]]
time = "t"
hold = false
fields = [{ field = "q", column = "q" }, { field = "x", column = "x", hold = true }]
"""
    _, log = imported(tmp_path, [file], text)
    assert np.isin(np.round(log["x"], 9), np.round(TOLD, 9)).all()
    np.testing.assert_allclose(log["q"], angle(log["time"]), atol=1e-3)
