"""Measure how large the code is, what a trace loads, and how its packages import each other."""

import contextlib
import io
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import grimp
import numpy as np
from scipy.sparse.csgraph import connected_components

from benchmarks.rows import BenchmarkRows
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "serpent_twin"
_MACHINE = """schema_version = 1
model = "robot.xml"
rows = "motion"
time = { column = "time_ms", unit = "ms" }
"""
_JOINT = """
[[drive]]
actuator = "{0}"
column = "{0}_goal_deg"
unit = "deg"
[[measured]]
joint = "{0}"
columns = ["{0}_deg"]
unit = "deg"
"""


@dataclass(frozen=True)
class Structure(Checked):
    """Measure how large the code is, what a trace loads, and how its packages import each other."""

    out: Path | None = None
    """JSON file for the rows."""


def lines(paths: Iterable[Path]) -> int:
    """Lines of some files."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def loaded(code: str) -> list[Path]:
    """Files of the package that a program loads."""
    code += f"""
import sys
files = [m.__file__ for n, m in sorted(sys.modules.items()) if n.partition(".")[0] == {PACKAGE!r}]
print("\\n".join(file for file in files if file))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return [Path(line) for line in done.stdout.splitlines()]


def demo_machine(home: Path) -> Path:
    """Write the demo's robot, which the package does not know, with its logs; returns its machine.toml."""
    from experiments.demo import robot

    robot.write(home)
    machine = home / "machine.toml"
    machine.write_text(_MACHINE + "".join(map(_JOINT.format, robot.JOINTS)), encoding="utf-8")
    return machine


def trace_any_model() -> None:
    """Trace two logs of the demo's robot as far as needs every module."""
    from serpent_twin.trace import Trace, trace

    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        machine = demo_machine(Path(folder))
        logs, out = (machine.parent / "logs",), machine.parent / "trace"
        trace(Trace(logs, out, machine=machine, sessions=2, minutes=0.1))


def rooms() -> tuple[list[str], np.ndarray]:
    """The folders of modules, of the top folder each module, and which imports from which, (N, N)."""
    graph = grimp.build_graph(PACKAGE, exclude_type_checking_imports=True, cache_dir=None)
    room = {module: _room(module) for module in graph.modules}
    names = sorted(set(room.values()))
    imports = np.zeros((len(names), len(names)), bool)
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            imports[names.index(room[module]), names.index(room[other])] = True
    np.fill_diagonal(imports, False)
    return names, imports


def _room(module: str) -> str:
    folder = module.rpartition(".")[0]
    return module if folder == PACKAGE or _is_folder(module) else folder


def _is_folder(module: str) -> bool:
    return (ROOT / module.replace(".", "/")).is_dir()


def circles(names: list[str], imports: np.ndarray) -> list[list[str]]:
    """Groups of rooms that import each other in circles."""
    count, group = connected_components(imports, connection="strong")
    every = [[names[n] for n in np.flatnonzero(group == k)] for k in range(count)]
    return [each for each in every if len(each) > 1]


def floors(imports: np.ndarray) -> int:
    """The longest chain of rooms each of which imports the next, a circle counted as one."""
    count, group = connected_components(imports, connection="strong")
    above = np.zeros((count, count), bool)
    for one, other in zip(*np.nonzero(imports), strict=True):
        above[group[one], group[other]] |= group[one] != group[other]
    height = np.ones(count, int)
    for _ in range(count):
        height = np.maximum(height, 1 + np.where(above, height, 0).max(axis=1))
    return int(height.max())


def main(config: Structure) -> None:  # noqa: D103 tyro would print it above the config's own
    rows = BenchmarkRows()
    package = sorted((ROOT / PACKAGE).rglob("*.py"))
    rows.add("lines of the package", lines(package), "", "at most 43,000")
    rows.add("modules of the package", len(package))
    for folder in ("tests", "experiments", "benchmarks", "bench_arm"):
        rows.add(f"lines of {folder}", lines((ROOT / folder).rglob("*.py")))
    imported = loaded(f"import {PACKAGE}.trace")
    rows.add("modules that importing the trace loads", len(imported))
    rows.add("lines of these", lines(imported))
    traced = loaded("from benchmarks.structure import trace_any_model; trace_any_model()")
    rows.add("modules that a trace of any model loads", len(traced))
    rows.add("lines of these", lines(traced), "", "at most 22,000")
    names, imports = rooms()
    rows.add("rooms: folders of modules", sum(map(_is_folder, names)), "", "at most 32")
    rows.add("floors", floors(imports))
    rows.add("arrows between rooms", int(imports.sum()))
    found = circles(names, imports)
    rows.add("circles", len(found), "", "0")
    for circle in found:
        print(f"  {' and '.join(circle)} import each other")
    rows.write(config.out)


if __name__ == "__main__":
    cli.run(main)
