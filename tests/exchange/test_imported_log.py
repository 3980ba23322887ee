"""Test that imported logs are read by the same machine.toml as the recordings, looked into and replayed."""

from functools import partial

import moving_models
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from example import Example
from recordings import ANGLE, TABLE, TIME, imported, mapped, table
from rerun.chunk import RrdReader
from typed import typed

from serpent_twin import machines
from serpent_twin.errors import SerpentError

COMMAND = np.round(ANGLE, 2)
MODEL = """<mujoco>
  <option timestep="0.002"/>
  <worldbody><body>
    <joint name="j" axis="0 1 0" damping="0.1"/><geom size="0.05" mass="0.2" pos="0.1 0 0"/>
  </body>
  </worldbody>
  <actuator><position name="servo" joint="j" kp="5"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "model.xml"
rows = "motion"
time = {{ column = "{time}", unit = "{time_unit}" }}
[[drive]]
actuator = "servo"
column = "{command}"
unit = "{unit}"
scale = {scale}
[[measured]]
joint = "j"
columns = ["{reading}"]
unit = "{unit}"
scale = {scale}
"""
RAW = {
    "time": "t",
    "time_unit": "ms",
    "command": "goal",
    "reading": "q",
    "unit": "deg",
    "scale": -1,
}
MAP = """[[stream]]
time = "t"
time_unit = "ms"
fields = [
    {{ field = "goal", column = "{goal}", unit = "deg", scale = {scale} }},
    {{ field = "q", column = "{q}", unit = "deg", scale = {scale} }},
]
"""


def machine(folder, **keys):
    Example(MODEL, TOML.format(**RAW | keys)).write(folder)
    return machines.find(str(folder / "machine.toml"))


def recording(tmp_path):
    """Recording in milliseconds and degrees, of an encoder whose sign is the other one."""
    return table(
        tmp_path / "raw" / "run.csv",
        t=1e3 * TIME,
        goal=-np.degrees(COMMAND),
        q=-np.degrees(ANGLE),
    )


@pytest.mark.parametrize("scale", [1, -1])
@pytest.mark.parametrize("names", [{"goal": "goal", "q": "q"}, {"goal": "told", "q": "elbow"}])
def test_one_machine_toml_reads_a_recording_and_its_import(tmp_path, scale, names):
    """The machine.toml has the recording's names and units, whatever the map makes of these."""
    imported(tmp_path, [recording(tmp_path)], MAP.format(scale=scale, **names))
    rig = machine(tmp_path / "robot")
    for folder in (tmp_path / "raw", tmp_path / "out"):
        (log,) = rig.read(folder)
        np.testing.assert_allclose(log.columns["time"], TIME, atol=1e-9)
        np.testing.assert_allclose(log.columns["goal"], COMMAND, atol=1e-9)
        np.testing.assert_allclose(log.columns["q"], ANGLE, atol=1e-9)


def test_a_machine_toml_of_an_imported_log_is_in_si_units(tmp_path):
    imported(tmp_path, [recording(tmp_path)], MAP.format(scale=-1, goal="told", q="elbow"))
    keys = {"time": "time", "time_unit": "s", "command": "told", "reading": "elbow", "unit": "rad"}
    (log,) = machine(tmp_path / "robot", **keys, scale=1).read(tmp_path / "out")
    np.testing.assert_allclose(log.columns["elbow"], ANGLE, atol=1e-9)
    with pytest.raises(SerpentError, match=r"was scaled by -1 .* states both again. Leave scale"):
        machine(tmp_path / "twice", **keys).read(tmp_path / "out")


def test_a_unit_that_is_neither_the_logs_nor_the_recordings_is_refused(tmp_path):
    imported(tmp_path, [recording(tmp_path)], MAP.format(scale=-1, goal="goal", q="q"))
    with pytest.raises(SerpentError, match="is in rad, as the file says"):
        machine(tmp_path / "robot", unit="mrad", scale=1).read(tmp_path / "out")


@pytest.fixture
def logs(tmp_path):
    imported(tmp_path, [recording(tmp_path)], MAP.format(scale=-1, goal="told", q="elbow"))
    return tmp_path / "out"


