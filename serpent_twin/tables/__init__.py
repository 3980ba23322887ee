"""Read a table of any common kind as named columns.

`read(path)` returns a `DataTable`: `.columns` by name, (T,) each, of numbers, time stamps or texts; `.notes`
on how it was read, for the user; `.units`, where the file states them. `.numbers(name)` are floats,
`.seconds(name, unit)` times. A column of lists is read as `u[0]`, `u[1]`; one of records as `pose.x`.
"""

import importlib
import re
from dataclasses import replace
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.tables import imported, lerobot
from serpent_twin.tables.table import DataTable

__all__ = ["ENDINGS", "DataTable", "by_number", "ending", "is_plain", "read", "reads", "stem"]

_FORMATS = {
    ".csv": "text",
    ".tsv": "text",
    ".txt": "text",
    ".dat": "text",
    ".parquet": "parquet",
    ".npz": "npz",
    ".mat": "mat",
    ".jsonl": "jsonl",
    ".ndjson": "jsonl",
}
"""Module of this package that reads files of an ending"""
_COMPRESSED = ".gz"
ENDINGS = tuple(_FORMATS)
"""All endings that are read, in any case; those of texts also with .gz"""
_OTHERWISE = {
    ".xlsx": "is a workbook: save its sheet as CSV",
    ".xls": "is a workbook: save its sheet as CSV",
    ".h5": "is HDF5, which is not read: write its arrays with numpy.savez or as Parquet",
    ".hdf5": "is HDF5, which is not read: write its arrays with numpy.savez or as Parquet",
    ".pkl": "is a pickle, which could run any program: write a Parquet file with DataFrame.to_parquet",
    ".json": "is JSON: write one object a line, as .jsonl",
    ".mcap": "is a recording of messages: bring it in with log import",
    ".bag": "is a recording of messages: bring it in with log import",
    ".db3": "is a part of a ROS 2 bag: bring its folder in with log import",
}
"""What other files are, and what to do with them"""


def ending(path: Path) -> str:
    """The ending of a name by which a table's kind is known, in small letters, such as .csv of RUN.CSV.GZ."""
    name = path.name.lower().removesuffix(_COMPRESSED)
    return "." + name.rpartition(".")[2] if "." in name else ""


def stem(path: Path) -> str:
    """The name of a file without the endings by which its kind is known."""
    name = path.name
    if name.lower().endswith(_COMPRESSED):
        name = name[: -len(_COMPRESSED)]
    return name.rpartition(".")[0] if ending(path) in _FORMATS else Path(name).stem


def by_number(name: str) -> list[tuple[int, str]]:
    """What sorts names with the numbers in them by size: run_2 before run_10."""
    parts = re.split(r"(\d+)", name)
    return [(int(each), "") if each.isdecimal() else (-1, each) for each in parts]


def is_plain(path: Path) -> bool:
    """Whether a file is a text that need not be a table, where there are others."""
    return ending(path) in (".txt", ".dat")


def reads(path: Path) -> bool:
    """Whether a name is that of a table that can be read."""
    kind = _FORMATS.get(ending(path), "")
    return bool(kind) and (kind in ("text", "jsonl") or not path.name.lower().endswith(_COMPRESSED))


def read(path: Path, advice: str = "") -> DataTable:
    """The table of a file; raises a `SerpentError` that says what is wrong with it, and then `advice`.

    Of an episode of a LeRobot data set also by the names of its joints, of an imported log by the names that
    the recording had.
    """
    if not reads(path):
        raise SerpentError(f"{path} {otherwise(path)}.")
    format_ = importlib.import_module(f"{__name__}.{_FORMATS[ending(path)]}")
    found: DataTable = format_.read(path, advice)
    if ending(path) != ".parquet":
        return found
    recorded, units = imported.as_recorded(found) if imported.KEY in found.metadata else ({}, {})
    columns = found.columns | lerobot.by_names(path, found.columns) | recorded
    return replace(found, columns=columns, units={**found.units, **units})


def otherwise(path: Path) -> str:
    """What a file is that is no table, and what to do, without a full stop."""
    known = f"is no table that can be read: names of tables end in {', '.join(ENDINGS)}, texts also in .gz"
    return _OTHERWISE.get(ending(path), known)
