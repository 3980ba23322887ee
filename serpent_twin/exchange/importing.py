"""Make a machine's logs of recordings of other tools, as a map.toml says."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.exchange import map_file
from serpent_twin.exchange.clocks import lateness
from serpent_twin.exchange.commands import MACHINE, stated_roles
from serpent_twin.exchange.map_file import Map, MappedStream
from serpent_twin.exchange.messages import Recorded, Source
from serpent_twin.exchange.sources import recordings_in
from serpent_twin.exchange.streams import ImportedStream, stream_of
from serpent_twin.exchange.writing import Imported, told, write
from serpent_twin.numerals import counted
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.runs.run_lock import claimed
from serpent_twin.tables.sampling import between, held

SETTINGS = "import.json"
_FEWEST = 8
"""Rows of a log"""
_MOST_ROWS = 50
"""Rows of a log for each message of its fastest stream"""
_ROUNDED = 1e-4
"""Fraction of a row's period by which the stamp of a command that comes with the row may differ: stamps since
1970 are rounded
"""
_SLOWER = 0.9
"""Messages of a stream for each row of the log below which it must be known whether they are commands"""


def import_logs(
    files: Sequence[Path], map_path: Path, out: Path, machine: Path | None = None
) -> list[Imported]:
    """Write OUT/NAME.parquet of each recording in some files and folders, and say what was taken and left.

    Columns that drive an actuator in a machine.toml are commands. Raises a `SerpentError` that names file,
    stream and key; nothing is overwritten.
    """
    wanted, roles = map_file.read(map_path), stated_roles(machine)
    several = [each for path in files for each in recordings_in(path)]
    hashed = {str(path): file_hash(path) for path, _ in several if path.is_file()}
    settings = {"map_sha256": file_hash(map_path), "input_sha256": hashed}
    settings["files"] = [str(path) for path in files]
    if machine:
        settings["machine_sha256"] = file_hash(machine)
    with claimed(out, SETTINGS, settings):
        found: list[Imported] = []
        with tqdm(several, unit="file", desc="import") as bar:
            for path, source in bar:
                found += read(path, source, wanted, roles)
        if twice := {each.name for each in found if sum(o.name == each.name for o in found) > 1}:
            raise SerpentError(
                f"two recordings have the name {min(twice)}. Rename a file, or import them into two folders."
            )
        about = provenance()
        for each in found:
            write(out / f"{each.name}.parquet", each, wanted, about)
        write_json(out / "imported.json", {"logs": [told(each) for each in found]} | about, 2)
    return found


def machine_of(given: Path | None, map_path: Path, out: Path) -> Path | None:
    """The machine.toml that is given, or its folder; else one beside a map, or where logs are to be."""
    if given:
        return given / MACHINE if given.is_dir() else given
    several = (map_path.parent / MACHINE, out / MACHINE, out.parent / MACHINE)
    return next((each for each in several if each.is_file()), None)


def read(path: Path, source: Source, wanted: Map, roles: Mapping[str, bool]) -> list[Imported]:
    """The recordings of a file or folder."""
    topics = [each.topic for each in wanted.stream]
    try:
        recordings = source.recordings(path, topics)
        return [_imported(name, each, wanted, roles) for name, each in recordings.items()]
    except SerpentError as error:
        text = str(error)
        raise SerpentError(text if str(path) in text else f"{path}: {text}") from None


def _imported(name: str, recorded: Recorded, wanted: Map, roles: Mapping[str, bool]) -> Imported:
    streams: list[ImportedStream] = []
    for n, each in enumerate(wanted.stream):
        try:
            streams.append(stream_of(each, recorded, roles))
        except SerpentError as error:
            raise SerpentError(f"{name}, stream[{n}]: {error}") from None
    streams = [_on_time(each, of, streams) for each, of in zip(wanted.stream, streams, strict=True)]
    time = _rows(name, streams, wanted.rate_hz)
    if len(time) < _FEWEST:
        raise SerpentError(
            f"{name}: the streams have only {counted(len(time), 'row')} in common. Leave one out, or state "
            "how late it is."
        )
    period = np.diff(time, append=time[-1] + np.median(np.diff(time)))
    columns = {"time": time - time[0]}
    for n, each in enumerate(streams):
        _require_roles(name, n, each, float(np.median(period)))
        for column, values in each.columns.items():
            if each.commands[column]:
                columns[column] = _held(time, period, each.time, values)
            else:
                columns[column] = between(each.time, values, time, wanted.gap)
                _require_known(name, n, each, column, columns[column], wanted.gap)
    commands = tuple(c for each in streams for c, is_one in each.commands.items() if is_one)
    return Imported(name, columns, tuple(streams), commands)


def _held(time: Array, period: Array, own: Array, values: Array) -> Array:
    """Commands, each in force until the next one; of switches, whole ones."""
    known = np.isfinite(values)
    own, values = own[known], values[known]
    if len(values) and np.isin(values, (0.0, 1.0)).all():
        return values[np.maximum(np.searchsorted(own, time + period / 2, side="right") - 1, 0)]
    row = np.clip(np.searchsorted(time, own + period[0] / 2) - 1, 0, len(time) - 1)
    with_row = np.abs(own - time[row]) < _ROUNDED * period[row]
    return held(np.where(with_row, time[row], own), values, time, period)


def _require_roles(name: str, n: int, each: ImportedStream, period: float) -> None:
    """Refuse a stream slower than the log if nothing says whether it has commands or readings."""
    unsaid = [column for column, is_one in each.commands.items() if is_one is None]
    if unsaid and period < _SLOWER * each.period:
        raise SerpentError(
            f"{name}, stream[{n}]: {', '.join(unsaid)} of {each.name} come every {1e3 * each.period:.3g} ms, "
            f"the log's rows every {1e3 * period:.3g} ms. Add to the stream, or to a field, "
            "hold = true if they are commands, each in force until the next one, or hold = false if they are "
            "readings, between which straight lines are drawn."
        )


def _require_known(
    name: str, n: int, each: ImportedStream, column: str, values: Array, gap: float
) -> None:
    """Refuse a column of which hardly anything is known."""
    if np.isnan(values).mean() > 0.9 and np.isfinite(each.columns[column]).mean() > 0.5:
        unknown = int(np.isnan(values).sum())
        raise SerpentError(
            f"{name}, stream[{n}]: {column} would be unknown in {unknown:,} of {len(values):,} rows: "
            f"messages are {each.period:.3g} s apart, and gap is {gap:g} s. State "
            "time_unit, or a greater gap."
        )


def _on_time(
    each: MappedStream, own: ImportedStream, streams: Sequence[ImportedStream]
) -> ImportedStream:
    """A stream with its clock set."""
    if not each.follows:
        return replace(own, time=own.time - each.late)
    column = each.follows.like
    other = next(stream for stream in streams if column in stream.columns)
    clock = lateness(
        own.time,
        own.columns[each.follows.own],
        other.time,
        other.columns[column],
        each.follows.most,
    )
    return replace(own, time=own.time - clock.late, clock=clock)


def _rows(name: str, streams: Sequence[ImportedStream], rate_hz: float) -> Array:
    """When the log has rows [s]: while all streams are there; the last command is in force to the end."""
    begin = max(each.time[0] for each in streams)
    readings = [each for each in streams if not all(each.commands.values())]
    end = min(each.time[-1] for each in readings or streams)
    if not rate_hz:
        time = streams[0].time
        return time[(time >= begin) & (time <= end)]
    count, most = (
        max(0, int((end - begin) * rate_hz + 1e-6) + 1),
        max(len(each.time) for each in streams),
    )
    if count > _MOST_ROWS * most:
        raise SerpentError(
            f"{name}: rate_hz = {rate_hz:g} makes {count:,} rows of {most:,} messages, which last "
            f"{end - begin:,.6g} s. State the unit of the time, time_unit in the stream, or another rate_hz."
        )
    return np.minimum(begin + np.arange(count) / rate_hz, end)  # the last one, but for rounding
