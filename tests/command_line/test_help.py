"""Test that help lists every command, machine and option, in readable groups."""

import importlib
import re
import subprocess
import sys
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import pytest
from typed import typed
from tyro.conf import Positional, arg

from serpent_twin import machines
from serpent_twin.command_line import cli
from serpent_twin.command_line.option_groups import Group, about
from serpent_twin.command_line.verbs import verbs

COMMANDS = [
    "bus.device", "bus.doctor", "bus.zero", "check", "collect", "completion", "estimate", "follow", "log",
    "mjcf", "mocap", "plan", "replay", "sweep", "trace", "train",
]  # fmt: skip
MOST = 14  # options of a group: the simulated arm has ten parameters, its file, and what is random


def said(text):
    """Text without the boxes, rules and line breaks."""
    return " ".join(re.sub("[│─╭╮╰╯•]|-{5,}", " ", text).split())


def options_of(done):
    return re.findall("--[a-z-]+", done.stdout)


def test_the_package_lists_its_commands_as_each_describes_itself():
    command = [
        sys.executable,
        "-X",
        "utf8",
        "-m",
        "serpent_twin",
    ]  # with boxes, whatever the locale
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0 and "--help" in done.stdout
    listed = said(done.stdout)
    assert set(COMMANDS) <= set(verbs())
    for name, text in verbs().items():
        assert f"{name} {text}" in listed
    assert max(map(len, done.stdout.splitlines())) < 90


def test_the_list_without_imports_is_what_the_imported_commands_say():
    """Texts by `inspect.getdoc` equal those by the source's syntax tree."""
    for name, text in verbs().items():
        module = importlib.import_module(f"serpent_twin.{name}")
        spoken = about(module.main) if hasattr(module, "main") else module.__doc__
        assert text == spoken.partition("\n")[0]


def test_the_list_imports_nothing_slow():
    code = "import sys, serpent_twin.__main__ as m; m.listing(); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert not {"numpy", "mujoco", "scipy", "pyarrow"} & set(done.stdout.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_help_loads_no_statistics_and_no_viewer(command):
    """What takes most of the time of a start; `--help` of every command is below a second without."""
    name = f"serpent_twin.{command}"
    code = f"""
import runpy, sys
sys.argv = ["x", "--help"]
try:
    runpy.run_module("{name}", run_name="__main__", alter_sys=True)
except SystemExit:
    print(*sys.modules, file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    heavy = {"scipy.sparse", "scipy.optimize", "matplotlib", "jinja2", "rerun", "torch", "trimesh"}
    assert not heavy & set(done.stderr.split()) and done.stdout


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in ("log", "mocap")])
def test_a_command_says_first_what_the_list_says_of_it_and_groups_its_options(command, capsys):
    name = f"serpent_twin.{command}"
    module = importlib.import_module(
        f"{name}.__main__" if find_spec(name).submodule_search_locations else name
    )
    with pytest.raises(SystemExit):
        cli.run(module.main, ["--help"])
    shown = capsys.readouterr().out
    assert verbs()[command] in said(shown) and "config" not in shown
    assert "{None}" not in shown and "(default: None)" not in said(shown)
    assert "(default: )" not in said(shown)
    for group in re.split(r"^.* options .*$", shown, flags=re.M)[1:]:
        assert 1 <= len(re.findall(r"^[│ ] -", group, re.M)) <= MOST, group


@pytest.mark.parametrize("command", ["trace", "bus.doctor", "log import", "mocap frame"])
def test_a_command_may_follow_a_blank_in_place_of_its_dot(command):
    """Help is the same with a blank, and names the command as it was typed."""
    dotted, blank = (
        typed(*words, "--help")
        for words in (
            f"serpent_twin.{command}".split(),
            ["serpent_twin", *re.split("[. ]", command)],
        )
    )
    name = f"python -m serpent_twin {command.replace('.', ' ')}"
    assert f"usage: {name}" in said(blank.stdout)
    assert f"usage: python -m serpent_twin.{command}" in said(dotted.stdout)
    assert options_of(blank) == options_of(dotted)
    assert (blank.returncode, blank.stderr) == (0, "")


def test_a_command_after_a_blank_has_its_options_and_exit_status(tmp_path):
    done = typed("serpent_twin", "check", "--logs", str(tmp_path / "none"))
    assert done.returncode == 2 and "There is no folder" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["trian", "--out", "x"], "Try python -m serpent_twin train"),
        (["bus"], "python -m serpent_twin bus doctor"),
        (["diagnos", "robot.xml", "logs"], "there is no command 'diagnos'. Try python -m"),
        (["nonsense"], "`python -m serpent_twin` lists them"),
        (["__main__"], "there is no command '__main__'"),
    ],
)
def test_a_word_that_is_no_command_is_answered_by_the_nearest(words, said):
    done = typed("serpent_twin", *words)
    assert done.returncode == 1 and said in done.stderr and "Traceback" not in done.stderr


def test_mocap_says_what_its_commands_do():
    text = said(typed("serpent_twin.mocap", "--help").stdout)
    assert text.startswith("usage: python -m serpent_twin.mocap [-h]")
    assert "merge Fill the markers of session logs from a take" in text
    assert "frame Find the base frame: Motive streams while the arm hangs straight" in text


def test_trace_says_which_machines_there_are():
    text = said(typed("serpent_twin.trace", "--help").stdout)
    for name, words in machines.RIGS.items():
        assert f"{name}, {words}" in text and machines.find(name).files


@dataclass(frozen=True)
class Camera:
    """A camera."""

    server: str = "here"
    """Where it is."""
    rate: Annotated[float, Group("time")] = 4.0
    """Pictures a second,
    at most."""


@dataclass(frozen=True)
class Config:
    """Look.

    And look again,
    until it is seen.
    """

    take: Annotated[Positional[Path], arg(metavar="TAKE")]
    """What to look at."""
    out: Path
    """Where it goes."""
    seed: Annotated[int, Group("time")] = 3
    """Seed."""
    camera: Camera = field(default=Camera("there"))
    """The camera that looks."""
    labels: tuple[str, ...] = ()
    """Names; by default none."""


def asked(*words):
    got = []

    def look(config: Config) -> None:
        got.append(config)

    cli.run(look, argv=list(words))
    return got[0]


def test_options_in_groups_make_the_config_that_a_caller_would_write():
    assert asked("t", "--out", "o") == Config(Path("t"), Path("o"))
    options = ["--seed", "7", "--rate", "2.5", "--server", "away", "--labels", "a", "b"]
    wanted = Config(Path("t"), Path("o"), 7, Camera("away", 2.5), ("a", "b"))
    assert asked("t", "--out", "o", *options) == wanted


def test_groups_hold_their_options_with_texts_in_one_piece(capsys):
    with pytest.raises(SystemExit):
        asked("--help")
    shown = said(capsys.readouterr().out)
    assert "Look." in shown and " options And look again, until it is seen. --out PATH" in shown
    time = "--seed INT Seed. (default: 3) --rate FLOAT Pictures a second, at most. (default: 4.0)"
    assert f"time options {time}" in shown
    assert (
        "camera options The camera that looks. --server STR Where it is. (default: there)" in shown
    )
    assert "Names; by default none." in shown and "(default: )" not in shown
