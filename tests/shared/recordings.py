"""Recordings of other tools, made of one motion, and their import."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv
import pyarrow.parquet as pq
import pytest

from serpent_twin.exchange.importing import import_logs

TIME = np.arange(0.0, 6.0, 0.02)
EPOCH = 1.7e9
"""When messages begin [s]"""
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


def angle(time):
    """The motion [rad] at times [s]."""
    return 0.8 * np.sin(2 * time) + 0.3 * np.sin(5.3 * time + 1)


ANGLE = angle(TIME)
TABLE = """[[stream]]
time = "t"
{}
fields = [{{ field = "q", column = "elbow", unit = "deg" }}]
"""


def mapped(folder, text):
    """A map.toml."""
    path = folder / "map.toml"
    path.write_text("schema_version = 1\n" + text)
    return path


def imported(folder, files, text, machine=None):
    """What was imported, and the columns of the first log."""
    found = import_logs(files, mapped(folder, text), folder / "out", machine)
    table = pq.read_table(folder / "out" / f"{found[0].name}.parquet")
    return found, {name: table.column(name).to_numpy() for name in table.column_names}


def table(path, **columns):
    """A CSV file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    csv.write_csv(pa.table(columns), path)
    return path


def json_mcap(path: Path, *channels):
    """An MCAP file of JSON: topic, times, messages and metadata of each channel."""
    writing = pytest.importorskip("mcap.writer")
    with path.open("wb") as file:
        writer = writing.Writer(file, use_chunking=False)
        writer.start()
        schema = writer.register_schema("J", "jsonschema", b"{}")
        rows = []
        for topic, times, messages, *about in channels:
            channel = writer.register_channel(topic, "json", schema, *about)
            rows += [(t, channel, m) for t, m in zip(times, messages, strict=True)]
        for t, channel, message in sorted(rows, key=lambda row: row[0]):
            stamp = round(1e9 * (EPOCH + t))
            writer.add_message(channel, stamp, json.dumps(message).encode(), stamp)
        writer.finish()
    return path


def positions(values):
    """Messages with one position each."""
    return [{"position": [float(each)]} for each in values]


def joint_states(path: Path, *messages):
    """An MCAP file of ROS 2's JointState: time, frame, and position by joint, in the order listed."""
    writing = pytest.importorskip("mcap_ros2.writer")
    with path.open("wb") as file, writing.Writer(file) as out:
        schema = out.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for t, frame, joints in messages:
            stamp = round(1e9 * (EPOCH + t))
            header = {
                "stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9},
                "frame_id": frame,
            }
            content = {
                "header": header,
                "name": [*joints],
                "position": [*map(float, joints.values())],
            }
            out.write_message("/joint_states", schema, content, stamp, stamp)
    return path
