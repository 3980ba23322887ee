"""Draw the figures of the stiffness sweep."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from experiments.stiffness_sweep.plan import AMPLITUDES, GRID, RATES, RIGID, natural_period
from experiments.stiffness_sweep.rows import Rows
from serpent_twin.arrays import Array
from serpent_twin.reservoir import sweep_figures
from serpent_twin.reservoir.sweep_rows import SweepRow, error_of, readouts, values
from serpent_twin.runs.plot_style import INK, SOFT, label_logarithmic, styles, tidy
from serpent_twin.runs.report import Figure

_ARM = {"marker": "D", "ms": 6, "ls": "", "mec": INK, "mew": 0.8}
_DARK = 0.4  # mean of red, green and blue below which ink cannot be read


def figures(
    rows: Rows, arms: Mapping[str, Mapping[str, Any]], transfer: Mapping[str, Any] | None
) -> dict[str, Figure]:
    """All figures by name."""
    of = rows[GRID]
    drawn = [sweep_figures.by_degree(of, rows[RIGID]), sweep_figures.memory(of)]
    drawn += [_pose(rows, arms), _maps(rows), _commands(rows)]
    if any("profile" in each for found in arms.values() for each in found["memory"].values()):
        drawn.append(_arms_memory(arms))
    if transfer:
        drawn.append(_transfer(transfer))
    return {figure.name: figure for figure in drawn}


def _pose(rows: Rows, arms: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Pose error of every readout against stiffness, one panel per slack, with the logged arms."""
    slacks = np.array(_axis(rows, "slack"))

    def mark(of: sweep_figures.Layout, panels: list[Axes], name: str, colour: str) -> None:
        """Logged arms in the panel of the nearest slack; slow readouts are trained on twins alone."""
        for found in arms.values():
            at = found["place"]
            axes = panels[int(np.argmin(np.abs(slacks - at["slack"])))]
            if name in found["pose_mm"]:
                axes.plot(at["stiffness"] / 1e3, found["pose_mm"][name], color=colour, **_ARM)
        if name == readouts(rows[GRID])[-1] and arms:
            panels[0].plot([], [], color="white", label="logged arms", **_ARM)

    drawn = sweep_figures.pose_error(rows[GRID], mark)
    said = " Logged arms lie in the nearest panel." if arms else ""
    return Figure(drawn.name, drawn.drawing, drawn.caption + said)


def _maps(rows: Rows) -> Figure:
    """Useful capacity and pose error over stiffness and slack."""
    best = "residual" if "residual" in readouts(rows[GRID]) else "linear"
    shown = {
        "useful capacity, as sensors show": values(rows[GRID], lambda row: row.useful_total),
        "useful capacity, without noise": values(rows[GRID], lambda row: row.noiseless_total),
        f"pose error of {best} [mm]": values(rows[GRID], error_of(best)),
    }
    drawing = Drawing(figsize=(15, 1.6 + 0.55 * len(_axis(rows, "slack"))), layout="constrained")
    for axes, (title, each), shade in zip(
        drawing.subplots(1, 3), shown.items(), ("YlGnBu", "YlGnBu", "YlOrBr"), strict=True
    ):
        mean = np.nanmean(each, axis=-1)
        _cells(axes, mean, shade)
        axes.set_xticks(range(mean.shape[1]), [f"{k / 1e3:.3g}" for k in _axis(rows, "stiffness")])
        axes.set_yticks(range(mean.shape[0]), [f"{1e3 * s:g}" for s in _axis(rows, "slack")])
        axes.set(xlabel="strand stiffness [kN/m]", ylabel="slack [mm]")
        axes.set_title(title, loc="left", fontsize=10, color=SOFT)
    caption = (
        "Where the body adds most to its last commands: capacity with taps minus taps alone, of motor angles "
        "and loads as read, and of joint angles and loads without noise. Right: the pose error."
    )
    return Figure("maps", drawing, caption)


