"""Define a journal's layout on disk, and read what is left of a damaged one.

It is an Arrow IPC stream: its header carries the session's metadata and column names, then each row
is one record batch of all values and a CRC32. The CRC continues that of the row before and starts
from the header's, so a row that is torn, changed, missing or out of order ends the readable part.
"""

import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.sessions.parquet import KEY, check_metadata, write_session
from serpent_twin.sessions.session import COLUMNS, session_from_columns

_DAMAGE = (pa.ArrowException, OSError, EOFError, ValueError, LookupError, TypeError)


def stream_schema(metadata: Mapping[str, Any], columns: Sequence[str]) -> pa.Schema:
    """The schema of a journal: a row of all columns and its checksum, the session's metadata."""
    fields = [pa.field("row", pa.list_(pa.float64(), len(columns))), pa.field("crc32", pa.uint32())]
    return pa.schema(fields, metadata={KEY: json.dumps(metadata), "columns": json.dumps(columns)})


def header_crc(schema: pa.Schema) -> int:
    """The checksum that the first row continues."""
    return zlib.crc32(schema.metadata[b"columns"], zlib.crc32(schema.metadata[KEY]))


def batch_over(vector: Array, checksum: np.ndarray, schema: pa.Schema) -> pa.RecordBatch:
    """A one-row batch that shares the memory of `vector` and `checksum`: built once, sent often."""
    values = pa.Array.from_buffers(pa.float64(), len(vector), [None, pa.py_buffer(vector)])
    row = pa.FixedSizeListArray.from_arrays(values, len(vector))
    crc = pa.Array.from_buffers(pa.uint32(), 1, [None, pa.py_buffer(checksum)])
    return pa.RecordBatch.from_arrays([row, crc], schema=schema)


@dataclass(frozen=True)
class JournalContent:
    """What can be read of a journal: its metadata, the whole rows, the bytes that are no row."""

    metadata: dict[str, Any]
    columns: tuple[str, ...]
    rows: Array
    bytes_dropped: int

    def write(self, path: Path, status: Mapping[str, Any]) -> Path:
        """Write the rows as a session log whose metadata include its status."""
        columns = dict(zip(self.columns, self.rows.T, strict=True))
        metadata = self.metadata | dict(status)
        return write_session(path, session_from_columns(path, metadata, columns))


def read_journal(path: Path) -> JournalContent:
    """The rows of a journal up to the first that is torn or changed; no rows if the header is."""
    data = path.read_bytes()
    source = pa.BufferReader(data)
    try:
        schema = pa.ipc.read_schema(source)
        metadata, columns = _header(schema, str(path))
        crc = header_crc(schema)
    except (*_DAMAGE, SerpentError):
        return JournalContent({}, (), np.empty((0, 0)), len(data))
    rows, end = [], source.tell()
    for row in _rows(source, schema, crc, len(columns)):
        rows.append(row)
        end = source.tell()
    matrix = np.array(rows).reshape(len(rows), len(columns))
    return JournalContent(metadata, columns, matrix, len(data) - end)


def _header(schema: pa.Schema, where: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The metadata and the columns of a journal."""
    metadata = stored.parse_json(schema.metadata[KEY], dict[str, Any], where)
    check_metadata(metadata, where)
    columns = stored.parse_json(schema.metadata[b"columns"], tuple[str, ...], where)
    if columns[: len(COLUMNS)] != COLUMNS or len(set(columns)) < len(columns):
        raise SerpentError(f"{where}: its columns are not those of a session.")
    return metadata, columns


def _rows(source: pa.BufferReader, schema: pa.Schema, crc: int, width: int) -> Iterator[Array]:
    """The rows of an Arrow stream until one does not continue the chain of checksums."""
    while True:
        try:
            batch = pa.ipc.read_record_batch(pa.ipc.read_message(source), schema)
            batch.validate(full=True)
            row = batch.column(0).values.to_numpy()
            checksum = batch.column(1).to_numpy()
        except _DAMAGE:
            return
        crc = zlib.crc32(row, crc)
        if batch.num_rows != 1 or len(row) != width or checksum[0] != crc:
            return
        yield row
