"""Test that recordings of other tools become logs in SI units, on one clock, and go out again."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv
import pyarrow.parquet as pq
import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.exchange.clocks import lateness
from serpent_twin.exchange.exporting import export
from serpent_twin.exchange.importing import import_logs
from serpent_twin.exchange.writing import summary

TIME = np.arange(0.0, 6.0, 0.02)
ANGLE = 0.8 * np.sin(2 * TIME) + 0.3 * np.sin(5.3 * TIME + 1)  # [rad]
MAP = """schema_version = 1
[[stream]]
{topic}
fields = [{{ field = "{field}", column = "elbow", unit = "deg", scale = -1, offset = 0.1 }}]
"""
STATE = """# the message that an encoder sends
float64[] position
"""


def mapped(tmp_path, text):
    path = tmp_path / "map.toml"
    path.write_text(text)
    return path


def read(path):
    table = pq.read_table(path)
    return {name: table.column(name).to_numpy() for name in table.column_names}


def table(path, **columns):
    csv.write_csv(pa.table(columns), path)
    return path


def imported(tmp_path, files, text):
    found = import_logs(files, mapped(tmp_path, text), tmp_path / "out")
    return found, read(tmp_path / "out" / f"{found[0].name}.parquet")


def is_elbow(log, step=1e-9):
    time = log["time"] + TIME[0]
    np.testing.assert_allclose(log["elbow"], 0.1 - np.interp(time, TIME, ANGLE), atol=step)


def test_a_table_becomes_a_log_in_si_units(tmp_path):
    file = table(tmp_path / "run.csv", t=1e3 * TIME + 7e3, q=np.degrees(ANGLE), current=ANGLE)
    text = MAP.format(topic='time = "t"\ntime_unit = "ms"', field="q")
    found, log = imported(tmp_path, [file], text)
    is_elbow(log)
    assert log["time"][0] == 0 and list(log) == ["time", "elbow"]
    field = pq.read_schema(tmp_path / "out" / "run.parquet").field("elbow")
    assert field.metadata[b"unit"] == b"rad" and field.metadata[b"field"] == b"q"
    assert "current" in summary(found)  # what was left
    told = json.loads((tmp_path / "out" / "imported.json").read_text())
    assert told["logs"][0]["streams"][0]["left_out"] == ["current"]


def test_places_are_turned_into_the_frame_that_is_wanted(tmp_path):
    """Y up, as cameras have it, becomes z up."""
    file = table(tmp_path / "run.csv", t=TIME, x=1e3 * ANGLE, y=0 * TIME + 500, z=-1e3 * ANGLE)
    text = """schema_version = 1
