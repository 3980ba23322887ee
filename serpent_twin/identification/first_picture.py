"""Draw what was measured beside what the nominal twin predicts, before anything is fitted."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array, known_mean
from serpent_twin.residual import Comparison
from serpent_twin.runs.plot_style import COLOURS, INK, SOFT, sheet, tidy
from serpent_twin.runs.report import Figure, Report, Section, write

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME = "first_picture"
_RUNNING = (
    "This is what the logs show before anything is fitted. What the twin lacks stands here as soon as the "
    "trace has ended."
)
_MOST_ROWS = 6
"""Measured quantities, and lines of one panel with names"""
_SECONDS = 60.0
"""Longest time that is drawn, from the session's beginning"""
_ADJACENT = 1.5
"""Times the rows' distance, up to which one block of rows follows another"""


Rows = NDArray[np.intp]
"""Indices of rows of all segments, (T,)"""


@dataclass(frozen=True)
class Channel:
    """One number that is measured and predicted, in the unit that people read."""

    name: str
    unit: str
    measured: Array
    """(T,)"""
    predicted: Array
    """(T,)"""


def begin_report(comparison: Comparison, out: Path, title: str) -> str:
    """Write a report that shows what was measured beside the nominal twin; returns where its picture is."""
    write(Report(title, _RUNNING, (first_section(comparison),)), out)
    return f"{out / 'figures' / NAME}.png: measured beside the nominal model."


def first_section(comparison: Comparison) -> Section:
    """The section of a report that shows what was measured before anything was fitted."""
    return Section("Measured and nominal", "", (first_picture(comparison),))


def first_picture(comparison: Comparison) -> Figure:
    """Each joint or marker of the session that differs most, measured beside predicted, with the residual;
    the inputs below.
    """
    session = _furthest(comparison)
    rows = np.flatnonzero([name == session for name in comparison.session])
    time, order = _clock(comparison, rows)
    channels = list(_channels(comparison, order))[:_MOST_ROWS]
    count = 2 * len(channels) + 1
    drawing, panels = sheet(11, 1.1 * count + 0.7, rows=count)
    for n, each in enumerate(channels):
        above, below = panels[2 * n], panels[2 * n + 1]
        above.plot(time, each.predicted, color=COLOURS[2], lw=1.2, label="nominal model")
        above.plot(time, each.measured, color=INK, lw=1.0, label="measured")
        below.plot(time, each.measured - each.predicted, color=COLOURS[1], lw=0.9)
        above.set_ylabel(f"{each.name}\n[{each.unit}]")
        below.set_ylabel(f"difference\n[{each.unit}]")
    _inputs(panels[-1], comparison, time, order)
    for axes in panels:
        tidy(axes, labelsize=8)
        axes.margins(x=0.005)
        axes.yaxis.label.set(color=SOFT, size=8, rotation=0, ha="right", va="center")
    for axes in panels[:-1]:
        axes.set_xticklabels([])
    panels[-1].set_xlabel("time [s]")
    panels[0].set_title(session, loc="right", fontsize=8, color=SOFT)
    drawing.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False
    )
    drawing.align_ylabels(list(panels))
    caption = (
        f"Session {session}, in which they differ most, before anything is fitted. The nominal model is "
        "given the inputs below; where it is simulated, each segment begins with what was measured there."
    )
    return Figure(NAME, drawing, caption)


def _furthest(comparison: Comparison) -> str:
    """The session whose channels differ most, each beside what it differs in all sessions."""
    names, session = list(dict.fromkeys(comparison.session)), np.array(comparison.session)
    found = np.zeros(len(names))
    for residual in (comparison.marker_residual, comparison.load_residual):
        squares = (residual**2).reshape(*comparison.time.shape, -1)
        each = [known_mean(squares[session == name], (0, 1)) for name in names]
        ratio = np.nan_to_num(each) / np.maximum(known_mean(squares, (0, 1)), 1e-300)
        found += np.nan_to_num(ratio).sum(axis=1)
    return names[int(np.argmax(found))]


def _clock(comparison: Comparison, rows: Rows) -> tuple[Array, Rows]:
    """Times of a session's rows, with a gap where rows are missing, (T,), and which rows these are, −1 in
    gaps.
    """
    time, order = list[float](), list[int]()
    width, period = comparison.time.shape[1], comparison.period
    for segment in rows:
        now = comparison.time[segment]
        if time and abs(now[0] - time[-1]) > _ADJACENT * period:
            time.append(np.nan)
            order.append(-1)
        inside = np.flatnonzero(now <= _SECONDS)
        time += now[inside].tolist()
        order += (segment * width + inside).tolist()
    return np.array(time), np.array(order, np.intp)


def _lined_up(values: Array, order: Rows) -> Array:
    """Values of segments, (S, T), in the order of a session's rows, NaN in gaps."""
    return np.where(order < 0, np.nan, values.reshape(-1)[order])


def _channels(comparison: Comparison, order: Rows) -> Iterator[Channel]:
    """Joints and other numbers one by one; of points in space the last one's coordinates."""
    measured, predicted = comparison.marker_measured, comparison.marker_predicted
    if measured is not None and predicted is not None:
        marker, names = comparison.marker, comparison.marker_names
        for n in range(len(names))[-1 if marker.axes else 0 :]:
            for axis in range(measured.shape[-1]):
                name = f"{names[n]} {marker.axes[axis]}" if marker.axes else names[n]
                pair = (
                    marker.scale * _lined_up(v[:, :, n, axis], order) for v in (measured, predicted)
                )
                yield Channel(name, marker.unit, *pair)
    measured, predicted = comparison.load_measured, comparison.load_predicted
    if measured is not None and predicted is not None:
        for n, name in enumerate(comparison.load_names):
            pair = (
                comparison.load.scale * _lined_up(v[:, :, n], order) for v in (measured, predicted)
            )
            yield Channel(name, comparison.load.unit, *pair)


def _inputs(axes: "Axes", comparison: Comparison, time: Array, order: Rows) -> None:
    """What drives the machine, in one panel."""
    driven = comparison.motor_angle
    if driven is None:
        axes.set_axis_off()
        return
    units = list[str]()
    for n, (name, measure) in enumerate(
        zip(comparison.motor_names, comparison.motors, strict=False)
    ):
        label = f"{name} [{measure.unit}]" if n < _MOST_ROWS else None
        axes.plot(time, measure.scale * _lined_up(driven[:, :, n], order), lw=0.9, label=label)
        units.append(measure.unit)
    axes.set_ylabel("inputs" if len(set(units)) > 1 else f"inputs\n[{units[0]}]")
    axes.legend(loc="upper right", fontsize=7, frameon=False, ncols=3)
