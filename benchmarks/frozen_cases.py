"""List the commands whose answers are frozen, and run one: its answer, and the processor time of it."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from serpent_twin.errors import SerpentError

ROOT = Path(__file__).resolve().parents[1]
HALF_INTERVAL = 1.96  # standard errors in half of a 95 % interval
_STAGES = ("nominal", "calibrated", "corrected")


@dataclass(frozen=True)
class FrozenCase:
    """A command of the package whose answer is frozen."""

    name: str
    words: tuple[str, ...]
    """Verb and options; {shared} is the folder of logs that are no part of the project, {inputs} that of the
    files which `prepare` makes, {machine} the folder of a measured machine's description, and other paths are
    in the project
    """
    prepare: Callable[[Path, Path], object] | None = None
    """Makes what the command reads, from the shared folder, in a new folder"""
    logs: str = ""
    """Folder from which it makes them"""

    def missing(self, shared: Path) -> str:
        """The folder that it needs and that is not there; else empty."""
        needs = self.logs.format(shared=shared)
        return "" if not needs or Path(needs).exists() else needs


def _stranger(name: str) -> FrozenCase:
    """A robot of a stranger, two runs of it."""
    folder = f"{{shared}}/strangers/{name}"
    words = ("trace", "--logs", f"{folder}/logs", "--machine", folder, "--sessions", "2")
    return FrozenCase(name, (*words, "--no-discover"), logs=folder)


def _arm(name: str, folder: str, *options: str) -> FrozenCase:
    """An arm, the beginnings of two sessions."""
    words = ("trace", "--logs", "{inputs}/logs", *options)
    return FrozenCase(name, words, _shortened(folder, ("session_0[12].*",), 480), folder)


def _machine(name: str, patterns: Sequence[str], rows: int, judge: str) -> FrozenCase:
    """A measured machine, the beginnings of some of its files."""
    words = ("trace", "--logs", "{inputs}/logs", "--machine", "{machine}", "--judge", judge)
    folder = f"{{shared}}/measured/{name}"
    return FrozenCase(name, (*words, "--no-discover"), _shortened(folder, patterns, rows), folder)


def _shortened(source: str, patterns: Sequence[str], rows: int) -> Callable[[Path, Path], None]:
    """The first rows of some files, so that a trace is short; a model as it is."""

    def copied(shared: Path, folder: Path) -> None:
        logs = folder / "logs"
        logs.mkdir()
        home = Path(source.format(shared=shared))
        for path in [path for pattern in patterns for path in home.glob(pattern)]:
            if path.suffix == ".xml":
                shutil.copy(path, folder)
            elif path.suffix == ".csv":
                lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
                (logs / path.name).write_text("".join(lines[: rows + 1]), encoding="utf-8")
            else:
                pq.write_table(pq.read_table(path)[:rows], logs / path.name)

    return copied


def _bench_arm(fault: str, seed: int) -> FrozenCase:
    """Two short sessions of the independent arm with one fault."""

    def recorded(_: Path, folder: Path) -> None:
        words = ["-m", "bench_arm", "--out", str(folder / "logs"), "--effect", fault]
        words += ["--sessions", "2", "--steps", "400", "--seed", str(seed)]
        subprocess.run([sys.executable, *words], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)

    return FrozenCase(f"bench_{fault}", ("trace", "--logs", "{inputs}/logs"), recorded)


def _public(name: str, fault: str) -> FrozenCase:
    """Three runs of a model of dm_control with one fault."""

    def recorded(_: Path, folder: Path) -> None:
        from experiments.any_model.models import MODELS  # needs dm_control
        from experiments.any_model.record import describe, record

        model = MODELS[name]
        describe(folder, model)
        for n in range(3):
            log = folder / "logs" / f"session_{n + 1}.csv"
            record(log, model, fault, model.faults[fault], n)

    words = ("trace", "--logs", "{inputs}/logs", "--machine", "{inputs}")
    return FrozenCase(f"{name}_{fault.partition('@')[0]}", words, recorded)


_COLLECT = ("collect", "--sessions", "1", "--steps", "60", "--seed", "1")
CASES = (
    FrozenCase("collect", _COLLECT),
    FrozenCase("collect_arm_a", (*_COLLECT, "--twin", "data/arm_a_trace/twin.json")),
    _public("pendulum", "torque_saturation@torque"),
    _public("leg", "payload@bfoot"),
    _machine("xl330", ("kp100_sin_sin.*", "kp100_l*", "kp200_sin_t*"), 900, "kp200_*"),
    _machine("trunk", ("controlled_*",), 2000, "controlled_2.*"),
    _machine("jaw", ("tool_4_10.*", "tool_4_32.*", "tool_4_12.*"), 2000, "tool_4_12.*"),
    _stranger("pan_tilt"),
    _arm("data_arm_a", str(ROOT / "data" / "arm_a"), "--no-discover"),
    _arm("arm_b", "{shared}/logs/arm_b"),
    _arm("arm_c", "{shared}/logs/arm_c"),
    _machine("opencr", ("v4*",), 660, "rep1_seg3_*"),
    _arm("arm_d", "{shared}/logs/arm_d"),
    _arm("arm_k", "{shared}/logs/arm_k", "--no-discover"),
    _stranger("scara"),
    _bench_arm("cable_stiffening", 3),
)
"""The cheapest first"""


def find(only: Sequence[str]) -> list[FrozenCase]:
    """The cases of some names; all without a name."""
    names = [case.name for case in CASES]
    if unknown := sorted({*only} - {*names}):
        raise SerpentError(f"no such cases: {', '.join(unknown)}. There are {', '.join(names)}.")
    return [case for case in CASES if not only or case.name in only]


def run(case: FrozenCase, tree: Path, shared: Path, made: Path) -> dict[str, Any]:
    """What the code in a tree answers, and its processor time [s]; logs that are made are kept."""
    inputs = made / case.name
    if case.prepare and not inputs.exists():
        _make(case, shared, inputs)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        described = out / "machine"
        described.mkdir()
        here = tree / "experiments" / "measured"
        for path in [*inputs.glob("*.xml"), *here.glob(f"{case.name}/*")]:
            shutil.copy(path, described)
        for path in here.glob(f"{case.name}.*"):  # of trees before each machine had a folder
            shutil.copy(path, described / path.name.replace(f"{case.name}.toml", "machine.toml"))
        places = {"shared": shared, "inputs": inputs, "machine": described}
        verb, *options = (word.format(**places) for word in case.words)
        words = ["-m", f"serpent_twin.{verb}", *options, "--out", str(out / "result")]
        processor_s = processor_time(words, tree, out / "said.log")
        read = _logged if verb == "collect" else _diagnosed
        return {"processor_s": processor_s, **read(out / "result")}


def _make(case: FrozenCase, shared: Path, inputs: Path) -> None:
    """Make the logs of a case; another process may have made them meanwhile."""
    assert case.prepare is not None
    inputs.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=inputs.parent) as folder:
        making = Path(folder) / case.name
        making.mkdir()
        case.prepare(shared, making)
        if not inputs.exists():
            making.rename(inputs)


def processor_time(words: Sequence[str], tree: Path, said: Path) -> float:
    """Processor time [s] of a command of the code in a tree."""
    environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    with said.open("wb") as file:
        child = subprocess.Popen(
            [sys.executable, *words], cwd=tree, env=environment, stdout=file, stderr=file
        )
        _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        last = said.read_text(errors="replace").strip().splitlines()[-1:]
        raise SerpentError(f"{' '.join(words)} failed: {' '.join(last)}")
    return round(usage.ru_utime + usage.ru_stime, 1)


def _logged(folder: Path) -> dict[str, Any]:
    """Mean, standard deviation and last value of each column of a session log."""
    table = pq.read_table(folder / "session_01.parquet")
    columns = {name: np.asarray(table[name], float) for name in table.column_names}
    return {
        "columns": {
            name: [float(f"{v:.9g}") for v in (values.mean(), values.std(), values[-1])]
            for name, values in columns.items()
        }
    }


def _diagnosed(folder: Path) -> dict[str, Any]:
    """Names, places, verdicts, strengths with their standard errors, and held-out errors of a diagnosis."""
    found = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    return {
        "effects": {_label(each): _strengths(each) for each in found["effects"]},
        "stand_ins": {_label(each): _strengths(each) for each in found["stand_ins"]},
        "unexplained": found["unexplained"]["is"],
        "moved": sorted(each["name"] for each in found["moved"]),
        "verdicts": {
            each["name"]: each["verdict"] for each in found["candidates"] if "law" not in each
        },
        "composed": sorted(_label(each) for each in found["candidates"] if "law" in each),
        "errors": {
            key: {stage: _short(found[key][stage]) for stage in _STAGES}
            for key in found
            if key.startswith("error_") or "_error_" in key
        },
    }


def _label(entry: dict[str, Any]) -> str:
    """A named effect, or a composed law with its place and what it follows."""
    if "law" not in entry:
        return entry["name"]
    follows = " and ".join(entry["depends_on"])
    return f"{entry['changes']}@{entry['place']['name']} {entry['law']} {follows}".strip()


def _strengths(entry: dict[str, Any]) -> dict[str, list[float]]:
    """Value and standard error of each parameter; 0 for one that is given."""
    return {
        name: [_short(of["value"]), _short((of["high"] - of["low"]) / 2 / HALF_INTERVAL)]
        for name, of in entry["parameters"].items()
    }


def _short(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")