[[stream]]
time = "t"
[[stream.points]]
fields = ["x", "y", "z"]
columns = ["px", "py", "pz"]
unit = "mm"
axes = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
origin = [0, 0, -0.1]
"""
    _, log = imported(tmp_path, [file], text)
    np.testing.assert_allclose(
        [log["px"], log["py"], log["pz"] - 0.4], [ANGLE, ANGLE, 0 * ANGLE], atol=1e-12
    )


def test_rows_are_taken_at_the_rate_that_is_asked_and_gaps_are_left_unknown(tmp_path):
    kept = (TIME < 2) | (TIME > 3)
    file = table(tmp_path / "run.csv", t=TIME[kept], q=np.degrees(ANGLE[kept]))
    text = MAP.format(topic='time = "t"', field="q").replace("[[", "rate_hz = 40\n[[", 1)
    _, log = imported(tmp_path, [file], text)
    np.testing.assert_allclose(np.diff(log["time"]), 1 / 40, atol=1e-12)
    inside = (log["time"] > 1.98 + 1e-9) & (log["time"] < 3.02 - 1e-9)
    assert np.isnan(log["elbow"][inside]).all() and np.isfinite(log["elbow"][~inside]).all()
    some = {name: values[~inside] for name, values in log.items()}
    is_elbow(some, step=1e-3)  # of straight lines between rows


def test_messages_out_of_order_are_sorted_and_counted(tmp_path):
    order = np.arange(len(TIME))
    order[[10, 11]] = order[[11, 10]]
    file = table(tmp_path / "run.csv", t=TIME[order], q=np.degrees(ANGLE[order]))
    found, log = imported(tmp_path, [file], MAP.format(topic='time = "t"', field="q"))
    is_elbow(log)
    assert found[0].streams[0].unsorted == 1


@pytest.mark.parametrize("late", [-0.6137, 0.0, 0.0213, 1.42])
def test_a_clock_is_set_by_motion(late):
    """The delay is found to 1 ms, a twentieth of a row, whatever the scale and sign of what moves alike."""
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0, 6, 700))
    other = 0.8 * np.sin(2 * time) + 0.3 * np.sin(5.3 * time + 1)
    noise = 1e-3 * rng.standard_normal(len(TIME))
    found = lateness(TIME + late, -3 * ANGLE + 1 + noise, time, other, 2.0)
    assert found.late == pytest.approx(late, abs=1e-3) and found.correlation > 0.9


def test_a_stream_whose_clock_is_late_is_brought_onto_the_other(tmp_path):
    late = 0.234
    columns = {"t": TIME, "q": np.degrees(ANGLE)}
    one = table(tmp_path / "run.csv", **columns, t2=TIME + late, seen=2 * ANGLE)
    text = (
        MAP.format(topic='time = "t"', field="q")
        + """
