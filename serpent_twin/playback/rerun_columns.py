"""Show the columns of a log in rerun, a plot for each unit."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from serpent_twin.arrays import Array
from serpent_twin.playback.rerun_colours import hue
from serpent_twin.playback.rerun_recording import written

_COLOURS = 10


def write(
    out: Path,
    title: str,
    time: Array,
    columns: Mapping[str, Array],
    units: Mapping[str, str],
    identity: str | None = None,
) -> None:
    """Write a recording of columns (T,) over time [s] to a file, which appears when it is whole."""
    plots: dict[str, list[str]] = {}
    for name in columns:
        plots.setdefault(units.get(name, ""), []).append(name)
    views = [
        rrb.TimeSeriesView(
            origin="/",
            contents=[f"/{_path(unit, name)}" for name in names],
            name=f"{unit if unit not in ('', '1') else 'without a unit'}",
        )
        for unit, names in plots.items()
    ]
    layout = rrb.Blueprint(
        rrb.Vertical(*views, name=title), rrb.TimePanel(state="collapsed", timeline="time")
    )
    stream = rr.RecordingStream("serpent_twin", recording_id=identity)
    with written(out, stream, layout):
        stream.send_recording_name(title)
        for unit, names in plots.items():
            for n, name in enumerate(names):
                _curve(stream, _path(unit, name), name, n, time, columns[name])


def _path(unit: str, name: str) -> str:
    """Where a column is in the recording."""
    return f"{rr.escape_entity_path_part(unit or '1')}/{rr.escape_entity_path_part(name)}"


def _curve(
    stream: rr.RecordingStream, path: str, name: str, n: int, time: Array, values: Array
) -> None:
    known = np.flatnonzero(np.isfinite(values))
    style = rr.SeriesLines(colors=[hue(n % _COLOURS)], names=name, widths=[1.3])
    stream.log(path, style, static=True)
    clocks = [rr.TimeColumn("time", duration=time[known]), rr.TimeColumn("step", sequence=known)]
    rr.send_columns(path, clocks, rr.Scalars.columns(scalars=values[known]), recording=stream)