def test_the_commands_look_into_an_imported_log(logs, tmp_path):
    log = partial(typed, "serpent_twin.log")
    for path in (logs, logs / "run.parquet"):
        info = log("info", path)
        assert info.returncode == 0 and "300 rows, 5.98 s, 50 rows a second" in info.stdout
        assert "told    rad   command" in info.stdout and "elbow   rad   reading" in info.stdout
        check = log("check", path)
        assert check.returncode == 0 and "300 rows, sound" in check.stdout
    exported = log("export", logs / "run.parquet", "--out", tmp_path / "run.csv")
    assert exported.returncode == 0 and "300 rows" in exported.stdout


def test_replay_shows_the_columns_of_an_imported_log(logs, tmp_path):
    out = tmp_path / "run.rrd"
    done = typed("serpent_twin.replay", logs / "run.parquet", "--out", out)
    assert done.returncode == 0 and "log of another machine: its 2 columns" in done.stdout
    assert done.stdout.endswith(f"{out}\n")
    entities = {chunk.entity_path for chunk in RrdReader(out).stream().to_chunks()}
    assert {"/rad/told", "/rad/elbow"} <= entities
    again = typed("serpent_twin.replay", logs / "run.parquet", "--out", out)
    assert again.returncode == 0
    other = ["--out", tmp_path / "x.rrd", "--twin", tmp_path / "twin.json"]
    refused = typed("serpent_twin.replay", logs / "run.parquet", *other)
    assert refused.returncode == 1 and "is a log of another machine, and" in refused.stderr


ODD = {
    "q is unknown for up to 0.1 s": lambda c: c["q"].__setitem__(slice(5, 10), np.nan),
    "q is 0 in every row": lambda c: c["q"].__setitem__(slice(None), 0.0),
    "q jumps by about a turn in row 100": lambda c: c["q"].__setitem__(slice(100, None), ANGLE[100:] + 6.3),
    "r and q are the same in every row": lambda c: c["r"].__setitem__(slice(None), c["q"]),
    "rows are 0.02 s apart, and up to 1.02 s in row 50": lambda c: c["time"].__setitem__(
        slice(50, None), TIME[50:] + 1
    ),
}  # fmt: skip


@pytest.mark.parametrize("said", ODD)
def test_check_says_what_is_odd_about_an_imported_log(tmp_path, said):
    columns = {"time": TIME.copy(), "r": 2 * ANGLE, "q": ANGLE.copy()}
    ODD[said](columns)
    fields = [
        pa.field(n, pa.float64(), metadata={"unit": "s" if n == "time" else "rad"}) for n in columns
    ]
    arrays = [pa.array(each) for each in columns.values()]
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), tmp_path / "run.parquet")
    done = typed("serpent_twin.log", "check", tmp_path / "run.parquet")
    assert done.returncode == 0 and f"warning: {said}" in done.stdout


def test_a_clock_that_stands_still_is_an_error(tmp_path):
    pq.write_table(pa.table({"time": np.minimum(TIME, 3.0), "q": ANGLE}), tmp_path / "run.parquet")
    done = typed("serpent_twin.log", "check", tmp_path)
    assert done.returncode == 1 and "time does not increase in rows 151" in done.stdout
    assert "1 of 1 log cannot be trusted: run.parquet" in done.stderr


def test_import_and_check_exit_alike_for_errors(tmp_path):
    rig = moving_models.machine(tmp_path / "robot")
    absent = tmp_path / "absent"
    words = ["--map", mapped(tmp_path, TABLE.format("")), "--out", tmp_path / "out"]
    ends = [
        typed("serpent_twin.log", "import", absent, *words),
        typed("serpent_twin.log", "check", absent),
        typed("serpent_twin.check", "--machine", rig, "--logs", absent),
    ]
    assert [each.returncode for each in ends] == [2, 2, 2]
    assert all(each.stderr.startswith("error: There is no") for each in ends)


def test_import_names_the_next_command(tmp_path):
    machine(tmp_path / "robot")
    file = recording(tmp_path)
    words = ["--map", mapped(tmp_path, MAP.format(scale=1, goal="goal", q="q"))]
    done = typed(
        "serpent_twin", "log", "import", file, *words, "--out", tmp_path / "robot" / "logs"
    )
    assert (
        done.returncode == 0 and f"{tmp_path / 'robot' / 'machine.toml'} says which" in done.stdout
    )
    assert "next: python -m serpent_twin check --machine" in done.stdout
