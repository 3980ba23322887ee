"""Read and write session logs as Parquet."""

import logging
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.runs.files import write_whole
from serpent_twin.sessions.session import (
    COLUMNS,
    FEWEST_HZ,
    MOST_HZ,
    SCHEMA_VERSION,
    UNITS,
    Session,
    columns_of,
    session_from_columns,
)
from serpent_twin.stored import within
from serpent_twin.tables import DataTable, parquet

KEY = b"serpent_twin"
_ADVICE = "Copy it again from where it was recorded, or leave it out."
RATE_TOLERANCE = 0.05  # a clock that runs further off than this belongs to another rate

_log = logging.getLogger(__name__)
_TOLD: set[Path] = set()  # folders whose unread files were reported


def session_files(folder: Path) -> list[Path]:
    """The files `session_NN.parquet` of a folder, in the order of their numbers."""
    numbered = [(re.fullmatch(r"session_(\d+)\.parquet", p.name), p) for p in folder.iterdir()]
    return [p for _, p in sorted((int(match[1]), p) for match, p in numbered if match)]


def unread(folder: Path) -> list[Path]:
    """Parquet files of a folder that no command reads, for they are not named session_NN.parquet."""
    named = session_files(folder)
    return sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() == ".parquet" and path.is_file() and path not in named
    )


def say_unread(folder: Path, tell: Callable[[str], object] = _log.warning) -> None:
    """Report once which Parquet files of a folder are not read."""
    if (found := unread(folder)) and folder.absolute() not in _TOLD:
        _TOLD.add(folder.absolute())
        names = listing([path.name for path in found])
        are = "is" if len(found) == 1 else "are"
        tell(f"{folder}: {names} {are} not read; only files named session_NN.parquet are.")


def read_session(path: Path | str) -> Session:
    """Read one log, or raise a `SerpentError` that names the file and what is wrong with it."""
    path = Path(path)
    if path.is_dir():
        raise SerpentError(f"{path} is a folder. {_one_of(path)}")
    table = parquet.read(path, _ADVICE)
    raw = table.metadata.get(KEY)
    if raw is None:
        raise SerpentError(f"{path} has no metadata under the key serpent_twin: no session log.")
    metadata = check_metadata(stored.parse_json(raw, dict[str, Any], _about(path)), str(path))
    _check_columns(path, table)
    wide = {c: table.columns[c].astype(np.float64, copy=False) for c in COLUMNS}
    extra = {c: values for c, values in table.columns.items() if c not in UNITS}
    session = session_from_columns(path, metadata, wide | extra)
    _check_clock(path, session)
    return session


def read_folder(folder: Path | str) -> list[Session]:
    """Read all sessions of a run, in order; raises a `SerpentError` for none, or for mixed runs."""
    folder = Path(folder)
    if folder.is_file():
        raise SerpentError(f"{folder} is a file. Name the folder that it lies in: {folder.parent}.")
    if not folder.is_dir():
        raise SerpentError(f"There is no folder {folder}. Name the folder with the session logs.")
    say_unread(folder)
    files, journals = session_files(folder), sorted(folder.glob("*.journal"))
    left = (
        f"{folder} holds an unfinished recording ({', '.join(p.name for p in journals)}); "
        f"`python -m serpent_twin.log recover {folder}` makes a session of it."
    )
    if not files:
        hint = left if journals else "Collect some, or name another folder."
        raise SerpentError(f"There is no session_NN.parquet in {folder}. {hint}")
    if journals:
        _log.warning(left)
    sessions = [read_session(path) for path in files]
    for key in ("arm", "rate_hz"):
        _check_alike(folder, sessions, key)
    return sessions


def write_session(path: Path | str, session: Session) -> Path:
    """Write one log as flat zstd Parquet: whole or not at all, and never over an existing file."""
    path = Path(path)
    if len(session) == 0:
        raise SerpentError(f"{path} was not written: the session has no rows.")
    metadata = {"schema_version": SCHEMA_VERSION} | session.metadata | {"rows": len(session)}
    check_metadata(metadata, str(path))
    if path.exists():
        raise SerpentError(f"{path} exists already and is kept: move it away, or name another.")
    units = {name: {"unit": unit} for name, unit in UNITS.items()}
    write_whole(path, parquet.packed(columns_of(session), KEY, metadata, units))
    return path


class Metadata(stored.OpenForm, frozen=True):
    """Metadata of every log; further keys are the recorder's."""

    schema_version: Literal[1]
    backend: str
    arm: str
    session: Annotated[int, within(0, 1_000_000_000)]
    rate_hz: Annotated[float, within(FEWEST_HZ, MOST_HZ, "Hz")]
    complete: bool = True
    recovered: bool = False
    bytes_dropped: int = 0
    prior_runtime_s: Annotated[float, within(0.0, 1e9, "s")] = 0.0
    """How long the arm ran before; without, as many sessions of this one's length as its number says"""
    markers: str = ""
    """Where they are from"""


def check_metadata(metadata: dict[str, Any], where: str) -> dict[str, Any]:
    """Return the metadata of a log if a reader can rely on it, else raise, naming `where`."""
    stored.take(metadata, Metadata, _about(where))
    return metadata


def _about(where: Path | str) -> str:
    return f"{where}: the metadata"


def listing(names: Sequence[str], most: int = 5) -> str:
    """The first few names of many, as text."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _one_of(folder: Path) -> str:
    """Which of a folder's sessions there are to name in its place."""
    files = session_files(folder)
    if not files:
        return "It holds no session_NN.parquet: name a session log."
    return (
        f"Name one of its sessions, such as {files[0]}; it has {listing([p.name for p in files])}."
    )


def _check_columns(path: Path, table: DataTable) -> None:
    lacking = [c for c in COLUMNS if c not in table.columns]
    if lacking:
        raise SerpentError(
            f"{path} lacks {len(lacking)} of the {len(COLUMNS)} columns of a session log: "
            f"{listing(lacking)}. Record them, or leave the file out."
        )
    odd = [c for c in COLUMNS if table.columns[c].dtype.kind != "f"]
    if odd:
        kind = table.columns[odd[0]].dtype
        raise SerpentError(f"{path}: {listing(odd)} must be float64, found {kind}. Convert them.")
    if table.rows == 0:
        raise SerpentError(f"{path} has no rows. Leave it out, or record the session again.")


def _check_clock(path: Path, session: Session) -> None:
    with np.errstate(invalid="ignore"):
        step = np.diff(session.time)
    wrong = np.flatnonzero(~(step > 0))
    if len(wrong) or not np.isfinite(session.time).all():
        row = wrong[0] + 1 if len(wrong) else 0
        raise SerpentError(
            f"{path}: time does not increase at row {row} (rows count from 0). "
            "The rows are out of order or from two recordings; repair or leave out the file."
        )
    rate = 1 / np.median(step) if len(step) else session.rate_hz
    if abs(rate / session.rate_hz - 1) > RATE_TOLERANCE:
        raise SerpentError(
            f"{path} claims rate_hz {session.rate_hz:g}, but its rows are {1 / rate:.4g} s apart "
            f"({rate:.4g} Hz). Where the machine could not keep up, record at that rate or less; else "
            "correct rate_hz in the metadata, or leave out the file."
        )


def _check_alike(folder: Path, sessions: Sequence[Session], key: str) -> None:
    first: dict[Any, str] = {}
    for session in sessions:
        first.setdefault(session.metadata[key], session.name)
    if len(first) > 1:
        found = ", ".join(f"{value} in {name}" for value, name in first.items())
        raise SerpentError(
            f"{folder} mixes sessions that differ in {key}: {found}. Keep one run per folder."
        )
