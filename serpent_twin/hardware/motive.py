"""Read a CSV file that Motive exported.

Row 1 holds key, value pairs; then rows that give each column's type, name, id (and parent); a row of
components; an axis row beginning with `Frame`; the data. Motive's versions differ in all the rest.
"""

import csv
import io
from codecs import BOM_UTF8
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted

METRES = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3}
ROUNDING = 1.5e-3  # s: some versions round the time column to 1 ms
EXPORT = "In Motive: File → Export Tracking Data, format CSV, with Markers switched on."
_HEADER_ROWS = 20  # more than any version writes

Cells = list[list[str]]


@dataclass(frozen=True, eq=False)
class Take:
    """The markers of a take, T frames of M markers, in the cameras' frame and on their clock."""

    path: Path
    """The file it came from."""
    metadata: dict[str, str]
    """The keys and values of row 1, as they stand there."""
    rate_hz: float
    """Frames per second."""
    frame: np.ndarray
    """Frame numbers, increasing; a hole is a frame that the file lacks, (T,)."""
    names: tuple[str, ...]
    """One for each of the M markers; a label that comes twice at once is numbered `label (2)`."""
    position: Array
    """[m], (T, M, 3); NaN in gaps."""

    @cached_property
    def time(self) -> Array:
        """Frame number / rate [s], (T,), not the file's rounded column."""
        return self.frame / self.rate_hz


def read_take(path: Path | str) -> Take:
    """Read the markers of a Motive CSV, or raise a `SerpentError` that states what is wrong with it."""
    path = Path(path)
    if not path.is_file():
        raise SerpentError(f"There is no file {path}. Name a CSV that Motive exported.")
    data = path.read_bytes()
    rows, metadata = _header(path, data)
    types, names = _described(path, rows)
    columns = _marker_columns(path, types, names, rows)
    table = _read_numbers(path, data, len(rows), len(rows[-1]), [c for _, c in columns])
    frame = _frame_numbers(path, table[:, 0])
    rate = _rate(path, metadata, frame, table[:, 1])
    position = table[:, 2:].reshape(len(frame), -1, 3) * _metres(path, metadata)
    names, position = _joined([name for name, _ in columns], position)
    return Take(path, metadata, rate, frame, names, position)


def _header(path: Path, data: bytes) -> tuple[Cells, dict[str, str]]:
    """All rows up to the axis row, and the key, value pairs of row 1."""
    if not data.removeprefix(BOM_UTF8).startswith(b"Format Version,"):
        begin = data[:80].split(b"\n")[0]
        raise SerpentError(
            f"{path} is not a Motive export: row 1 begins {_text(begin)[:30]!r}, "
            f"expected 'Format Version'. {EXPORT}"
        )
    lines = data.split(b"\n", _HEADER_ROWS)[:_HEADER_ROWS]
    try:
        rows = [next(csv.reader([_text(line)]), []) for line in lines]
    except csv.Error as error:
        raise SerpentError(
            f"{path}: a header row cannot be read ({error}), so the file is damaged. {EXPORT}"
        ) from None
    axis = next((n for n, row in enumerate(rows) if row and row[0] == "Frame"), None)
    if axis is None:
        raise SerpentError(
            f"{path} has no row that begins with 'Frame', so it holds no frames. Export it again."
        )
    return rows[: axis + 1], dict(zip(rows[0][::2], rows[0][1::2], strict=False))


def _text(line: bytes) -> str:
    """A header line; the locale's characters do not matter, a byte order mark goes."""
    return line.decode("utf-8-sig", errors="replace").rstrip("\r\n")


def _described(path: Path, rows: Cells) -> tuple[list[str], list[str]]:
    """The type and the name of each column."""
    described = [row for row in rows[1:-2] if any(row)]
    if len(described) < 2:
        raise SerpentError(f"{path} has no rows of column types and names. {EXPORT}")
    return described[0], described[1]


def _marker_columns(
    path: Path, types: list[str], names: list[str], rows: Cells
) -> list[tuple[str, list[int]]]:
    """Name and the x, y, z columns of each measured marker."""
    component, axis = rows[-2], rows[-1]
    width = min(map(len, (types, names, component, axis)))
    found = [c for c in range(width) if types[c] == "Marker" and component[c] == "Position"]
    if not found:
        others = ", ".join(sorted({t for t in types if t and t != "Type"})) or "nothing"
        raise SerpentError(
            f"{path} has no Marker columns, only {others}. A Rigid Body Marker is computed from "
            f"the body's pose, not measured. {EXPORT}"
        )
    triples = [found[n : n + 3] for n in range(0, len(found), 3)]
    for triple in triples:
        if [axis[c] for c in triple] != ["X", "Y", "Z"] or len({names[c] for c in triple}) > 1:
            raise SerpentError(
                f"{path}: the columns of marker {names[triple[0]]!r} are not X, Y, Z. Export it again."
            )
    return [(names[triple[0]], triple) for triple in triples]


