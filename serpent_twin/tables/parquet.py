"""Read a Parquet file: columns of numbers, times, texts, lists and records."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from serpent_twin.errors import SerpentError
from serpent_twin.stored import require_file
from serpent_twin.tables import imported, lerobot
from serpent_twin.tables.arrow import columns_of
from serpent_twin.tables.table import MOST_BYTES, Column, DataTable, require_once, require_room


def read(path: Path, advice: str) -> DataTable:
    """The table of a Parquet file.

    Of an episode of a LeRobot data set also by the names of its joints, of an imported log by the names that
    the recording had.
    """
    require_file(path, MOST_BYTES, advice)
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
        schema = file.schema_arrow
        require_room(path, file.metadata.num_rows, len(schema.names), advice)
        require_once(path, schema.names, advice)
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
    metadata = dict((schema.metadata or {}).items())
    units = {
        each.name: each.metadata[b"unit"].decode(errors="replace")
        for each in schema
        if each.metadata and b"unit" in each.metadata
    }
    made = {n: of for n in columns if n in schema.names and (of := _conversion(schema.field(n)))}
    recorded, their_units = (
        imported.as_recorded(columns, made) if imported.KEY in metadata else ({}, {})
    )
    columns |= lerobot.by_names(path, columns) | recorded
    return DataTable(path, columns, (), units | their_units, metadata, conversions=made)


def _conversion(field: pa.Field) -> imported.Conversion | None:
    return imported.conversion(field.metadata or {})
