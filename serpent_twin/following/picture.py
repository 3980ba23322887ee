"""Draw a path and where the gripper's end was."""

from pathlib import Path

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.following.planning import PathPlan
from serpent_twin.reporting.plot_style import COLOURS, SOFT, sheet, tidy
from serpent_twin.reporting.report import as_png

_VIEWS = ((1, 0, "y", "x"), (1, 2, "y", "z"))
"""Axes of the two views, of the base frame; x hangs down"""


def draw(file: Path, plan: PathPlan, rows: int, tips: dict[str, Array]) -> None:
    """Write a picture of the path, of several courses of the tip on it by name, (T, 3) [m], and of how far
    each was from it, in the first rows of a plan.
    """
    drawing, axes = sheet(9.0, 3.4, columns=3)
    on_path = slice(plan.begins, rows)
    wanted = 1e3 * plan.tip[plan.begins :]
    time = (np.arange(plan.rows) - plan.begins)[on_path] * plan.period
    for view, (across, up, x, y) in zip(axes, _VIEWS, strict=False):
        view.plot(wanted[:, across], wanted[:, up], color=SOFT, lw=2.5, alpha=0.5, label="path")
        for (name, tip), colour in zip(tips.items(), COLOURS[1:], strict=False):
            at = 1e3 * tip[on_path]
            view.plot(at[:, across], at[:, up], color=colour, lw=1.0, label=name)
        view.set_xlabel(f"{x} [mm]")
        view.set_ylabel(f"{y} [mm]")
        view.set_aspect("equal", adjustable="datalim")
        if up == 0:
            view.invert_yaxis()
        tidy(view, "both")
    for (name, tip), colour in zip(tips.items(), COLOURS[1:], strict=False):
        error = 1e3 * np.linalg.norm(tip[on_path] - plan.tip[on_path], axis=1)
        axes[2].plot(time, error, color=colour, lw=1.0, label=name)
    axes[2].set_xlabel("time on the path [s]")
    axes[2].set_ylabel("from the path [mm]")
    axes[2].set_ylim(bottom=0)
    tidy(axes[2])
    drawing.legend(
        *axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False
    )
    part = file.with_name(file.name + ".partial")
    part.write_bytes(as_png(drawing))
    part.rename(file)
