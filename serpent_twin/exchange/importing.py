"""Make a machine's logs of recordings of other tools, as a map.toml says."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from tqdm import tqdm

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.exchange import map_file
from serpent_twin.exchange.clocks import Lateness, lateness
from serpent_twin.exchange.map_file import Map, MappedStream, si
from serpent_twin.exchange.messages import Messages, Recorded
from serpent_twin.exchange.sources import source_of
from serpent_twin.numerals import counted
from serpent_twin.reporting.report import Table, text_table
from serpent_twin.runs.files import write_json, write_whole
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.runs.run_lock import claimed
from serpent_twin.units import TO_SI

SETTINGS = "import.json"
_FEWEST = 8
"""Rows of a log"""


@dataclass(frozen=True)
class ImportedStream:
    """One stream's columns, in SI units and its own rows."""

    name: str
    """Its topic, or that it is the table"""
    time: Array
    """(T,) [s]"""
    columns: Mapping[str, Array]
    """(T,) each, by name"""
    left: Sequence[str]
    """Fields that were not asked for"""
    unsorted: int
    """Messages that came before an earlier one, or at the same time"""
    clock: Lateness | None
    """How its clock was set, if by motion"""


@dataclass(frozen=True)
class Imported:
    """One recording as a log."""

    name: str
    """Its file's, without the suffix"""
    columns: Mapping[str, Array]
    """`time` and all columns, (T,) each"""
    streams: tuple[ImportedStream, ...]
    unknown: int
    """Values that no message is near enough to"""


def import_logs(files: Sequence[Path], map_path: Path, out: Path) -> list[Imported]:
    """Write OUT/NAME.parquet of each recording in some files, and say what was taken and what was left.

    Raises a `SerpentError` that names file, stream and key; nothing is overwritten.
    """
    wanted = map_file.read(map_path)
    hashed = {str(path): file_hash(path) for path in files if path.is_file()}
    settings = {"map_sha256": file_hash(map_path), "input_sha256": hashed}
    settings["files"] = [str(path) for path in files]
    with claimed(out, SETTINGS, settings):
        found: list[Imported] = []
        with tqdm(files, unit="file", desc="import") as bar:
            for path in bar:
                found += read(path, wanted)
        if twice := {each.name for each in found if sum(o.name == each.name for o in found) > 1}:
            raise SerpentError(
                f"two recordings have the name {min(twice)}. Rename a file, or import them into two folders."
            )
        about = provenance()
        for each in found:
            _write(out / f"{each.name}.parquet", each, wanted, about)
        write_json(out / "imported.json", {"logs": [_told(each) for each in found]} | about, 2)
    return found


def read(path: Path, wanted: Map) -> list[Imported]:
    """The recordings of a file or folder."""
    topics = [each.topic for each in wanted.stream]
    try:
        recordings = source_of(path).recordings(path, topics)
        return [_imported(name, each, wanted) for name, each in recordings.items()]
    except SerpentError as error:
        text = str(error)
        raise SerpentError(text if str(path) in text else f"{path}: {text}") from None


def _imported(name: str, recorded: Recorded, wanted: Map) -> Imported:
    streams: list[ImportedStream] = []
    for n, each in enumerate(wanted.stream):
        try:
            streams.append(_stream(each, recorded))
        except SerpentError as error:
            raise SerpentError(f"{name}, stream[{n}]: {error}") from None
    streams = [_on_time(each, of, streams) for each, of in zip(wanted.stream, streams, strict=True)]
    time = _rows(streams, wanted.rate_hz)
    if len(time) < _FEWEST:
        raise SerpentError(
            f"{name}: the streams have only {counted(len(time), 'row')} in common. Leave one out, or state "
            "how late it is."
        )
    columns = {
        column: _sampled(time, each.time, values, wanted.gap)
        for each in streams
        for column, values in each.columns.items()
    }
    unknown = sum(int(np.isnan(values).sum()) for values in columns.values())
    return Imported(name, {"time": time - time[0], **columns}, tuple(streams), unknown)


