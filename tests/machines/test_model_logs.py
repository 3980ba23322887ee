"""Test that logs of a machine.toml are read however their rows came, and that what was done is said."""

import json

import log_texts
import moving_models
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import swung_models

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.rig import notes_on

told, cells = log_texts.told, log_texts.cells


@pytest.fixture
def swing(tmp_path, told):
    """The machine, a log of it as text, and how it is read."""
    rig = open_machine(swung_models.machine(tmp_path / "machine"))
    (tmp_path / "even.csv").write_text(told[swung_models])
    return rig, told[swung_models], rig.read(tmp_path / "even.csv")[0]


def table(text):
    return np.array([row.split(",") for row in text.splitlines()[1:]], float)


def read(rig, path, text=None):
    """The sessions of a log, and what is said of them."""
    if text is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    runs = rig.read(path)
    return runs, " ".join(notes_on(runs))


def test_lost_repeated_and_jittering_rows_are_put_right_with_counts(tmp_path, swing):
    rig, text, even = swing
    rng = np.random.default_rng(0)
    rows = text.splitlines()
    stamped = cells("t_ms", lambda n, v: v + rng.normal(0, 2.0))(text).splitlines()
    (found,), said = read(
        rig, tmp_path / "log.csv", "\n".join([*stamped[:50], stamped[49], *stamped[52:]])
    )
    assert "1 row repeated" in said and "2 rows lost" in said and "jitter by" in said
    assert len(found) == len(even) == len(rows) - 1
    assert np.flatnonzero(np.isnan(found.columns["angle"])).tolist() == [49, 50]
    known = np.isfinite(found.columns["angle"])
    np.testing.assert_array_equal(found.columns["angle"][known], even.columns["angle"][known])
    goal = found.columns["goal_deg"]
    np.testing.assert_allclose(
        goal, even.columns["goal_deg"], atol=1e-3
    )  # a sine is no held command
    assert "'goal_deg' interpolated, as they change smoothly, in 2 rows" in said
    np.testing.assert_allclose(found.time, even.time, atol=1e-3)


def test_commands_that_come_seldom_are_held_in_empty_cells(tmp_path, swing):
    rig, text, _ = swing
    change = cells("goal_deg", lambda n, v: v if n % 5 == 2 else "")
    (found,), said = read(rig, tmp_path / "log.csv", change(text))
    goal = -np.radians(table(text)[:, 1])
    want = np.repeat(goal[2::5], 5)
    np.testing.assert_allclose(found.columns["goal_deg"], want[: len(goal) - 2], atol=1e-9)
    assert "'goal_deg' held in 120 rows without one" in said and "2 rows at the beginning" in said


def test_states_and_commands_in_two_files_are_joined_by_their_clocks(tmp_path, swing):
    rig, text, _ = swing
    rows = table(text)
    for run in (1, 2):
        states = "\n".join(f"{t},{q}" for t, _, q in rows)
        orders = "\n".join(f"{t},{u}" for t, u, _ in rows[::4])
        (tmp_path / f"run_{run}_states.csv").write_text("t_ms,angle\n" + states)
        (tmp_path / f"run_{run}_commands.csv").write_text("t_ms,goal_deg\n" + orders)
    (tmp_path / "more").mkdir()
    runs, said = read(rig, tmp_path)
    runs = [run for run in runs if "states" in run.name]
    assert [run.name for run in runs] == ["run_1_states", "run_2_states"]
    assert "run_1_commands.csv: joined with run_1_states.csv" in said
    want = -np.radians(np.repeat(rows[::4, 1], 4)[: len(rows)])
    np.testing.assert_allclose(runs[0].columns["goal_deg"], want, atol=1e-9)


def test_a_file_without_its_partner_is_named(tmp_path, swing):
    rig, text, _ = swing
    rows, folder = table(text), tmp_path / "logs"
    folder.mkdir()
    (folder / "run_1_states.csv").write_text(
        "t_ms,angle\n" + "\n".join(f"{t},{q}" for t, _, q in rows)
    )
    with pytest.raises(SerpentError, match=r"run_1_states\.csv has no column 'goal_deg'"):
        rig.read(folder)
    late = "t_ms,goal_deg\n" + "\n".join(f"{t + 1e9},{u}" for t, u, _ in rows)
    (folder / "run_1_commands.csv").write_text(late)
    with pytest.raises(SerpentError, match="Give both the same clock"):
        rig.read(folder)


def test_a_long_pause_parts_a_log_whose_joints_are_measured(tmp_path, swing):
    rig, text, even = swing
    change = cells("t_ms", lambda n, v: v + 5000 * (n > 70))
    runs, said = read(rig, tmp_path / "log.csv", change(text))
    assert [len(run) for run in runs] == [71, len(even) - 71]
    assert [run.name for run in runs] == ["log part 1", "log part 2"]
    assert "read in 2 parts, as nothing was logged for 5.04 s" in said


def test_a_long_pause_parts_a_log_also_where_a_joint_is_not_measured(tmp_path):
    path = moving_models.machine(tmp_path / "machine")
    toml = path.read_text()
    path.write_text(toml[: toml.rindex("[[measured]]")])  # the elbow is not measured
    rig = open_machine(path)
    log = moving_models.log(tmp_path / "log.csv", 0)
    rows = log.read_text().splitlines()
    log.write_text("\n".join(rows[:60] + rows[200:]))
    parts = rig.read(log)
    assert [len(each) for each in parts] == [59, 201]
    assert "read in 2 parts" in notes_on(parts)[0]


