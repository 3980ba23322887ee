"""What does the stiffness sweep look like?"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import LogLocator
from stiffness_sweep_plan import AMPLITUDES, GRID, RATES, RIGID, natural_period
from stiffness_sweep_rows import Row, Rows, error_of, readouts, values

from serpent_twin.arm import Array
from serpent_twin.report import Figure

COLOURS = ("#3d7ea6", "#d1603d", "#588157", "#7d5ba6", "#c9a227", "#a3a7ad")
INK, SOFT, LINE = "#1d2129", "#5c6470", "#e4e6e9"
SHADES = "viridis"
_RIGID = "rigid cables"
_ARM = {"marker": "D", "ms": 6, "ls": "", "mec": INK, "mew": 0.8}
_DARK = 0.4  # mean of red, green and blue below which ink cannot be read


def figures(
    rows: Rows, arms: Mapping[str, Mapping[str, Any]], transfer: Mapping[str, Any] | None
) -> dict[str, Figure]:
    """All figures by name."""
    drawn = [_by_degree(rows), _memory(rows), _pose(rows, arms), _maps(rows), _commands(rows)]
    if any("profile" in each for found in arms.values() for each in found["memory"].values()):
        drawn.append(_arms_memory(arms))
    if transfer:
        drawn.append(_transfer(transfer))
    return {figure.name: figure for figure in drawn}


def _by_degree(rows: Rows) -> Figure:
    """Capacity by degree against stiffness, one panel per slack."""
    drawing, panels = _slack_panels(rows)
    degrees = len(rows[GRID][0].capacity)
    control = np.nanmean([row.capacity for row in rows[RIGID]], axis=0)
    for d in range(degrees):
        held = values(rows[GRID], lambda row, d=d: float(row.capacity[d]))
        for axes, each in zip(panels, held, strict=True):
            _seeds(axes, rows, each, COLOURS[d], f"degree {d + 1}")
            axes.axhline(control[d], color=COLOURS[d], lw=1, ls=":")
    panels[0].plot([], [], color=SOFT, lw=1, ls=":", label=_RIGID)
    panels[0].set_ylabel("capacity of motor angles and loads")
    _finish(drawing, panels)
    caption = (
        "What motor angles and loads hold of their input history, by degree. Bars span the seeds."
    )
    return Figure("capacity_by_degree", drawing, caption)


def _memory(rows: Rows) -> Figure:
    """Linear memory at each delay, one line per stiffness, one panel per slack."""
    drawing, panels = _slack_panels(rows, logarithmic=False)
    for axes, slack in zip(panels, _axis(rows, "slack"), strict=True):
        for stiffness, colour in _shades(_axis(rows, "stiffness")):
            of = [r.memory for r in rows[GRID] if r.slack == slack and r.stiffness == stiffness]
            mean = np.mean(of, axis=0)
            axes.semilogy(mean, "o-", color=colour, lw=1.6, ms=3, label=_newton(stiffness))
        axes.set_xlabel("delay [command periods]")
    panels[0].set_ylabel("linear memory, of 9 inputs")
    _finish(drawing, panels)
    caption = (
        "How well each command can be read from motor angles and loads so many command periods later. The "
        "level at the right is chance."
    )
    return Figure("memory_profile", drawing, caption)


def _pose(rows: Rows, arms: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Pose error of every readout against stiffness, one panel per slack, with the logged arms."""
    drawing, panels = _slack_panels(rows)
    slacks = np.array(_axis(rows, "slack"))
    for name, colour in zip(readouts(rows[GRID]), COLOURS, strict=False):
        error = values(rows[GRID], error_of(name))
        for axes, each in zip(panels, error, strict=True):
            _seeds(axes, rows, each, colour, name)
        for found in arms.values():
            at = found["place"]
            axes = panels[int(np.argmin(np.abs(slacks - at["slack"])))]
            if name in found["pose_mm"]:  # slow ones are trained on twins alone
                axes.plot(at["stiffness"] / 1e3, found["pose_mm"][name], color=colour, **_ARM)
    if arms:
        panels[0].plot([], [], color="white", label="logged arms", **_ARM)
    for axes in panels:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
    panels[0].set_ylabel("mean marker distance [mm]")
    _finish(drawing, panels)
    caption = "How well readouts tell the pose. Bars span the seeds; logged arms lie in the nearest panel."
    return Figure("pose_error", drawing, caption)


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
        "and loads as read, and of joint angles and loads without noise. Right: where the pose is told best."
    )
    return Figure("maps", drawing, caption)


