"""init answers what it cannot use with a sentence that says what to do, and guesses nothing in silence."""

import shutil
import tomllib

import numpy as np
import pytest
from strange_robots import MOTOR, Form, written

from serpent_twin.errors import SerpentError
from serpent_twin.init import main
from serpent_twin.machines.model import log_file, reading
from serpent_twin.matching import describe

PAIR = Form("hh", angle="deg", seed=2)


def logs_of(folder):
    return sorted((folder / "logs").iterdir())


def renamed(folder, old, new):
    for path in logs_of(folder):
        head, _, rows = path.read_text().partition("\n")
        path.write_text(head.replace(old, new) + "\n" + rows)


def changed(folder, column, change):
    for path in logs_of(folder):
        head, *rows = path.read_text().splitlines()
        n = head.split(",").index(column)
        cells = [row.split(",") for row in rows]
        for each in cells:
            each[n] = f"{change(float(each[n])):.7g}"
        path.write_text("\n".join([head, *map(",".join, cells)]) + "\n")


def described(folder):
    return describe(folder / "robot.xml", [folder / "logs"])


def test_what_is_written_is_read_with_the_logs(tmp_path):
    written(PAIR, tmp_path)
    found = described(tmp_path)
    found.save(tmp_path / "machine.toml")
    machine = reading.read(tmp_path / "machine.toml")
    runs = log_file.read_runs(machine, tmp_path / "logs")
    assert len(runs) == 2 and found.whole and not found.undecided
    assert np.ptp(runs[0].columns["pos_base"]) < 3  # rad


def test_the_table_names_each_column_once_with_a_reason(tmp_path):
    written(PAIR, tmp_path)
    found = described(tmp_path)
    columns = [each.column for each in found.decisions]
    assert len({*columns}) == len(columns) == 12
    assert "lies in the range" in found.table()
    assert "motor temperature" in found.text


def test_an_existing_machine_toml_is_not_overwritten(tmp_path, capsys):
    written(PAIR, tmp_path)
    (tmp_path / "machine.toml").write_text("mine")
    with pytest.raises(SerpentError, match=r"not overwritten.*--out"):
        main(tmp_path / "robot.xml", (tmp_path / "logs",))
    main(tmp_path / "robot.xml", (tmp_path / "logs",), tmp_path / "other.toml")
    assert (tmp_path / "machine.toml").read_text() == "mine"
    assert "next: python -m serpent_twin.check" in capsys.readouterr().out


def test_a_robot_without_actuators_is_told_what_to_add(tmp_path):
    written(PAIR, tmp_path)
    xml = (tmp_path / "robot.xml").read_text()
    head, _, rest = xml.partition("<actuator>")
    (tmp_path / "robot.xml").write_text(head + rest.partition("</actuator>")[2])
    with pytest.raises(SerpentError, match=r"no actuators.*<position name=\"base\""):
        described(tmp_path)


def test_an_actuator_without_a_name_is_named(tmp_path):
    written(PAIR, tmp_path)
    xml = (tmp_path / "robot.xml").read_text()
    (tmp_path / "robot.xml").write_text(xml.replace('name="base_servo" ', ""))
    with pytest.raises(SerpentError, match="which moves the joint base, has no name"):
        described(tmp_path)


def test_meshes_that_are_missing_are_left_out_and_said(tmp_path):
    written(PAIR, tmp_path)
    xml = (tmp_path / "robot.xml").read_text()
    xml = xml.replace("<worldbody>", '<asset><mesh name="m" file="gone.stl"/></asset><worldbody>')
    xml = xml.replace("<geom", '<geom type="mesh" mesh="m" mass="0"/><geom', 1)
    (tmp_path / "robot.xml").write_text(xml)
    found = described(tmp_path)
    assert "gone.stl" in found.notes[0] and not found.undecided
    found.save(tmp_path / "machine.toml")
    assert tomllib.loads(found.text)["model"] == "robot_without_meshes.xml"
    reading.read(tmp_path / "machine.toml")


def test_a_control_range_in_degrees_is_refused(tmp_path):
    written(PAIR, tmp_path)
    xml = (tmp_path / "robot.xml").read_text()
    xml = xml.replace('joint="base" kp', 'ctrllimited="true" ctrlrange="-120 120" joint="base" kp')
    (tmp_path / "robot.xml").write_text(xml)
    with pytest.raises(SerpentError, match="as of degrees"):
        described(tmp_path)


def test_without_commands_it_says_which_rows_are_possible(tmp_path):
    written(PAIR, tmp_path)
    for name in ("base", "shoulder"):
        renamed(tmp_path, f"cmd_{name}_servo", f"{name} humidity")
        renamed(tmp_path, f"effort_{name}_servo", f"{name} temperature")
    with pytest.raises(SerpentError, match=r"no column is a command.*prescribed.*poses"):
        described(tmp_path)


