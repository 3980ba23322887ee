"""Turn columns of Arrow into arrays: numbers, times, texts; lists and records into several."""

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from serpent_twin.tables.table import Column, from_texts

_WIDEST = 10_000
"""Numbers of a list that become columns: an image is none"""


def values_of(column: Any) -> Column:
    """A column (T,) of numbers, times or texts."""
    kind = column.type
    if pa.types.is_date(kind):
        column = column.cast(pa.timestamp("ns"))
    if pa.types.is_timestamp(kind) and kind.tz:
        column = column.cast(pa.timestamp(kind.unit, "UTC"))
    if pa.types.is_decimal(kind) or pa.types.is_null(kind):
        column = column.cast(pa.float64())
    if is_text(kind):
        return from_texts(_texts(column.dictionary_encode()))
    if pa.types.is_dictionary(kind):
        return from_texts(_texts(column))
    if pa.types.is_time(kind):
        column = column.cast(pa.time64("ns")).cast(pa.int64()).cast(pa.duration("ns"))
    found = column.to_numpy()
    if found.dtype.kind in "mM":
        return found.astype(f"{found.dtype.kind}8[ns]")
    return found.astype(float) if found.dtype.kind == "O" else found  # truths with empty cells


def _texts(column: Any) -> list[str | None]:
    """The cells of a column, each text once in memory, however often it is there."""
    texts = [[*part.dictionary.to_pylist(), None] for part in column.chunks]
    at = [part.indices.fill_null(-1).to_pylist() for part in column.chunks]
    return [several[n] for several, rows in zip(texts, at, strict=True) for n in rows]


def columns_of(name: str, column: Any) -> dict[str, Column]:
    """The columns of a column: of lists `name[0]` …, of records `name.key`; none of images and the like."""
    kind = column.type
    if pa.types.is_struct(kind):
        whole = column.combine_chunks()
        parts = ((f"{name}.{each.name}", pc.struct_field(whole, each.name)) for each in kind)
        return {
            n: v for key, part in parts for n, v in columns_of(key, pa.chunked_array(part)).items()
        }
    if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        longest = pc.max(pc.list_value_length(column)).as_py() or 0
        if longest > _WIDEST or not (_is_plain(kind.value_type) or _is_list(kind.value_type)):
            return {}
        return _parts(name, column, longest)
    return {name: values_of(column)} if _is_plain(kind) else {}


def _parts(name: str, column: Any, longest: int) -> dict[str, Column]:
    """Items of lists, by their index; where a list is shorter, the cell is empty."""
    rows, whole = len(column), pa.concat_arrays(column.chunks) if column.num_chunks else None
    if whole is None or not longest:
        return {}
    lengths = pc.fill_null(pc.list_value_length(whole), 0).to_numpy(zero_copy_only=False)
    flat = pc.list_flatten(whole)
    begin = np.r_[0, np.cumsum(lengths)[:-1]]
    found: dict[str, Column] = {}
    for n in range(longest):
        at = pa.array(begin + n, mask=lengths <= n) if rows else pa.array([], pa.int64())
        found |= columns_of(f"{name}[{n}]", pa.chunked_array([flat.take(at)]))
    return found


def _is_list(kind: Any) -> bool:
    of = pa.types
    return of.is_list(kind) or of.is_large_list(kind) or of.is_fixed_size_list(kind)


def _is_plain(kind: Any) -> bool:
    of = pa.types
    numbers = of.is_floating(kind) or of.is_integer(kind) or of.is_boolean(kind) or of.is_null(kind)
    return (
        numbers
        or of.is_temporal(kind)
        or of.is_decimal(kind)
        or is_text(kind)
        or (of.is_dictionary(kind) and is_text(kind.value_type))
    )


def is_text(kind: Any) -> bool:
    """Whether a column of Arrow holds texts."""
    return pa.types.is_string(kind) or pa.types.is_large_string(kind)
