"""Write an imported log, and say what was taken and what was left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.exchange.map_file import Map
from serpent_twin.exchange.streams import ImportedStream
from serpent_twin.numerals import listed
from serpent_twin.runs.files import write_whole
from serpent_twin.runs.report import Table, text_table
from serpent_twin.tables import parquet
from serpent_twin.tables.imported import KEY, Conversion


@dataclass(frozen=True)
class Imported:
    """One recording as a log."""

    name: str
    """Its file's, without the suffix"""
    columns: Mapping[str, Array]
    """`time` and all columns, (T,) each"""
    streams: tuple[ImportedStream, ...]
    held: tuple[str, ...]
    """Columns that are commands, each held until the next one"""

    @property
    def unknown(self) -> int:
        """Values that no message is near enough to."""
        return sum(int(np.isnan(values).sum()) for values in self.columns.values())


def write(path: Path, each: Imported, wanted: Map, about: Mapping[str, Any]) -> None:
    """Write a log whose columns say their units, and which fields they were, scaled and shifted by what."""
    of_columns = {"time": Conversion(wanted.stream[0].time, each.streams[0].time_unit).metadata}
    for stream in each.streams:
        of_columns |= {name: made.metadata for name, made in stream.conversions.items()}
    said = {"git_commit": about["git_commit"], "held": list(each.held), "log": each.name}
    write_whole(path, parquet.packed(each.columns, KEY, said, of_columns))


def told(each: Imported) -> dict[str, Any]:
    """What imported.json says of a log."""
    streams = [
        {
            "stream": of.name,
            "messages": len(of.time),
            "columns": list(of.columns),
            "left_out": list(of.left),
            "not_in_order": of.unsorted,
            "late_s": of.clock.late if of.clock else None,
            "correlation": of.clock.correlation if of.clock else None,
            "notes": list(of.notes),
        }
        for of in each.streams
    ]
    rows = len(each.columns["time"])
    whole = {"log": each.name, "rows": rows, "unknown_values": each.unknown}
    return whole | {"held": list(each.held), "streams": streams}


def summary(found: Sequence[Imported]) -> str:
    """What was taken and what was left, for a screen."""
    lines: list[tuple[str, ...]] = []
    for each in found:
        time = each.columns["time"]
        for of in each.streams:
            clock = f"{1e3 * of.clock.late:.1f} ms ({of.clock.correlation:.2f})" if of.clock else ""
            more = "" if len(of.left) <= 6 else f" and {len(of.left) - 6} more"
            left = ", ".join(of.left[:6]) + more
            counts = str(len(of.time)), str(of.unsorted)
            lines.append((each.name, of.name, *counts, clock, ", ".join(of.columns), left))
        ends = f"{time[-1]:.2f} s", f"{each.unknown} unknown"
        lines.append((each.name, "the log", str(len(time)), "", "", *ends))
    head = ("recording", "stream", "rows", "not in order", "late (correlation)", "taken", "left")
    return "\n".join([text_table(Table(head, tuple(lines))), *_notes(found)])


def _notes(found: Sequence[Imported]) -> list[str]:
    """What else is to be known, each once."""
    said: dict[str, list[str]] = {}
    for each in found:
        for of in each.streams:
            for note in of.notes:
                said.setdefault(f"{of.name}: {note}.", []).append(each.name)
    many = len(found)
    notes = [
        text if len(names) == many else f"{listed(names[:5])}: {text}"
        for text, names in said.items()
    ]
    return notes + [_sampled(found[0])] if found else notes


def _sampled(each: Imported) -> str:
    """How values between messages were found."""
    others = [name for name in each.columns if name != "time" and name not in each.held]
    commands = f"Commands, each held until the next one: {', '.join(each.held) or 'none'}."
    return (
        f"{commands} Readings, on straight lines between messages: {', '.join(others) or 'none'}."
    )
