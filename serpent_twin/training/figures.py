"""Draw the errors of trained readouts."""

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.numerals import counted
from serpent_twin.runs.plot_style import COLD, WARM, Style, finish, sheet, smooth, styles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PUBLISHED = dict(zip(("analytical", "linear", "mlp", "no_load", "lstm"), COLD, strict=True))

_MARKED = 9  # points of a curve over time that have a marker


def looks(names: Sequence[str]) -> dict[str, Style]:
    """A style for each readout: cold colours for the published ones, warm ones for ours."""
    published = {style["color"]: style for style in itertools.islice(styles(), len(WARM + COLD))}
    ours = styles([PUBLISHED[name] for name in names if name in PUBLISHED])
    return {name: published[PUBLISHED[name]] if name in PUBLISHED else next(ours) for name in names}


def by_marker(per_marker_mm: Mapping[str, Array]) -> "Figure":
    """Mean error of each marker, a line per readout."""
    figure, (axes,) = sheet(9, 4.4)
    style = looks(list(per_marker_mm))
    number = np.arange(1, N_JOINTS + 1)
    for name, values in per_marker_mm.items():
        axes.plot(number, values, **style[name], label=name, ms=4.5, lw=1.6)
    axes.set(xlabel="marker, 9 is the tip", ylabel="mean error [mm]", xticks=number, yscale="log")
    finish(figure, axes)
    return figure


def over_time(time: Array, error_mm: Mapping[str, Array], width: int = 41) -> "Figure":
    """Error of each step averaged over markers, smoothed over `width` steps, a line per readout."""
    figure, (axes,) = sheet(9, 4.4)
    style = looks(list(error_mm))
    for n, (name, error) in enumerate(error_mm.items()):
        marked = (np.arange(_MARKED) + n / len(error_mm)) / _MARKED * (len(time) - 1)
        each = {"markevery": np.unique(marked.astype(int)).tolist(), "ms": 4.5, "lw": 1.2}
        axes.plot(time, smooth(error, width), **style[name], label=name, **each)
    label = f"error, mean of {counted(width, 'step')} [mm]"
    axes.set(xlabel="time [s]", ylabel=label, yscale="log", xlim=(time[0], time[-1]))
    finish(figure, axes)
    return figure


def by_window(results: Mapping[str, Mapping[int, Mapping[str, Any]]]) -> "Figure":
    """Validation loss and test error by the rows in a window, a line per readout."""
    figure, (left, right) = sheet(9, 3.6, columns=2)
    style = looks(list(results))
    windows = sorted({h for of_window in results.values() for h in of_window})
    for name, of_window in results.items():
        for axes, key in ((left, "validation_loss"), (right, "mean_mm")):
            values = np.array([of_window[h][key] for h in windows])
            axes.plot(windows, values, **style[name], label=name, ms=4.5, lw=1.6)
            least, colour = int(np.argmin(values)), style[name]["color"]
            axes.plot(windows[least], values[least], "o", ms=11, mfc="none", color=colour)
    left.set(xlabel="rows in a window, H", ylabel="validation loss, scaled", yscale="log")
    right.set(xlabel="rows in a window, H", ylabel="mean test error [mm]", ylim=(0, None))
    for axes in (left, right):
        axes.set_xticks(windows)
    finish(figure, right)
    finish(figure, left, legend=False)
    return figure


def by_real_windows(curves: Mapping[str, Mapping[int, float]]) -> "Figure":
    """Mean error [mm] by windows of the arm that a correction learned from; dotted without any."""
    figure, (axes,) = sheet(9, 4.4)
    style = looks(list(curves))
    for name, curve in curves.items():
        axes.axhline(curve[0], ls=":", lw=0.8, color=style[name]["color"])
        some = {count: error for count, error in curve.items() if count}
        axes.plot(some.keys(), some.values(), **style[name], label=name, ms=4.5, lw=1.6)
    axes.set(xlabel="windows of the arm", ylabel="mean error [mm]", xscale="log", yscale="log")
    errors = [error for curve in curves.values() for error in curve.values()]
    axes.set(ylim=(min(errors) / 1.5, 1.5 * max(errors)))
    finish(figure, axes)
    return figure
