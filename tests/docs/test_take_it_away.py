"""Test that the example of docs/take-it-away.md runs as it stands."""

import re

import mujoco
import pytest
import taken_away
from paths import ROOT

LACKS = {"stribeck@elbow": [0.1, 0.2], "sensor_delay@elbow": 0.02, "gear_backlash@at_elbow": 0.02}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    taken = taken_away.arm(tmp_path)
    trace = tmp_path / "trace"
    trace.mkdir()
    taken.case.write(taken.twin(LACKS), trace / "twin.json", {})
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_example_runs(folder, capsys):
    text = (ROOT / "docs" / "take-it-away.md").read_text()
    (example,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    exec(compile(example, "docs/take-it-away.md", "exec"), {"__name__": "example"})
    out = capsys.readouterr().out
    assert out.startswith("attached: gear_backlash@at_elbow stribeck@elbow\nread of the elbow: [")
    assert mujoco.get_mjcb_control() is None
