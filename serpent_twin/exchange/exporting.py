"""Write logs as CSV or MCAP, for those who look at logs elsewhere."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.extras import requires
from serpent_twin.runs.files import write_whole
from serpent_twin.tables import parquet, text

FORMS = (".csv", ".mcap")
_TOPIC, _SCHEMA = "/log", "serpent_twin.row"


def export(path: Path, to: Path) -> int:
    """Write a Parquet log, a row a message, as what the suffix of `to` says; returns how many rows. Raises a
    `SerpentError` that says what is wrong; nothing is overwritten.
    """
    if to.suffix not in FORMS:
        raise SerpentError(f"{to} must end in {' or '.join(FORMS)}.")
    if to.exists():
        raise SerpentError(f"{to} exists. Name another file.")
    table = parquet.read(path, "Name a log.")
    if "time" not in table.columns:
        raise SerpentError(f"{path} has no column 'time'. Name a log.")
    to.parent.mkdir(parents=True, exist_ok=True)
    make = text.packed if to.suffix == ".csv" else _mcap
    write_whole(to, make(table.columns))
    return table.rows


def _mcap(columns: dict[str, Any]) -> bytes:
    """Messages as JSON, of numbers; what is not known is null."""
    with requires("logs", "An MCAP file"):
        from mcap.writer import Writer
    sink = io.BytesIO()
    writer = Writer(sink)
    writer.start(library="serpent-twin")
    kinds = {name: {"type": ["number", "null"]} for name in columns}
    form = json.dumps({"type": "object", "title": _SCHEMA, "properties": kinds}).encode()
    schema = writer.register_schema(_SCHEMA, "jsonschema", form)
    channel = writer.register_channel(_TOPIC, "json", schema)
    values = {name: np.asarray(each, float).tolist() for name, each in columns.items()}
    for n, time in enumerate(values["time"]):
        row = {name: each[n] if np.isfinite(each[n]) else None for name, each in values.items()}
        stamp = round(1e9 * time)
        writer.add_message(channel, stamp, json.dumps(row).encode(), stamp, sequence=n)
    writer.finish()
    return sink.getvalue()
