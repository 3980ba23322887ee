"""Test that what needs an extra that is not installed says so in one sentence, and all else runs without."""

import subprocess
import sys

import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.extras import require, requires

OPTIONAL = (
    "torch",
    "rerun",
    "trimesh",
    "dm_control",
    "dynamixel_sdk",
    "serial",
    "distributed",
    "mcap",
    "rosbags",
)


HIDDEN = f"""
import sys

class Without:
    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, *more):
        hidden = name.partition(".")[0] in {OPTIONAL!r}
        return None if hidden else self.finder.find_spec(name, *more)

sys.meta_path[:] = map(Without, sys.meta_path)
"""


def without_extras(code, folder="."):
    """Run Python code as where no extra is installed."""
    line = [sys.executable, "-c", HIDDEN + code]
    return subprocess.run(line, capture_output=True, text=True, cwd=folder)


def command(module, *words):
    return f"""
import runpy
sys.argv = ["x", *{words!r}]
runpy.run_module("serpent_twin.{module}", run_name="__main__", alter_sys=True)
"""


def test_a_missing_module_is_an_error_that_names_its_extra():
    with pytest.raises(
        SerpentError, match=r"^It needs xyz: pip install 'serpent-twin\[learn\]'\.$"
    ):
        with requires("learn", "It"):
            import xyz.inner  # type: ignore # noqa: F401
    with pytest.raises(SerpentError, match=r"\[view\]', or do without\.$"):
        require("xyz", "view", "It", ", or do without")
    require("json", "view", "It")


def test_a_missing_module_of_this_package_is_a_defect():
    with pytest.raises(ModuleNotFoundError, match="nowhere"), requires("learn", "It"):
        import serpent_twin.nowhere  # type: ignore # noqa: F401


@pytest.mark.parametrize(
    ("extra", "module", "words"),
    [
        ("arm", "bus.doctor", ["--port", "/dev/null"]),
        ("arm", "bus.zero", ["--port", "/dev/null"]),
        ("view", "replay", ["session_01.parquet", "--out", "x.rrd"]),
        ("logs", "log", ["import", "run.mcap", "--map", "map.toml", "--out", "o"]),
    ],
)
def test_a_command_that_lacks_an_extra_ends_in_one_sentence(extra, module, words, tmp_path):
    (tmp_path / "run.mcap").write_bytes(b"")
    (tmp_path / "map.toml").write_text(
        'schema_version = 1\nrate_hz = 10\n[[stream]]\ntopic = "a"\n'
        '[[stream.fields]]\nfield = "b"\ncolumn = "c"\n'
    )
    done = without_extras(command(module, *words), tmp_path)
    assert done.returncode and "Traceback" not in done.stderr
    assert f"pip install 'serpent-twin[{extra}]'" in done.stderr
    assert done.stderr.count("error: ") == 1


def test_the_environment_names_its_extra():
    done = without_extras("import serpent_twin.env")
    assert (
        "SerpentError: The environment needs dm_control: pip install 'serpent-twin[env]'"
        in done.stderr
    )


def test_all_commands_but_those_start_without_extras():
    names = "check collect completion estimate follow log mjcf mocap plan replay sweep trace train bus.device"
    code = "import importlib\n" + "\n".join(
        f"importlib.import_module('serpent_twin.{name}')" for name in names.split()
    )
    done = without_extras(code)
    assert done.returncode == 0, done.stderr
