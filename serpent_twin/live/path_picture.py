"""Draw a path and where the gripper's end was."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.runs.plot_style import COLOURS, SOFT, sheet, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

_VIEWS = ((1, 0, "y", "x"), (1, 2, "y", "z"))
"""Axes of the two views, of the base frame; x hangs down"""


def drawn(time: Array, wanted: Array, tips: Mapping[str, Array]) -> "Drawing":
    """A path, (T, 3) [m], several courses of the tip on it by name, and how far each was from it over time
    [s], (T,).
    """
    drawing, axes = sheet(9.0, 3.4, columns=3)
    for view, (across, up, x, y) in zip(axes, _VIEWS, strict=False):
        path = 1e3 * wanted
        view.plot(path[:, across], path[:, up], color=SOFT, lw=3.0, alpha=0.4, label="path")
        for (name, tip), colour in zip(tips.items(), COLOURS[1:], strict=False):
            view.plot(1e3 * tip[:, across], 1e3 * tip[:, up], color=colour, lw=1.0, label=name)
        view.set_xlabel(f"{x} [mm]")
        view.set_ylabel(f"{y} [mm]")
        view.set_aspect("equal", adjustable="datalim")
        if up == 0:
            view.invert_yaxis()
        tidy(view, "both")
    for tip, colour in zip(tips.values(), COLOURS[1:], strict=False):
        error = 1e3 * np.linalg.norm(tip - wanted, axis=1)
        axes[2].plot(time, error, color=colour, lw=1.0)
    axes[2].set_xlabel("time on the path [s]")
    axes[2].set_ylabel("from the path [mm]")
    axes[2].set_ylim(bottom=0)
    tidy(axes[2])
    drawing.legend(
        *axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False
    )
    return drawing
