"""Read and write a Parquet file: columns of numbers, times, texts, lists and records."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from serpent_twin.errors import SerpentError
from serpent_twin.stored import require_file
from serpent_twin.tables.arrow import columns_of, is_text
from serpent_twin.tables.imported import conversion
from serpent_twin.tables.table import MOST_BYTES, Column, DataTable, require_once, require_room


def read(path: Path, advice: str) -> DataTable:
    """The table of a Parquet file."""
    require_file(path, MOST_BYTES, advice)
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
        schema = file.schema_arrow
        require_room(path, file.metadata.num_rows, len(schema.names), advice)
        require_once(path, schema.names, advice)
        texts = [field.name for field in schema if is_text(field.type)]
        if texts:  # each of them once, however often it is in the column
            file = pq.ParquetFile(path, read_dictionary=texts, page_checksum_verification=True)
        table = file.read()
        table.validate(full=True)
        columns: dict[str, Column] = {}
        for name in table.column_names:
            columns |= columns_of(name, table.column(name))
    except (SerpentError, PermissionError):
        raise
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        raise SerpentError(
            f"{path} is not a whole Parquet file: torn, damaged or something else. {advice}".rstrip()
        ) from None
    about = {field.name: field.metadata or {} for field in schema}
    units = {
        name: each[b"unit"].decode(errors="replace")
        for name, each in about.items()
        if b"unit" in each
    }
    made = {n: of for n, each in about.items() if n in columns and (of := conversion(each))}
    return DataTable(path, columns, (), units, schema.metadata or {}, conversions=made)


def packed(
    columns: Mapping[str, Column],
    key: bytes,
    metadata: Mapping[str, Any],
    of_columns: Mapping[str, Mapping[str, str]] = {},
) -> Any:
    """The bytes of a Parquet file of columns (T,), with metadata in its footer, as JSON under a key, and of
    some columns, such as their unit.
    """
    arrays = [pa.array(values) for values in columns.values()]
    fields = [
        pa.field(name, array.type, metadata=of_columns.get(name))
        for name, array in zip(columns, arrays, strict=True)
    ]
    schema = pa.schema(fields, metadata={key: json.dumps(metadata)})
    sink = pa.BufferOutputStream()
    table = pa.Table.from_arrays(arrays, schema=schema)
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    return sink.getvalue()
