"""Read a file of JSON objects, one a line, as a table."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.tables.table import Column, DataTable, from_texts, require_room
from serpent_twin.tables.text import CUT, unpacked


def read(path: Path, advice: str) -> DataTable:
    """The table of a file: keys are columns, `u[0]` of lists and `pose.x` of objects.

    Where a line lacks a key, the cell is empty. A last line that is cut off is left out.
    """
    raw, notes = unpacked(path, advice)
    lines = [(n, line) for n, line in enumerate(raw.split(b"\n"), 1) if line.strip()]
    rows: list[dict[str, Any]] = []
    for number, line in lines:
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            if number == lines[-1][0] and rows:
                notes = (*notes, CUT)
                break
            raise SerpentError(f"{path}, line {number} is no JSON. {advice}".rstrip()) from None
        if not isinstance(row, dict):
            raise SerpentError(f"{path}, line {number} is no JSON object. {advice}".rstrip())
        rows.append(dict(_flat(row)))
    names = list(dict.fromkeys(name for row in rows for name in row))
    require_room(path, len(rows), len(names), advice)
    return DataTable(
        path, {name: _column([row.get(name) for row in rows]) for name in names}, notes
    )


def _column(cells: list[Any]) -> Column:
    if any(isinstance(each, str) for each in cells):
        return from_texts(None if each is None else str(each) for each in cells)
    if any(each is None or isinstance(each, float) for each in cells):
        return np.array([np.nan if each is None else each for each in cells], float)
    return np.array(cells)


def _flat(row: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(row, dict):
        for key, each in row.items():
            yield from _flat(each, f"{name}.{key}" if name else key)
    elif isinstance(row, list):
        for n, each in enumerate(row):
            yield from _flat(each, f"{name}[{n}]")
    else:
        yield name, row
