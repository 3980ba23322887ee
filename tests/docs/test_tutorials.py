"""Test that the programs of the tutorials make machines, and that the traces find what was put into them."""

import json
import re
import runpy
import shlex

import pytest
from paths import ROOT
from readme import as_module
from typed import typed

from serpent_twin.machines import find
from serpent_twin.machines.rig import read_logs

LACKS = {
    "motion": (
        "swing",
        {"hinge_friction@elbow": ("coulomb", 0.15), "command_delay": ("delay", 0.02)},
    ),
    "prescribed-motion": ("crane", {"hinge_friction@hook": ("coulomb", 0.02)}),
    "torques": (
        "lift",
        {"hinge_friction@elbow": ("coulomb", 0.15), "rotor_inertia@elbow": ("inertia", 0.02)},
    ),
    "poses": ("reach", {"payload@tip": ("mass", 0.15)}),
}
"""Name of each tutorial's machine, and the effects that a trace finds, with a parameter and its true value"""


def page(name):
    return (ROOT / "docs" / "tutorials" / f"{name}.md").read_text()


def commands(name, verb):
    """The commands of a tutorial with one verb, as words after the module's name."""
    found = re.findall(rf"^ {{4}}(serpent-twin {verb} .*)$", page(name), re.MULTILINE)
    return [shlex.split(as_module(command))[3:] for command in found]


def make(name, folder, monkeypatch):
    """Run the program of a tutorial, saved as it says, and init where it has that."""
    monkeypatch.chdir(folder)
    (program,) = re.findall(r"^```python\n(.*?)^```$", page(name), re.MULTILINE | re.DOTALL)
    (folder / "program.py").write_text(program)
    runpy.run_path("program.py")
    for words in commands(name, "init"):
        logs = map(str, sorted(folder.glob("swing/logs/*.csv")))
        done = typed("serpent_twin.init", words[0], *logs)
        assert done.returncode == 0, done.stderr
        return done.stdout
    return ""


@pytest.mark.parametrize("name", LACKS)
def test_the_program_makes_a_machine_and_its_logs(name, tmp_path, monkeypatch):
    said = make(name, tmp_path, monkeypatch)
    (table,) = re.findall(r"^```text\n(column.*?)```$", page(name), re.M | re.S) or [""]
    assert table in said
    rig = find(f"{LACKS[name][0]}/machine.toml")
    assert len(read_logs(rig, (tmp_path / LACKS[name][0] / "logs",))) == 3


@pytest.mark.slow
@pytest.mark.parametrize("name", LACKS)
def test_the_trace_finds_what_the_program_put_in(name, tmp_path, monkeypatch):
    make(name, tmp_path, monkeypatch)
    for verb in ("check", "trace"):
        for words in commands(name, verb):
            done = typed(f"serpent_twin.{verb}", *words)
            assert done.returncode in (0, *[1] * (verb == "check")), done.stderr
    machine, lacks = LACKS[name]
    found = json.loads((tmp_path / machine / "trace" / "diagnosis.json").read_text())
    parameters = {each["name"]: each["parameters"] for each in found["effects"]}
    for effect, (parameter, true) in lacks.items():
        of = parameters[effect][parameter]
        assert of["low"] <= true <= of["high"]
