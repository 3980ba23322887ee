"""Test the command that takes a model and logs to a diagnosis."""

from pathlib import Path

import pytest
from strange_robots import Form, written

from serpent_twin import diagnosing
from serpent_twin.diagnosing import Diagnose, diagnose
from serpent_twin.errors import SerpentError


@pytest.fixture
def traced(monkeypatch):
    """Configs that would have been traced."""
    configs = []
    monkeypatch.setattr(diagnosing, "trace", configs.append)
    return configs


def test_machine_toml_is_written_once_and_then_used_as_it_is(tmp_path, traced, capsys):
    written(Form("h", seed=4), tmp_path, seconds=8.0)
    config = Diagnose(tmp_path / "robot.xml", (tmp_path / "logs",), out=tmp_path / "out")
    diagnose(config)
    path = tmp_path / "machine.toml"
    first = capsys.readouterr().out
    assert "command of actuator base_servo" in first and f"{path}: written." in first
    path.write_text(path.read_text() + "\n# edited\n")
    diagnose(config)
    assert "used as it is" in capsys.readouterr().out and path.read_text().endswith("# edited\n")
    assert [each.machine for each in traced] == [path, path]
    assert [each.out for each in traced] == [tmp_path / "out"] * 2


def test_a_machine_toml_needs_no_matching(tmp_path, traced, capsys):
    path = tmp_path / "machine.toml"
    path.touch()
    diagnose(Diagnose(path, (Path("logs"),)))
    assert traced[0].machine == path and capsys.readouterr().out == ""


def test_an_incomplete_match_ends_with_the_lines_to_edit(tmp_path, traced, capsys):
    written(Form("hh", seed=4), tmp_path, seconds=8.0)
    for log in (tmp_path / "logs").iterdir():
        lines = [line.split(",") for line in log.read_text().splitlines()]
        lost = [n for n, name in enumerate(lines[0]) if "base_servo" in name]
        kept = [[c for n, c in enumerate(line) if n not in lost] for line in lines]
        log.write_text("\n".join(map(",".join, kept)) + "\n")
    with pytest.raises(SerpentError, match="not complete"):
        diagnose(Diagnose(tmp_path / "robot.xml", (tmp_path / "logs",), out=tmp_path / "out"))
    assert "not decided" in capsys.readouterr().out and not traced


@pytest.mark.parametrize("name", ["robot.xml", "machine.toml", "."])
def test_without_logs_nothing_is_written(tmp_path, traced, name):
    (tmp_path / "robot.xml").touch()
    with pytest.raises(SerpentError, match=r"no logs of .* are given. Name them after it"):
        diagnose(Diagnose(tmp_path / name, ()))
    assert not traced and [each.name for each in tmp_path.iterdir()] == ["robot.xml"]