def _commands(rows: Rows) -> Figure:
    """Useful capacity against stiffness at other rates and amplitudes."""
    drawing = Drawing(figsize=(10, 3.7), layout="constrained")
    panels = drawing.subplots(1, 2, sharey=True)
    for axes, (name, unit, kind) in zip(
        panels, (("rate", "Hz", RATES), ("amplitude", "rad", AMPLITUDES)), strict=True
    ):
        for value, colour in zip(
            sorted({getattr(r, name) for r in rows[kind]}), COLOURS, strict=False
        ):
            of = sorted((r for r in rows[kind] if getattr(r, name) == value), key=_by_stiffness)
            at = np.array([row.stiffness for row in of]) / 1e3
            axes.semilogx(at, [r.noiseless_total for r in of], "o-", color=colour, lw=1.8, ms=4,
                          label=f"{value:g} {unit}")  # fmt: skip
            if kind == RATES:
                _meeting(axes, [row.stiffness for row in of], value, colour)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
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


def _by_stiffness(row: Row) -> float:
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
        for (arm, found), colour in zip(arms.items(), COLOURS, strict=False):
            for kind, style in (("memory", "o-"), ("twin_memory", "x:")):
                if "profile" in found[kind][name]:
                    label = arm if kind == "memory" else None
                    axes.semilogy(
                        found[kind][name]["profile"], style, color=colour, ms=4, label=label
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


def _slack_panels(rows: Rows, logarithmic: bool = True) -> tuple[Drawing, list[Axes]]:
    slacks = _axis(rows, "slack")
    drawing = Drawing(figsize=(2 + 2.7 * len(slacks), 3.7), layout="constrained")
    panels = list(np.atleast_1d(drawing.subplots(1, len(slacks), sharey=True)))
    for axes, slack in zip(panels, slacks, strict=True):
        axes.set_title(f"{1e3 * slack:g} mm of slack", loc="left", fontsize=10, color=SOFT)
        if logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter("")
            axes.set_xlabel("strand stiffness [kN/m]")
    return drawing, panels


def _seeds(axes: Axes, rows: Rows, each: Array, colour: str, label: str) -> None:
    """Mean over seeds of values (K, S) against stiffness, where there are any, and how far they span."""
    there = ~np.isnan(each).all(axis=1)
    each = each[there]
    mean = np.nanmean(each, axis=1)
    span = np.abs(np.array([np.nanmin(each, axis=1), np.nanmax(each, axis=1)]) - mean)
    at = np.array(_axis(rows, "stiffness"))[there] / 1e3
    axes.errorbar(at, mean, span, fmt="o-", color=colour, lw=1.8, ms=4, capsize=3, label=label)


def _shades(of: Sequence[float]) -> list[tuple[float, Any]]:
    import matplotlib

    shades = matplotlib.colormaps[SHADES](np.linspace(0.05, 0.9, len(of)))
    return list(zip(of, shades, strict=True))


def _axis(rows: Rows, name: str) -> list[float]:
    return sorted({getattr(row, name) for row in rows[GRID]})


def _newton(stiffness: float) -> str:
    return f"{stiffness / 1e3:.3g} kN/m"


def _tidy(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(colors=SOFT, labelcolor=INK, labelsize=8)
    axes.grid(axis="y", color=LINE, lw=0.7)
    axes.set_axisbelow(True)


def _finish(drawing: Drawing, panels: Sequence[Axes]) -> None:
    for axes in panels:
        _tidy(axes)
    drawing.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", frameon=False)
