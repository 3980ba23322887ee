"""A good file for every reader of JSON and TOML, and how its text is put where the reader finds it."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from made_readouts import made
from session_log import make_session

from serpent_twin import readouts, sessions
from serpent_twin.effects.payload import Payload
from serpent_twin.hardware.base_frame import IDENTITY, Rigid
from serpent_twin.hardware.dynamixel.setup import ArmSetup, read_setup, write_setup
from serpent_twin.hardware.dynamixel.turns import LastSeen, read_turns, write_turns
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.score_test import Score
from serpent_twin.machines.case import Stopwatch
from serpent_twin.machines.model.before import read_before
from serpent_twin.reservoir import sweep_run as sweep
from serpent_twin.residual import learned
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN
from serpent_twin.training import adapt
from serpent_twin.training.training_run import COST, training_time

Steps = tuple[str | int, ...]


@dataclass(frozen=True)
class Reader:
    """One reader with a good file."""

    make: Callable[[Path], Path]
    """Write the good file into a folder; returns the file that errors name"""
    read: Callable[[Path], Any]
    number: Steps
    """Where the text holds a number that has bounds"""
    text: Callable[[Path], str] = lambda path: path.read_text()
    put: Callable[[Path, bytes], object] = lambda path, raw: path.write_bytes(raw)
    inside: bool = False
    """Whether the text lies in a file of another kind"""
    further: bool = False
    """Whether unknown keys are accepted"""


def _written(name: str, write: Callable[[Path], object]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        write(folder / name)
        return folder / name

    return make


def _json(name: str, content: object) -> Callable[[Path], Path]:
    return _written(name, lambda path: path.write_text(json.dumps(content)))


def _readout(folder: Path) -> Path:
    made("linear").save(folder)
    return folder / "readout.json"


def _footer(key: bytes) -> tuple[Callable[[Path], str], Callable[[Path, bytes], object]]:
    """How the metadata of a Parquet file are read and replaced."""

    def text(path: Path) -> str:
        return pq.read_schema(path).metadata[key].decode()

    def put(path: Path, raw: bytes) -> None:
        pq.write_table(pq.read_table(path).replace_schema_metadata({key: raw}), path)

    return text, put


def _among(name: str) -> tuple[Callable[[Path], str], Callable[[Path, bytes], object]]:
    """How a text among the arrays of a .npz file is read and replaced."""

    def text(path: Path) -> str:
        with np.load(path) as arrays:
            return str(arrays[name])

    def put(path: Path, raw: bytes) -> None:
        with np.load(path) as arrays:
            rest = {n: arrays[n] for n in arrays.files if n != name}
        np.savez(path, **rest | {name: np.array(raw.decode("utf-8", "surrogateescape"))})

    return text, put


def _scores(path: Path) -> None:
    score = Score("payload", 0.2, 0.1, np.array([0.03, 0.09]))
    Checkpoints(path.parent, Stopwatch()).scores(path.stem, lambda: [score])


def _correction(path: Path) -> None:
    learned.Learned((0,), 0.25, {"offset": np.zeros(27)}).save(path)


_ROW = {"mean_mm": 4.0, "std_mm": 1.0, "tip_mm": 5.0, "latency_ms": 0.1, "train_s": 1.0}
_ADAPTED = {"logs": "x", "test_sessions": ["a"], "provenance": {}}
_POINT = {"point": {}, "arm": {}, "measuring": {}, "failed": {}, "body": None, "pose": None}
_LEVER = {
    "kind": "lever", "schema_version": 2, "first": {"pivot": [0.1, 0.0, 0.2], "shift": [0.0, 0.0, 0.0]},
    "declared": {"tendon slack of cable": {"value": 0.2, "unit": "mm"}}, "effects": [],
}  # fmt: skip
_TURNS = LastSeen(np.arange(10), np.zeros(10, int), False)

READERS: dict[str, Reader] = {
    "twin.json": Reader(
        _written(
            "twin.json",
            lambda path: twin_model.write(path, NOMINAL_TWIN.with_effect(Payload(0.04)), {}),
        ),
        twin_model.read,
        ("parameters", "joint_damping"),
    ),
    "lever": Reader(
        _json("twin.json", _LEVER),
        lambda path: read_before(
            SimpleNamespace(name="lever"),
            [SimpleNamespace(declared=SimpleNamespace(name="tendon slack of cable"))],
            path,
        ),
        ("declared", "tendon slack of cable", "value"),
    ),
    "readout.json": Reader(_readout, lambda path: readouts.load(path.parent), ("config", "ridge")),
    "cost": Reader(_json(COST, {"train_s": 3.0}), lambda path: training_time(path.parent), ("train_s",)),
    "adapted": Reader(
        lambda folder: _json_in(
            folder, _ADAPTED | {"windows": {"linear": {"0": _ROW | {"real_windows": 0}}}}
        ),
        lambda path: adapt.earlier(path.parent.parent),
        ("windows", "linear", "0", "real_windows"),
    ),
    "point": Reader(_json("a.json", _POINT), sweep._read, ("failed",)),
    "turns": Reader(
        _written("arm.turns.json", lambda path: write_turns(path, _TURNS)), read_turns, ("position", 3)
    ),
    "frame": Reader(_written("frame.json", IDENTITY.save), Rigid.load, ("translation_m", 0), further=True),
    "log": Reader(
        _written("session_01.parquet", lambda path: sessions.write_session(path, make_session())),
        sessions.read_session, ("rate_hz",), *_footer(b"serpent_twin"), inside=True, further=True,
    ),
    "scores": Reader(
        _written("s.npz", _scores),
        lambda path: Checkpoints(path.parent, Stopwatch()).scores(path.stem, list),
        (0, "start", 0), *_among("scores"), inside=True,
    ),
    "correction": Reader(
        _written("learned.npz", _correction), learned.load, ("period",), *_among("about"), inside=True
    ),
}  # fmt: skip


def _json_in(folder: Path, content: object) -> Path:
    path = folder / adapt.FOLDER / adapt.SCORES
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(content))
    return path


def setup_file(folder: Path) -> Path:
    """A good arm.toml."""
    return write_setup(ArmSetup("/dev/x", path=folder / "arm.toml"))


def read_setup_file(path: Path) -> ArmSetup:
    return read_setup(path)