[[stream]]
time = "t2"
fields = [{ field = "seen", column = "camera" }]
follows = { own = "camera", like = "elbow" }
"""
    )
    found, log = imported(tmp_path, [one], text)
    assert found[0].streams[1].clock.late == pytest.approx(late, abs=1e-3)
    np.testing.assert_allclose(log["camera"], 2 * (0.1 - log["elbow"]), atol=5e-3)


def test_columns_that_do_not_move_alike_set_no_clock():
    noise = np.random.default_rng(1).standard_normal(len(TIME))
    with pytest.raises(SerpentError, match=r"do not move alike within 2 s.*Name others"):
        lateness(TIME, noise, TIME, ANGLE, 2.0)


def test_mcap_of_ros_2_is_read(tmp_path):
    writer = pytest.importorskip("mcap_ros2.writer")
    path = tmp_path / "run.mcap"
    with path.open("wb") as file, writer.Writer(file) as out:
        schema = out.register_msgdef("demo/State", STATE)
        for t, q in zip(TIME, np.degrees(ANGLE), strict=True):
            stamp = round(1e9 * (t + 1e9))
            out.write_message("/state", schema, {"position": [0.0, q]}, stamp, stamp)
    _, log = imported(tmp_path, [path], MAP.format(topic='topic = "/state"', field="position[1]"))
    is_elbow(log, step=1e-6)  # of times of 1e18 ns


def test_what_goes_out_as_mcap_or_csv_comes_back(tmp_path):
    pytest.importorskip("mcap")
    log = tmp_path / "log.parquet"
    values = np.degrees(ANGLE)
    values[5] = np.nan
    pq.write_table(pa.table({"time": TIME, "q": values}), log)
    assert export(log, tmp_path / "log.mcap") == export(log, tmp_path / "log.csv") == len(TIME)
    text = MAP.format(topic='topic = "/log"', field="q").replace("deg", "rad").replace("-1", "1")
    import_logs([tmp_path / "log.mcap"], mapped(tmp_path, text), tmp_path / "out")
    again = read(tmp_path / "out" / "log.parquet")["elbow"] - 0.1
    known = np.isfinite(values)  # null is bridged, in one row
    np.testing.assert_allclose(again[known], values[known], atol=1e-12)
    back = csv.read_csv(tmp_path / "log.csv")
    np.testing.assert_array_equal(back.column("time").to_numpy(), TIME)
    with pytest.raises(SerpentError, match=r"log.csv exists. Name another file"):
        export(log, tmp_path / "log.csv")


def test_a_ros_2_bag_is_read(tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.LATEST)
    kind = "sensor_msgs/msg/JointState"
    State, Header, Time = (
        types.types[n] for n in (kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    with rosbag2.Writer(tmp_path / "bag", version=9) as out:
        connection = out.add_connection("/joint_states", kind, typestore=types)
        for t, q in zip(TIME, np.degrees(ANGLE), strict=True):
            stamp = Header(Time(int(t), round(1e9 * (t % 1))), "")
            message = State(stamp, ["elbow"], np.array([q]), np.array([]), np.array([]))
            raw = types.serialize_cdr(message, kind)
            out.write(connection, round(1e9 * (t + 5)), raw)
    topic = 'topic = "/joint_states"\ntime = "header.stamp"'
    _, log = imported(tmp_path, [tmp_path / "bag"], MAP.format(topic=topic, field="position[0]"))
    is_elbow(log, step=1e-8)


def test_episodes_of_a_lerobot_data_set_are_logs(tmp_path):
    folder = tmp_path / "set"
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text('{"codebase_version": "v3.0", "fps": 50}')
    state = np.stack([0 * ANGLE, np.degrees(ANGLE)], axis=1).astype(np.float32)
    rows = {
        "observation.state": [*state.tolist(), *(2 * state).tolist()],
        "timestamp": np.tile(TIME, 2).astype(np.float32),
        "episode_index": np.repeat([0, 1], len(TIME)),
    }
    pq.write_table(pa.table(rows), folder / "data" / "chunk-000" / "file-000.parquet")
    text = MAP.format(topic='time = "timestamp"', field="observation.state[1]")
    found, log = imported(tmp_path, [folder], text)
    assert [each.name for each in found] == ["episode_000000", "episode_000001"]
    is_elbow(log, step=1e-4)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MAP.format(topic='time = "t"', field="angle"), r"run.*stream\[0\]: there is no field 'angle'"),
        (MAP.format(topic='topic = "/a"\ntime = "t"', field="q"), r"there is no topic '/a'"),
        (MAP.format(topic="", field="q"), "a table needs time"),
        (MAP.format(topic='time = "t"', field="q") + "[[stream]]", "has neither fields nor points"),
        (MAP.format(topic='time = "t"', field="q").replace("deg", "degrees"), "unit"),
        (MAP.format(topic='time = "t"\nlate = 1', field="q").replace("late = 1", "late = true"), "late"),
    ],
)  # fmt: skip
def test_what_a_map_gets_wrong_is_said(tmp_path, text, said):
    file = table(tmp_path / "run.csv", t=TIME, q=ANGLE)
    with pytest.raises(SerpentError, match=said):
        import_logs([file], mapped(tmp_path, text), tmp_path / "out")


def test_nothing_is_overwritten(tmp_path):
    file = table(tmp_path / "run.csv", t=TIME, q=ANGLE)
    map_path = mapped(tmp_path, MAP.format(topic='time = "t"', field="q"))
    import_logs([file], map_path, tmp_path / "out")
    other = table(tmp_path / "other.csv", t=TIME, q=ANGLE)
    with pytest.raises(SerpentError):
        import_logs([other], map_path, tmp_path / "out")


def test_what_is_no_recording_is_said(tmp_path):
    path = tmp_path / "run.doc"
    path.write_text("1,2")
    map_path = mapped(tmp_path, MAP.format(topic='time = "t"', field="q"))
    with pytest.raises(
        SerpentError, match=r"run.doc is of no kind that can be read. There are: a LeRobot"
    ):
        import_logs([path], map_path, tmp_path / "out")
    torn = tmp_path / "run.mcap"
    torn.write_bytes(b"\x89MCAP0\r\n" + bytes(20))
    with pytest.raises(SerpentError, match=r"run.mcap cannot be read"):
        import_logs([torn], map_path, tmp_path / "out")