def _read_numbers(
    path: Path, data: bytes, skip: int, width: int, triples: Sequence[list[int]]
) -> Array:
    """Frame, time and the wanted columns of the data rows, (T, 2 + 3 M); blank cells are NaN."""
    wanted = [0, 1] + [c for triple in triples for c in triple]
    torn: list[arrow_csv.InvalidRow] = []
    try:
        table = arrow_csv.read_csv(
            io.BytesIO(data.decode(errors="replace").encode()),  # a torn row is reported as text
            arrow_csv.ReadOptions(
                column_names=[f"{c}" for c in range(width)], skip_rows=skip, use_threads=False
            ),
            arrow_csv.ParseOptions(invalid_row_handler=lambda row: torn.append(row) or "skip"),
            arrow_csv.ConvertOptions(
                column_types={f"{c}": pa.float64() for c in wanted},
                include_columns=[f"{c}" for c in wanted],
                null_values=["", "nan", "NaN"],
            ),
        )
    except pa.ArrowInvalid as error:
        raise SerpentError(
            f"{path}: a data cell is not a number ({error}). Export it again."
        ) from None
    lines = table.num_rows + len(torn)
    if len(torn) > 1 or (torn and torn[0].number not in (None, skip + lines)):
        row = torn[0]
        raise SerpentError(
            f"{path}: a data row has {counted(row.actual_columns, 'cell')} instead of "
            f"{row.expected_columns}: "
            f"{row.text[:60]!r}. Export it again."
        )
    if table.num_rows == 0:
        raise SerpentError(f"{path} has no frames after its header. Export the take again.")
    return np.stack([column.to_numpy(zero_copy_only=False) for column in table.columns], axis=1)


def _frame_numbers(path: Path, column: Array) -> np.ndarray:
    if not (np.isfinite(column).all() and (np.diff(column) > 0).all()):
        row = int(np.argmin(np.isfinite(column) & (np.diff(column, prepend=-np.inf) > 0)))
        raise SerpentError(
            f"{path}: the frame numbers do not increase at data row {row} (rows count from 0). "
            "The file is put together from two exports; export the take again."
        )
    return column.astype(np.int64)


def _rate(path: Path, metadata: dict[str, str], frame: np.ndarray, time: Array) -> float:
    """The rate of row 1 that agrees with the time column [1/s]."""
    rates = []
    for key in ("Export Frame Rate", "Capture Frame Rate"):
        try:
            rates.append(float(metadata.get(key, "")))
        except ValueError:
            continue
    for rate in rates:
        stray = (time - time[0]) - (frame - frame[0]) / rate if rate > 0 else np.inf
        if np.nanmax(np.abs(stray)) < ROUNDING + 0.5 / rate:
            return rate
    raise SerpentError(
        f"{path}: the frame numbers and times do not fit the frame rates of row 1, "
        f"{rates or 'which are missing'} Hz. Export the take again, without changing the file."
    )


def _metres(path: Path, metadata: dict[str, str]) -> float:
    unit = metadata.get("Length Units", "")
    if unit.lower() not in METRES:
        raise SerpentError(
            f"{path}: the length unit is {unit!r}; this program knows {', '.join(METRES)}. "
            "Choose one of them in Motive's export settings."
        )
    return METRES[unit.lower()]


def _joined(names: Sequence[str], position: Array) -> tuple[tuple[str, ...], Array]:
    """One column per marker: columns of one name are joined where they never meet."""
    kept: dict[str, Array] = {}
    for n, name in enumerate(names):
        label, copies = name, 1
        while label in kept and _meet(kept[label], position[:, n]):
            copies += 1
            label = f"{name} ({copies})"
        part = position[:, n]
        kept[label] = np.where(np.isnan(kept[label]), part, kept[label]) if label in kept else part
    return tuple(kept), np.stack(list(kept.values()), axis=1)


def _meet(a: Array, b: Array) -> bool:
    return bool((np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)).any())
