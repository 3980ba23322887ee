"""Draw what a sweep found: against what it varies most, a panel for each of what else it varies."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.reservoir.sweep_rows import SweepRow, error_of, readouts
from serpent_twin.runs import plot_style
from serpent_twin.runs.plot_style import SOFT, label_logarithmic, styles, tidy
from serpent_twin.runs.report import Figure
from serpent_twin.training.figures import looks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

SHADES = "viridis"
RIGID = "rigid cables"
_MOST = 6  # panels
_FAR_APART = 3.0  # times, from which on an axis is logarithmic


@dataclass(frozen=True)
class Axis:
    """A quantity that a sweep varies."""

    name: str
    unit: str
    per_si: float
    """Such units in one of SI"""

    @property
    def label(self) -> str:
        """Label of a plot's axis: name and unit."""
        return f"{self.name} [{self.unit}]"

    def text(self, value: float, digits: int = 3) -> str:
        """A value in its unit."""
        return f"{self.per_si * value:.{digits}g}"


AXES: Mapping[str, Axis] = {
    "stiffness": Axis("strand stiffness", "kN/m", 1e-3),
    "slack": Axis("slack", "mm", 1e3),
    "damping": Axis("hinge damping", "mN m s/rad", 1e3),
    "rate": Axis("command rate", "Hz", 1.0),
    "amplitude": Axis("amplitude", "rad", 1.0),
    "load_noise": Axis("load noise", "% of stall", 1e2),
}
"""Quantities that a sweep may vary, by the names of a row's numbers"""


@dataclass(frozen=True)
class Layout:
    """What lies along the figures, and which rows each panel shows."""

    along: str
    """Name of a row's number"""
    panels: Mapping[str, Sequence[SweepRow]]
    """Rows of each panel, by the panel's title"""
    left_out: int = 0
    """Panels that are not drawn"""


def layout(rows: Sequence[SweepRow]) -> Layout:
    """The axis that is varied most, the stiffness if none is; a panel for each set of the other values."""
    varied = {name: sorted({getattr(row, name) for row in rows}) for name in AXES}
    along = max(varied, key=lambda name: len(varied[name]))
    others = [name for name in AXES if name != along and len(varied[name]) > 1]
    parts: dict[str, list[SweepRow]] = {}
    for row in sorted(rows, key=lambda row: [getattr(row, name) for name in others]):
        values = (f"{AXES[n].name} {AXES[n].text(getattr(row, n))} {AXES[n].unit}" for n in others)
        parts.setdefault(",\n".join(values), []).append(row)
    shown = dict(itertools.islice(parts.items(), _MOST))
    return Layout(along, shown, len(parts) - len(shown))


def sheet(of: Layout, label: str, along: bool = True) -> tuple["Drawing", list["Axes"]]:
    """A drawing with its panels, whose x axis is what the sweep varies by default."""
    count = len(of.panels)
    drawing, panels = plot_style.sheet(2 + 2.7 * count, 3.9, count, sharey=True)
    for axes, title in zip(panels, of.panels, strict=True):
        axes.set_title(title, loc="left", fontsize=9, color=SOFT)
        if along:
            axes.set_xlabel(AXES[of.along].label)
    panels[0].set_ylabel(label)
    return drawing, list(panels)


def finish(drawing: "Drawing", panels: Sequence["Axes"], of: Layout | None = None) -> None:
    """Scales, spines, and one legend for all panels."""
    for axes in panels:
        at = [axis for axis in (of.along,) if _logarithmic(of, axis)] if of else []
        if at:
            axes.set_xscale("log")
        label_logarithmic(axes)
        tidy(axes, labelsize=8)
    known = {label: handle for axes in panels
             for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}  # fmt: skip
    drawing.legend(known.values(), known.keys(), loc="outside right upper", frameon=False)


def _logarithmic(of: Layout, name: str) -> bool:
    values = [getattr(row, name) for rows in of.panels.values() for row in rows]
    return min(values) > 0 and max(values) > _FAR_APART * min(values)