def _stream(each: MappedStream, recorded: Recorded) -> ImportedStream:
    if each.topic not in recorded:
        there = ", ".join(sorted(recorded)) or "none"
        raise SerpentError(
            f"there is no topic {each.topic!r}; there are: {there}. {map_file.ADVICE}"
            if each.topic
            else f"topic is missing; there are: {there}. {map_file.ADVICE}"
        )
    messages = recorded[each.topic]
    if not len(messages):
        raise SerpentError(f"the topic {each.topic!r} has no messages. Leave the stream out.")
    time = _times(each, messages)
    order = np.argsort(time, kind="stable")
    kept = order[np.r_[True, np.diff(time[order]) > 0]]
    unsorted = int((np.diff(time) <= 0).sum())
    columns = {
        of.column: si(messages.field(of.source), of.unit, of.scale, of.offset)[kept]
        for of in each.fields
    }
    for of in each.points:
        place = np.stack([si(messages.field(name), of.unit)[kept] for name in of.fields], axis=1)
        moved = place @ np.array(of.axes) + np.array(of.origin)
        columns |= dict(zip(of.columns, moved.T, strict=True))
    asked = {
        each.time,
        *(of.source for of in each.fields),
        *(n for of in each.points for n in of.fields),
    }
    left = [name for name in messages.fields if name not in asked]
    return ImportedStream(each.topic or "the table", time[kept], columns, left, unsorted, None)


def _times(each: MappedStream, messages: Messages) -> Array:
    if not each.time:
        if np.isnan(messages.recorded).any():
            raise SerpentError("a table needs time, the name of its column. Add it.")
        return messages.recorded
    found = si(messages.field(each.time), each.time_unit)
    if odd := int((~np.isfinite(found)).sum()):
        raise SerpentError(f"{each.time!r} is no time in {counted(odd, 'row')}. Leave them out.")
    return found


def _on_time(
    each: MappedStream, own: ImportedStream, streams: Sequence[ImportedStream]
) -> ImportedStream:
    """A stream with its clock set."""
    late, clock = each.late, None
    if each.follows:
        column = each.follows.like
        other = next(stream for stream in streams if column in stream.columns)
        clock = lateness(
            own.time,
            own.columns[each.follows.own],
            other.time,
            other.columns[column],
            each.follows.most,
        )
        late = clock.late
    return ImportedStream(own.name, own.time - late, own.columns, own.left, own.unsorted, clock)


def _rows(streams: Sequence[ImportedStream], rate_hz: float) -> Array:
    """When the log has rows [s]: while all streams are there."""
    begin, end = max(each.time[0] for each in streams), min(each.time[-1] for each in streams)
    if rate_hz:
        return begin + np.arange(max(0, int((end - begin) * rate_hz) + 1)) / rate_hz
    time = streams[0].time
    return time[(time >= begin) & (time <= end)]


def _sampled(time: Array, known: Array, values: Array, gap: float) -> Array:
    """Values at times, on straight lines between those known; NaN where these are too far apart."""
    good = np.isfinite(values)
    if good.sum() < 2:
        return np.full(len(time), np.nan)
    at, of = known[good], values[good]
    after = np.clip(np.searchsorted(at, time), 1, len(at) - 1)
    out = np.interp(time, at, of, np.nan, np.nan)
    exact = np.isin(time, at)
    out[(at[after] - at[after - 1] > gap) & ~exact] = np.nan
    return out


def _write(path: Path, each: Imported, wanted: Map, about: Mapping[str, Any]) -> None:
    """Write a log whose columns say their units."""
    units = {"time": "s"}
    for stream in wanted.stream:
        units |= {of.column: TO_SI[of.unit][1] for of in stream.fields}
        units |= {name: TO_SI[of.unit][1] for of in stream.points for name in of.columns}
    fields = [pa.field(n, pa.float64(), metadata={"unit": units[n]}) for n in each.columns]
    schema = pa.schema(fields, metadata={"imported_by": str(about["git_commit"])})
    sink = pa.BufferOutputStream()
    table = pa.Table.from_arrays([pa.array(v) for v in each.columns.values()], schema=schema)
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    write_whole(path, sink.getvalue())


def _told(each: Imported) -> dict[str, Any]:
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
        }
        for of in each.streams
    ]
    rows = len(each.columns["time"])
    return {"log": each.name, "rows": rows, "unknown_values": each.unknown, "streams": streams}


def summary(found: Sequence[Imported]) -> str:
    """What was taken and what was left, for a screen."""
    lines = []
    for each in found:
        time = each.columns["time"]
        for of in each.streams:
            clock = f"{1e3 * of.clock.late:.1f} ms ({of.clock.correlation:.2f})" if of.clock else ""
            left = ", ".join(of.left[:6]) + (
                "" if len(of.left) <= 6 else f" and {len(of.left) - 6} more"
            )
            lines.append(
                (
                    each.name,
                    of.name,
                    str(len(of.time)),
                    str(of.unsorted),
                    clock,
                    ", ".join(of.columns),
                    left,
                )
            )
        lines.append(
            (
                each.name,
                "the log",
                str(len(time)),
                "",
                "",
                f"{time[-1]:.2f} s",
                f"{each.unknown} unknown",
            )
        )
    head = ("recording", "stream", "rows", "not in order", "late (correlation)", "taken", "left")
    return text_table(Table(head, tuple(lines)))