@pytest.mark.parametrize(
    ("unit", "scale", "wanted"),
    [("s", 1e-3 / 0.04 / 1e-3, "counts the rows"), ("s", 1.0, "whole numbers that are 40 apart")],
)
def test_clocks_that_are_no_seconds_are_refused(tmp_path, told, unit, scale, wanted):
    path = swung_models.machine(tmp_path / "machine")
    path.write_text(path.read_text().replace('unit = "ms" }', f'unit = "{unit}" }}', 1))
    change = cells("t_ms", lambda n, v: n if "rows" in wanted else int(v))
    (tmp_path / "log.csv").write_text(change(told[swung_models]))
    with pytest.raises(SerpentError, match=wanted):
        open_machine(path).read(tmp_path / "log.csv")


def test_a_clock_in_whole_seconds_is_taken_if_the_scale_says_so(tmp_path, told):
    path = swung_models.machine(tmp_path / "machine")
    path.write_text(path.read_text().replace('unit = "ms" }', 'unit = "s", scale = 0.04 }', 1))
    (tmp_path / "log.csv").write_text(cells("t_ms", lambda n, v: n)(told[swung_models]))
    (run,) = open_machine(path).read(tmp_path / "log.csv")
    np.testing.assert_allclose(np.diff(run.time), 0.04)


def test_a_unit_that_the_file_states_otherwise_is_refused(tmp_path, told):
    rig = open_machine(swung_models.machine(tmp_path / "machine"))
    head, *rows = told[swung_models].splitlines()
    (tmp_path / "log.csv").write_text("\n".join([head, "ms,rad,rad", *rows]))
    with pytest.raises(SerpentError, match=r"'goal_deg' is in rad, as the file says, .* 'deg'"):
        rig.read(tmp_path / "log.csv")


def test_logs_in_subfolders_are_found_and_named_by_their_folders(tmp_path, swing):
    rig, text, _ = swing
    for day in (1, 2, 10):
        (tmp_path / f"logs/day{day}").mkdir(parents=True)
        (tmp_path / f"logs/day{day}/log.csv").write_text(text)
    assert [run.name for run in rig.read(tmp_path / "logs")] == [
        "day1/log",
        "day2/log",
        "day10/log",
    ]
    (tmp_path / "empty/day1").mkdir(parents=True)
    (tmp_path / "empty/day1/log.xlsx").write_text("")
    with pytest.raises(SerpentError, match=r"or its subfolders .*log\.xlsx is a workbook"):
        rig.read(tmp_path / "empty")


def test_a_data_set_of_several_episodes_in_a_file_has_a_session_each(tmp_path, told):
    path = swung_models.machine(tmp_path / "machine")
    path.write_text(
        path.read_text()
        .replace('column = "t_ms", unit = "ms"', 'column = "timestamp", unit = "s"')
        .replace('column = "goal_deg"', 'column = "action.pan"')
        .replace('columns = ["angle"]', 'columns = ["observation.state.pan"]')
    )
    rows, folder = table(told[swung_models]), tmp_path / "set"
    (folder / "meta").mkdir(parents=True)
    names = {each: {"names": ["pan"]} for each in ("action", "observation.state")}
    (folder / "meta" / "info.json").write_text(json.dumps({"features": names}))
    (folder / "data" / "chunk-000").mkdir(parents=True)
    columns = {
        "timestamp": np.tile(1e-3 * rows[:, 0], 2).astype(np.float32),
        "action": pa.array(np.tile(rows[:, 1:2], (2, 1)).tolist()),
        "observation.state": pa.array(np.tile(rows[:, 2:], (2, 1)).tolist()),
        "episode_index": np.repeat([3, 4], len(rows)),
    }
    pq.write_table(pa.table(columns), folder / "data" / "chunk-000" / "file-000.parquet")
    runs = open_machine(path).read(folder)
    assert [run.name for run in runs] == ["episode_000003", "episode_000004"]
    np.testing.assert_allclose(runs[1].columns["action.pan"], -np.radians(rows[:, 1]), atol=1e-6)


def test_a_quaternion_is_refused_with_the_reason(tmp_path):
    path = swung_models.machine(tmp_path / "machine")
    model = tmp_path / "machine" / "lever.xml"
    sensor = '<sensor><framequat name="q" objtype="body" objname="lever"/></sensor></mujoco>'
    model.write_text(model.read_text().replace("</mujoco>", sensor))
    toml, more = (
        path.read_text(),
        '{ joint = "pivot", columns = ["angle"], unit = "rad", noise = 0.0005 }',
    )
    assert more in toml
    path.write_text(toml.replace(more, '{ sensor = "q", columns = ["a", "b", "c", "d"] }'))
    with pytest.raises(SerpentError, match="q and −q are one attitude"):
        open_machine(path)


def test_a_model_without_actuators_says_which_lines_to_add(tmp_path):
    path = swung_models.machine(tmp_path / "machine")
    urdf = """<robot name="r"><link name="base"/><link name="l"><inertial><mass value="0.2"/>
    <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="pivot"
    type="revolute"><parent link="base"/><child link="l"/><axis xyz="0 1 0"/><limit lower="-2" upper="2"
    effort="5" velocity="3"/></joint></robot>"""
    (tmp_path / "machine" / "lever.urdf").write_text(urdf)
    toml = path.read_text().replace("lever.xml", "lever.urdf")
    path.write_text(toml.replace('actuator = "servo"', 'actuator = "pivot"'))
    with pytest.raises(
        SerpentError, match=r'no actuators: say which joints .*<position name="pivot"'
    ):
        open_machine(path)
