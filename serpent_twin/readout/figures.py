"""What do the errors look like?"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from serpent_twin.arm import N_JOINTS, Array
from serpent_twin.numerals import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PUBLISHED = {
    "analytical": "#9a9a9a",
    "linear": "#6b9ac4",
    "mlp": "#2f6690",
    "no_load": "#81c3d7",
    "lstm": "#16425b",
}
OURS = ("#e0a458", "#d1603d", "#a63a50", "#7b2d26", "#588157", "#344e41")


def colours(names: list[str]) -> dict[str, str]:
    """A colour per readout: cold for the published ones, warm for ours."""
    ours = iter(OURS * len(names))
    return {name: PUBLISHED[name] if name in PUBLISHED else next(ours) for name in names}


def by_marker(per_marker_mm: Mapping[str, Array]) -> "Figure":
    """Mean error of each marker, a line per readout."""
    figure, axes = _axes(9, 4.4)
    colour = colours(list(per_marker_mm))
    number = np.arange(1, N_JOINTS + 1)
    for name, values in per_marker_mm.items():
        axes.plot(number, values, "o-", color=colour[name], label=name, ms=4, lw=1.6)
    axes.set(xlabel="marker, 9 is the tip", ylabel="mean error [mm]", xticks=number, yscale="log")
    return _finish(figure, axes)


def over_time(time: Array, error_mm: Mapping[str, Array], width: int = 41) -> "Figure":
    """Error of each step averaged over markers, smoothed over `width` steps, a line per readout."""
    figure, axes = _axes(9, 4.4)
    colour = colours(list(error_mm))
    for name, error in error_mm.items():
        axes.plot(time, smooth(error, width), color=colour[name], label=name, lw=1.2)
    label = f"error, mean of {counted(width, 'step')} [mm]"
    axes.set(xlabel="time [s]", ylabel=label, yscale="log", xlim=(time[0], time[-1]))
    return _finish(figure, axes)


def by_window(results: Mapping[str, Mapping[int, Mapping[str, Any]]]) -> "Figure":
    """Validation loss and test error by the rows in a window, a line per readout."""
    figure, (left, right) = _axes(9, 3.6, columns=2)
    colour = colours(list(results))
    windows = sorted({h for of_window in results.values() for h in of_window})
    for name, of_window in results.items():
        for axes, key in ((left, "validation_loss"), (right, "mean_mm")):
            values = np.array([of_window[h][key] for h in windows])
            axes.plot(windows, values, "o-", color=colour[name], label=name, ms=4, lw=1.6)
            least = int(np.argmin(values))
            axes.plot(windows[least], values[least], "o", ms=10, mfc="none", color=colour[name])
    left.set(xlabel="rows in a window, H", ylabel="validation loss, scaled", yscale="log")
    right.set(xlabel="rows in a window, H", ylabel="mean test error [mm]", ylim=(0, None))
    for axes in (left, right):
        axes.set_xticks(windows)
    _finish(figure, right)
    return _finish(figure, left, legend=False)


def by_real_windows(curves: Mapping[str, Mapping[int, float]]) -> "Figure":
    """Mean error [mm] by windows of the arm that a correction learned from; dotted without any."""
    figure, axes = _axes(9, 4.4)
    colour = colours(list(curves))
    for name, curve in curves.items():
        axes.axhline(curve[0], ls=":", lw=0.8, color=colour[name])
        some = {count: error for count, error in curve.items() if count}
        axes.plot(some.keys(), some.values(), "o-", color=colour[name], label=name, ms=4, lw=1.6)
    axes.set(xlabel="windows of the arm", ylabel="mean error [mm]", xscale="log", yscale="log")
    counts = sorted({count for curve in curves.values() for count in curve if count})
    axes.set_xticks(counts, map(str, counts))
    axes.set_xticks([], minor=True)
    errors = [error for curve in curves.values() for error in curve.values()]
    low, high = min(errors) / 1.5, 1.5 * max(errors)
    round_ones = [m * 10.0**k for k in range(-3, 4) for m in (1, 2, 5)]
    shown = [each for each in round_ones if low <= each <= high]
    axes.set(ylim=(low, high))
    axes.set_yticks(shown, [f"{each:g}" for each in shown])
    axes.set_yticks([], minor=True)
    return _finish(figure, axes)


def smooth(values: Array, width: int) -> Array:
    """Mean over a centred window of `width` steps, NaN left out; shorter at the ends."""
    known = np.isfinite(values)
    kernel = np.ones(min(width, len(values)))
    count = np.convolve(known, kernel, "same")
    total = np.convolve(np.where(known, values, 0.0), kernel, "same")
    return np.divide(total, count, out=np.full(len(values), np.nan), where=count > 0)


def _axes(width: float, height: float, columns: int = 1) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(1, columns)


def _finish(figure: "Figure", axes: "Axes", legend: bool = True) -> "Figure":
    from matplotlib.ticker import NullFormatter, StrMethodFormatter

    if axes.get_yscale() == "log" and "mm" in axes.get_ylabel():
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", which="both", color="#e6e6e6", lw=0.6)
    if not legend:
        return figure
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper", frameon=False)
    return figure