def test_two_columns_alike_are_both_named(tmp_path):
    written(PAIR, tmp_path)
    renamed(tmp_path, "effort_base_servo", "pos_base_raw")
    found = described(tmp_path)
    (said,) = [each for each in found.undecided if "joint base" in each]
    assert "pos_base" in said and "pos_base_raw" in said and not found.whole
    assert 'joint = "base"' not in [line for line in found.text.splitlines() if line[0:1] != "#"]


def test_logs_of_another_robot_match_nothing(tmp_path):
    written(PAIR, tmp_path / "one")
    written(Form("sss", actuators=MOTOR, style="nothing", seed=5), tmp_path / "other")
    with pytest.raises(SerpentError, match="another robot"):
        describe(tmp_path / "one/robot.xml", [tmp_path / "other/logs"])


def test_logs_of_two_robots_are_told_apart(tmp_path):
    written(PAIR, tmp_path / "one")
    written(Form("hh", style="camel", clock="us", seed=5), tmp_path / "other")
    for path in logs_of(tmp_path / "other"):
        shutil.copy(path, tmp_path / "one/logs" / f"x_{path.name}")
    for path in logs_of(tmp_path / "one"):
        head, _, rows = path.read_text().partition("\n")
        for name in ("motor temperature", "loop_count", "battery_V"):
            head = head.replace(name, f"{path.stem[:1]} {name}")
        path.write_text(head + "\n" + rows)
    with pytest.raises(SerpentError, match=r"2 kinds of columns.*one robot"):
        described(tmp_path / "one")


def test_two_robots_in_a_folder_are_named(tmp_path):
    written(PAIR, tmp_path)
    shutil.copy(tmp_path / "robot.xml", tmp_path / "second.xml")
    with pytest.raises(SerpentError, match=r"robot\.xml and second\.xml"):
        describe(tmp_path, [tmp_path / "logs"])


def test_ms_said_to_be_s_are_doubted(tmp_path):
    written(Form("hh", clock="ms", seed=3), tmp_path)
    renamed(tmp_path, "t_ms", "time_s")
    found = described(tmp_path)
    assert tomllib.loads(found.text)["time"] == {"column": "time_s", "unit": "ms"}
    assert any("its name says s, but rows would be" in each for each in found.undecided)


def test_a_unit_that_the_name_states_wrongly_is_doubted(tmp_path):
    written(PAIR, tmp_path)
    renamed(tmp_path, "pos_base", "pos_base_rad")
    found = described(tmp_path)
    assert any("pos_base_rad" in each for each in found.undecided)


def test_an_encoder_with_another_zero_is_doubted(tmp_path):
    written(PAIR, tmp_path)
    changed(tmp_path, "pos_shoulder", lambda value: value + 12.0)
    (said,) = described(tmp_path).undecided
    assert "pos_shoulder" in said and "offset = -0.2" in said  # rad: 12° and what gravity does


def test_exchanged_columns_are_doubted(tmp_path):
    written(PAIR, tmp_path)
    renamed(tmp_path, "pos_base", "pos_was_base")
    renamed(tmp_path, "pos_shoulder", "pos_base")
    renamed(tmp_path, "pos_was_base", "pos_shoulder")
    said = " ".join(described(tmp_path).undecided)
    assert "cmd_base_servo" in said and "correlate" in said


def test_a_single_log_is_allowed_and_said(tmp_path):
    written(PAIR, tmp_path, logs=1)
    found = described(tmp_path)
    assert "a trace needs two" in found.notes[-1] and not found.undecided


def test_a_torque_that_may_be_measured_is_doubted(tmp_path):
    written(Form("h", actuators=MOTOR, seed=6, extra=False), tmp_path)
    renamed(tmp_path, "cmd_base_motor", "torque")
    for path in logs_of(tmp_path):
        lines = [line.rsplit(",", 1)[0] for line in path.read_text().splitlines()]
        path.write_text("\n".join(lines) + "\n")
    assert any("one that was measured" in each for each in described(tmp_path).undecided)


def test_several_runs_in_a_file_are_sessions(tmp_path):
    written(PAIR, tmp_path)
    first, second = (path.read_text().splitlines() for path in logs_of(tmp_path))
    rows = [f"{row},1" for row in first[1:]]
    start = float(second[1].split(",")[0])
    for row in second[1:]:
        time, _, rest = row.partition(",")
        rows.append(f"{float(time) - start:.5f},{rest},2")
    shutil.rmtree(tmp_path / "logs")
    (tmp_path / "one.csv").write_text("\n".join([first[0] + ",trial", *rows]) + "\n")
    found = describe(tmp_path / "robot.xml", [tmp_path / "one.csv"])
    assert tomllib.loads(found.text)["session"] == "trial" and not found.undecided
    found.save(tmp_path / "machine.toml")
    machine = reading.read(tmp_path / "machine.toml")
    assert len(log_file.read_runs(machine, tmp_path / "one.csv")) == 2