def curve(
    axes: "Axes",
    rows: Sequence[SweepRow],
    along: str,
    value: Callable[[SweepRow], float],
    **style: Any,
) -> None:
    """Means over seeds of a number against what is varied, where there are any, and how far seeds span."""
    of: dict[float, list[float]] = {}
    for row in rows:
        if np.isfinite(number := value(row)):
            of.setdefault(AXES[along].per_si * getattr(row, along), []).append(number)
    at = sorted(of)
    mean = np.array([np.mean(of[x]) for x in at])
    span = np.abs(np.array([[min(of[x]) for x in at], [max(of[x]) for x in at]]) - mean)
    axes.errorbar(at, mean, span if at else None, lw=1.8, ms=4.5, capsize=3, **style)


def by_degree(rows: Sequence[SweepRow], control: Sequence[SweepRow]) -> Figure:
    """Capacity by degree; dotted, that on rigid cables, if it was measured."""
    of = layout(rows)
    drawing, panels = sheet(of, "capacity of motor angles and loads")
    rigid = np.nanmean([row.capacity for row in control], axis=0) if control else []
    look = styles()
    for d, style in zip(range(len(rows[0].capacity)), look, strict=False):
        for axes, each in zip(panels, of.panels.values(), strict=True):
            curve(
                axes, each, of.along, lambda r, d=d: r.capacity[d], label=f"degree {d + 1}", **style
            )
            if len(rigid):
                axes.axhline(rigid[d], color=style["color"], lw=1, ls=":")
    if len(rigid):
        panels[0].plot([], [], color=SOFT, lw=1, ls=":", label=RIGID)
    finish(drawing, panels, of)
    caption = (
        "What motor angles and loads hold of their input history, by degree. Bars span the seeds."
    )
    return Figure("capacity_by_degree", drawing, caption + _left_out(of))


def memory(rows: Sequence[SweepRow]) -> Figure:
    """Linear memory at each delay, a line for each value of what is varied most."""
    from matplotlib.ticker import MaxNLocator

    of = layout([row for row in rows if np.isfinite(row.memory).any()])
    drawing, panels = sheet(of, "linear memory, of 9 inputs", along=False)
    axis, values = AXES[of.along], sorted({getattr(row, of.along) for row in rows})
    for axes, each in zip(panels, of.panels.values(), strict=True):
        for value, colour in zip(values, shades(len(values)), strict=True):
            profiles = [row.memory for row in each if getattr(row, of.along) == value]
            if profiles:
                label = f"{axis.text(value)} {axis.unit}"
                axes.semilogy(
                    np.mean(profiles, axis=0), "o-", color=colour, lw=1.6, ms=3, label=label
                )
        axes.set_xlabel("delay [command periods]")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    finish(drawing, panels)
    caption = (
        "How well each command can be read from motor angles and loads so many command periods later. The "
        "level at the right is chance."
    )
    return Figure("memory_profile", drawing, caption + _left_out(of))


def pose_error(
    rows: Sequence[SweepRow], mark: Callable[[Layout, list["Axes"], str, str], None] | None = None
) -> Figure:
    """Pose error of every readout; `mark` adds further data to a readout's panels."""
    of = layout(rows)
    drawing, panels = sheet(of, "mean marker distance [mm]")
    for name, style in looks(readouts(rows)).items():
        for axes, each in zip(panels, of.panels.values(), strict=True):
            curve(axes, each, of.along, error_of(name), label=name, **style)
        if mark:
            mark(of, panels, name, style["color"])
    for axes in panels:
        axes.set_yscale("log")
    finish(drawing, panels, of)
    caption = "Pose error of readouts. Bars span the seeds."
    return Figure("pose_error", drawing, caption + _left_out(of))


def shades(count: int) -> Array:
    """Colours from dark to light, `count` of them, for ordered values."""
    import matplotlib

    return matplotlib.colormaps[SHADES](np.linspace(0.05, 0.9, count))


def _left_out(of: Layout) -> str:
    return (
        f" {of.left_out} more panels are left out; the table has their points."
        if of.left_out
        else ""
    )
