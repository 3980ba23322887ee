"""Read a table: its columns and the metadata of its footer, of a size that fits into memory."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.stored.source import require_file
from serpent_twin.stored.words import names

MOST_TABLE = 4_000_000_000
"""Bytes of a Parquet file"""
MOST_VALUES = 200_000_000
"""Rows times columns: a week at 4 Hz, seven hours at 100 Hz, 1.6 GB"""
_LONGEST_LINE = 1_000_000
"""Characters that are looked at for what separates the columns"""


@dataclass(frozen=True)
class ParquetTable:
    """What a Parquet file holds."""

    columns: dict[str, NDArray[Any]]
    """By name, (T,) each; nothing is NaN"""
    metadata: dict[bytes, bytes]
    """Of the footer, by key"""
    rows: int


def read_table(path: Path, advice: str = "") -> ParquetTable:
    """All columns of a file; raises a `SerpentError` that says what is wrong with it."""
    require_file(path, MOST_TABLE, advice)
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
        schema, rows = file.schema_arrow, file.metadata.num_rows
        _require_room(path, rows, len(schema.names), advice)
        _require_columns(path, schema, advice)
        texts = [field.name for field in schema if _is_text(field.type)]
        if texts:  # each of them once, however often it is in the column
            file = pq.ParquetFile(path, read_dictionary=texts, page_checksum_verification=True)
        table = file.read()
        table.validate(full=True)
        columns = {name: table.column(name).to_numpy() for name in table.column_names}
    except SerpentError:
        raise
    except PermissionError:
        raise
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        raise SerpentError(
            f"{path} is not a whole Parquet file: torn, damaged or something else. {advice}".rstrip()
        ) from None
    return ParquetTable(columns, schema.metadata or {}, table.num_rows)


def read_columns(path: Path, advice: str = "") -> dict[str, NDArray[Any]]:
    """The columns of a CSV or Parquet file, (T,) each; raises a `SerpentError` that says what is wrong."""
    if path.suffix == ".parquet":
        return read_table(path, advice).columns
    require_file(path, MOST_TABLE, advice)
    separator, decimal = _dialect(path)
    try:
        table = csv.read_csv(
            path,
            parse_options=csv.ParseOptions(delimiter=separator),
            convert_options=csv.ConvertOptions(decimal_point=decimal),
        )
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        why = " ".join(str(error).split()).rstrip(".")
        raise SerpentError(
            f"{path} is no CSV table: {why}. Its first line must name the columns. {advice}".rstrip()
        ) from None
    found = [name.strip() for name in table.column_names]
    _require_once(path, found, advice)
    return {name: table.column(n).to_numpy() for n, name in enumerate(found)}


def _dialect(path: Path) -> tuple[str, str]:
    """What separates the columns of a CSV file, and what its decimals: spreadsheets of many countries write
    semicolons, as their decimals have commas.
    """
    with path.open(errors="replace") as file:
        head, row = (file.readline(_LONGEST_LINE) for _ in range(2))
    separator = next((each for each in ",;\t" if each in head), ",")
    return separator, "," if separator != "," and "," in row and "." not in row else "."


def _require_room(path: Path, rows: int, columns: int, advice: str) -> None:
    if not 0 <= rows * columns <= MOST_VALUES:
        raise SerpentError(
            f"{path} claims {rows:,} rows of {columns:,} columns; at most {MOST_VALUES:,} values are "
            f"read. {advice}".rstrip()
        )


def _require_columns(path: Path, schema: pa.Schema, advice: str) -> None:
    _require_once(path, schema.names, advice)
    for field in schema:
        if not (_is_number(field.type) or _is_text(field.type) or pa.types.is_temporal(field.type)):
            raise SerpentError(
                f"{path}: the column {names([field.name])} holds {field.type}; it must hold numbers. "
                f"{advice}".rstrip()
            )


def _require_once(path: Path, several: Sequence[str], advice: str) -> None:
    if twice := sorted({n for n in several if list(several).count(n) > 1}):
        raise SerpentError(f"{path} has two columns of one name: {names(twice)}. {advice}".rstrip())


def _is_number(kind: pa.DataType) -> bool:
    of = pa.types
    return of.is_floating(kind) or of.is_integer(kind) or of.is_boolean(kind)


def _is_text(kind: pa.DataType) -> bool:
    return pa.types.is_string(kind) or pa.types.is_large_string(kind)