def _commands(rows: Rows) -> Figure:
    """Useful capacity against stiffness at other rates and amplitudes."""
    drawing = Drawing(figsize=(10, 3.7), layout="constrained")
    panels = drawing.subplots(1, 2, sharey=True)
    for axes, (name, unit, kind) in zip(
        panels, (("rate", "Hz", RATES), ("amplitude", "rad", AMPLITUDES)), strict=True
    ):
        for value, style in zip(
            sorted({getattr(r, name) for r in rows[kind]}), styles(), strict=False
        ):
            of = sorted((r for r in rows[kind] if getattr(r, name) == value), key=_by_stiffness)
            at = np.array([row.stiffness for row in of]) / 1e3
            axes.semilogx(at, [r.noiseless_total for r in of], **style, lw=1.8, ms=4,
                          label=f"{value:g} {unit}")  # fmt: skip
            if kind == RATES:
                _meeting(axes, [row.stiffness for row in of], value, style["color"])
        axes.set_xlabel("strand stiffness [kN/m]")
        _tidy(axes)
        axes.legend(frameon=False, fontsize=8)
    panels[0].set_ylabel("useful capacity, without noise")
    caption = (
        "What the body adds to its last commands at other rates, each with as wide targets as the servos' "
        "speed allows, and at other amplitudes. A dotted line is where the "
        "natural period is the command period of its colour."
    )
    return Figure("commands", drawing, caption)


def _by_stiffness(row: SweepRow) -> float:
    return row.stiffness


def _meeting(axes: Axes, stiffness: Sequence[float], rate: float, colour: str) -> None:
    period = np.log([natural_period(k) * rate for k in stiffness])
    if period.min() < 0 < period.max():
        at = np.exp(np.interp(0.0, period[::-1], np.log(stiffness)[::-1]))
        axes.axvline(at / 1e3, color=colour, lw=1, ls=":")


def _arms_memory(arms: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Linear memory of logs and of the twins at their places."""
    drawing = Drawing(figsize=(10, 3.7), layout="constrained")
    sets = list(next(iter(arms.values()))["memory"])
    for axes, name in zip(drawing.subplots(1, len(sets), sharey=True), sets, strict=True):
        for (arm, found), look in zip(arms.items(), styles(), strict=False):
            for kind, style in (("memory", "o-"), ("twin_memory", "x:")):
                if "profile" in found[kind][name]:
                    label = arm if kind == "memory" else None
                    axes.semilogy(
                        found[kind][name]["profile"], style, color=look["color"], ms=4, label=label
                    )
        axes.set_title(name, loc="left", fontsize=10, color=SOFT)
        axes.set_xlabel("delay [holds]")
        _tidy(axes)
        if axes.lines:
            axes.legend(frameon=False, fontsize=8)
    drawing.axes[0].set_ylabel("linear memory, of 9 inputs")
    caption = (
        "Linear memory of the published targets in logs (solid) and in the twin at each arm's place "
        "(dotted)."
    )
    return Figure("arms_memory", drawing, caption)


def _transfer(found: Mapping[str, Any]) -> Figure:
    """Errors by arm that trained and arm that tests."""
    arms, count = found["arms"], len(found["arms"])
    drawing = Drawing(figsize=(3 + 1.15 * count, 2 + 0.4 * count), layout="constrained")
    for axes, (readout, mm) in zip(drawing.subplots(1, 2), found["mm"].items(), strict=True):
        _cells(axes, np.array([[mm[a][b] for b in arms] for a in arms]), "YlOrBr", logarithmic=True)
        axes.set_xticks(range(count), arms, rotation=45, ha="right")
        axes.set_yticks(range(count), arms)
        axes.set(xlabel="tested on", ylabel="trained on")
        axes.set_title(f"{readout} [mm]", loc="left", fontsize=10, color=SOFT)
    return Figure("transfer", drawing, "Mean marker distance of readouts of one arm on another.")


def _cells(axes: Axes, numbers: Array, shade: str, logarithmic: bool = False) -> None:
    """A map with the numbers in it."""
    colour = np.log(numbers) if logarithmic else numbers
    image = axes.imshow(colour, cmap=shade, aspect="auto", alpha=0.75)
    image.set_clim(float(np.nanmin(colour)), float(np.nanmax(colour)) + 1e-9)
    for (i, j), number in np.ndenumerate(numbers):
        text = f"{number:.3g}" if np.isfinite(number) else "–"
        dark = np.mean(image.cmap(image.norm(colour[i, j]))[:3]) < _DARK
        axes.text(j, i, text, ha="center", va="center", fontsize=8, color="white" if dark else INK)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0, labelsize=8)


def _axis(rows: Rows, name: str) -> list[float]:
    return sorted({getattr(row, name) for row in rows[GRID]})


def _tidy(axes: Axes) -> None:
    tidy(axes, labelsize=8)
    label_logarithmic(axes)
