"""Test that the package imports quickly, that its names exist, and that a class name has one meaning."""

import ast
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import serpent_twin

ROOT = Path(__file__).parents[1]
HEAVY = ("torch", "rerun", "mujoco", "dask", "matplotlib", "numpy")


def test_the_package_is_imported_without_anything_heavy():
    code = f"import sys, serpent_twin; print([n for n in {HEAVY} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_commands_begin_without_what_few_of_them_use():
    few = ("torch", "rerun", "dask", "distributed", "matplotlib", "scipy.signal", "scipy.stats")
    commands = "collect, estimate, follow, trace, train, check, sweep, log"
    code = f"import sys; from serpent_twin import {commands}; print([n for n in {few} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_every_public_name_is_there_and_documented():
    for name in serpent_twin.__all__:
        thing = getattr(serpent_twin, name)
        assert name in dir(serpent_twin)
        assert not callable(thing) or thing.__doc__
    code = "from serpent_twin import *; print(SimulatedBus.__name__, read_session.__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "SimulatedBus read_session\n"


def test_what_is_not_there_is_no_attribute():
    assert not hasattr(serpent_twin, "gripper")


def test_no_class_name_is_defined_twice():
    modules = defaultdict(list)
    for folder in ("serpent_twin", "bench_arm", "benchmarks", "experiments"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef):
                    modules[node.name].append(str(path.relative_to(ROOT)))
    assert len(modules) > 300, "the sources were not found"
    assert {name: paths for name, paths in modules.items() if len(paths) > 1} == {}
