"""Give all figures one style: colours, drawings and their axes, legends, labels of logarithmic axes."""

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from serpent_twin.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure as Drawing

COLOURS = ("#a3a7ad", "#3d7ea6", "#d1603d", "#588157", "#7d5ba6", "#c9a227")
"""Colours of what all figures show, such as the stages of a trace"""
INK, SOFT, LINE = "#1d2129", "#5c6470", "#e4e6e9"
"""Text and marks; axes and remarks; grids and bands"""
COLD = ("#a790d5", "#6bc7b8", "#385794", "#171782", "#1a1a1a")
WARM = ("#d99d26", "#e05281", "#0f570f", "#570f4b", "#708217", "#bb26d9", "#943857")
"""Twelve colours that differ by at least 9.8 in OKLab (of 100) in normal, protan and deutan sight"""
_LINES, _MARKERS = ("-", "--", ":", "-."), "os^vDPX<>*ph"
_FEWEST, _MOST = 3, 8  # labels of a logarithmic axis
_PLAIN = 1e-4, 1e5  # labels beyond are powers of ten

Style = dict[str, Any]


def styles(taken: Sequence[str] = ()) -> Iterator[Style]:
    """Colour, marker and line style of one line after another: warm colours first, then cold ones, but
    those taken, then all of them again with other line styles.
    """
    colours = (*WARM, *COLD)
    markers: dict[str, str] = dict(zip((*COLD, *WARM), _MARKERS, strict=True))
    for n, line in enumerate(itertools.cycle(_LINES)):
        for colour in (each for each in colours if n or each not in taken):
            yield {"color": colour, "marker": markers[colour], "ls": line}


def sheet(
    width: float, height: float, columns: int = 1, rows: int = 1, sharey: bool = False
) -> tuple["Drawing", Any]:
    """A drawing of a size [inch] and its axes, row by row, (rows × columns,)."""
    from matplotlib.figure import Figure as Drawing

    drawing = Drawing(figsize=(width, height), layout="constrained")
    return drawing, np.atleast_1d(drawing.subplots(rows, columns, sharey=sharey)).ravel()


def tidy(axes: "Axes", grid: Any = "y", labelsize: float | None = None) -> None:
    """Leave of axes what a reader needs, above a grid along x, y or both; None for no grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(colors=SOFT, labelcolor=INK)
    if labelsize:
        axes.tick_params(labelsize=labelsize)
    if grid:
        axes.grid(axis=grid, color=LINE, lw=0.7)
        axes.set_axisbelow(True)


def finish(drawing: "Drawing", axes: "Axes", legend: bool = True) -> None:
    """Tidy axes whose limits are final, with a legend beside all axes of the drawing."""
    tidy(axes)
    label_logarithmic(axes)
    if legend:
        drawing.legend(*axes.get_legend_handles_labels(), loc="outside right upper", frameon=False)


def smooth(values: Array, width: int) -> Array:
    """Mean over a centred window of `width` steps, NaN left out; shorter at the ends."""
    known = np.isfinite(values)
    kernel = np.ones(min(width, len(values)))
    count = np.convolve(known, kernel, "same")
    total = np.convolve(np.where(known, values, 0.0), kernel, "same")
    return np.divide(total, count, out=np.full(len(values), np.nan), where=count > 0)


def label_logarithmic(axes: "Axes") -> None:
    """Give each logarithmic axis at least two labels within its limits, as they are now."""
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            label_axis(axis)


def label_axis(axis: "Axis") -> None:
    """Give one logarithmic axis a few round numbers within its limits."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

    low, high = sorted(axis.get_view_interval())
    axis.set_major_locator(FixedLocator(round_numbers(float(low), float(high))))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _text(value)))
    axis.set_minor_formatter(NullFormatter())


def round_numbers(low: float, high: float) -> list[float]:
    """A few round numbers within limits, both above 0, as even as can be on a logarithmic scale."""
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    for mantissas in ((1,), (1, 2, 5), range(1, 10)):
        found = [m * 10.0**k for k in exponents for m in mantissas]
        found = [each for each in found if low <= each <= high]
        if len(found) >= _FEWEST:
            return found[:: -(-len(found) // _MOST)]
    from matplotlib.ticker import MaxNLocator

    found = MaxNLocator(4, min_n_ticks=2).tick_values(low, high)
    return [float(each) for each in found if low <= each <= high]


def _text(value: float) -> str:
    if _PLAIN[0] <= value <= _PLAIN[1]:
        return f"{value:g}"
    power = int(np.floor(np.log10(value) + 1e-9))
    mantissa = f"{value / 10.0**power:g}"
    factor = "" if mantissa == "1" else rf"{mantissa}\cdot"
    return f"${factor}10^{{{power}}}$"
