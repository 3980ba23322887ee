"""Draw the figures of a diagnosis."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.identification.diagnosis import (
    ACCEPTED,
    NOT_EXCITED,
    REJECTED,
    STANDS_IN,
    UNSTABLE,
    UNTESTED,
    Diagnosis,
    Tried,
)
from serpent_twin.identification.wording import spaced
from serpent_twin.residual import Comparison, Dependence, Findings
from serpent_twin.residual.curves import Curve, curve, marker_curve
from serpent_twin.runs.plot_style import COLOURS, INK, SOFT, sheet, tidy
from serpent_twin.runs.report import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STAGES = ("nominal", "calibrated", "corrected")
STAGE_COLOUR: Mapping[str, str] = dict(zip(STAGES, COLOURS, strict=False))
"""The colours that residual.figures gives the same three"""
_VERDICT_STYLE = {
    ACCEPTED: ("o", COLOURS[2]),
    STANDS_IN: ("^", COLOURS[3]),
    REJECTED: ("s", COLOURS[1]),
    NOT_EXCITED: ("x", SOFT),
    UNSTABLE: ("x", SOFT),
}
Twin = tuple[Comparison, Findings]
"""What one twin predicts beside what was measured, and what there is to say of it"""
_HEAT_S = 4.0  # a cell of the heat map
_DRAWN = 24  # candidates, the first ones; a table has all
_LABEL = 46  # characters in a line of a candidate's label: a composed law is a sentence


def stages(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The twins compared; a corrected one only where an effect was added to the calibrated one."""
    return STAGES if diagnosis.effects or diagnosis.stand_ins else STAGES[:2]


def before_and_after(diagnosis: Diagnosis) -> Figure | None:
    """The held-out error of each twin, markers and loads; None if neither is known."""
    kinds = ((diagnosis.error, diagnosis.marker), (diagnosis.load_error, diagnosis.load))
    known = [kind for kind in kinds if np.isfinite(kind[0].get("calibrated", np.nan))]
    if not known:
        return None
    names = stages(diagnosis)
    drawing, panels = sheet(9, 0.55 * len(names) + 1.3, columns=len(known))
    levels: dict[str, Any] = {}
    for axes, (error, measure) in zip(panels, known, strict=True):
        _bars(axes, error, names, measure.unit)
        levels |= _levels(axes, error)
        axes.set_xlabel(f"{measure.size} [{measure.unit}]")
    for axes in panels[1:]:
        axes.set_yticklabels([])
    drawing.legend(
        levels.values(), levels.keys(), loc="outside upper left", ncols=2, frameon=False, fontsize=9,
        labelcolor=SOFT, handlelength=1.4,
    )  # fmt: skip
    caption = (
        "Error on the held-out sessions, to which nothing was fitted. In brackets, the change against "
        "the bar above; the band is what the measurement's noise makes by itself."
    )
    return Figure("before_and_after", drawing, caption)


def _bars(axes: "Axes", error: Mapping[str, float], names: Sequence[str], unit: str) -> None:
    """A bar for each twin, with its number and its change against the one before."""
    values = np.array([error.get(name, np.nan) for name in names])
    longest = np.nanmax([*values, error.get("expected", np.nan)])
    for n, (name, value) in enumerate(zip(names, values, strict=True)):
        axes.barh(n, value, height=0.62, color=STAGE_COLOUR[name], zorder=2)
        text = f"{value:.2f} {unit}" if np.isfinite(value) else "not known"
        if n and values[n - 1] > 0 and np.isfinite(value):
            text += f"  ({100 * (value / values[n - 1] - 1):+.0f} %)".replace("-", "−")
        at = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 10}
        axes.annotate(text, (1.02, n), color=INK, fontweight="bold", **at)
    axes.set(xlim=(0, 1.02 * longest), ylim=(len(names) - 0.5, -0.6))
    axes.set_yticks(range(len(names)), names)
    axes.locator_params(axis="x", nbins=4)
    axes.tick_params(axis="y", length=0, labelsize=11)
    tidy(axes, "x")


def _levels(axes: "Axes", error: Mapping[str, float]) -> dict[str, Any]:
    """The noise floor and the error expected of a twin that lacks nothing: handles by label."""
    handles = {}
    if np.isfinite(noise := error.get("noise_floor", np.nan)):
        band = axes.axvspan(0, noise, color=INK, alpha=0.16, lw=0, zorder=3)
        handles["noise of the measurement alone"] = band
    if np.isfinite(expected := error.get("expected", np.nan)):
        line = axes.axvline(expected, color=INK, lw=1.2, ls="--", zorder=3)
        handles["a twin that lacks nothing"] = line
    return handles


def ranked(candidates: Sequence[Tried]) -> list[Tried]:
    """Accepted ones first, then the fitted by their gain, then the others by their score."""

    def key(each: Tried) -> tuple[Any, ...]:
        gain = mean_gain(each)[0]
        fitted = np.isfinite(gain)
        return (
            each.verdict != ACCEPTED,
            each.verdict in UNTESTED,
            not fitted,
            -gain if fitted else -each.score,
        )

    return sorted(candidates, key=key)


def mean_gain(tried: Tried) -> tuple[float, float]:
    """Mean gain over held-out segments and half its 95 % interval by Student's t; NaN unfitted."""
    gains = np.array([]) if tried.gain_by_segment is None else tried.gain_by_segment
    gains = gains[np.isfinite(gains)]
    if not gains.size:
        return np.nan, np.nan
    if gains.size == 1:
        return float(gains[0]), np.nan
    half = scipy.special.stdtrit(gains.size - 1, 0.975) * gains.std(ddof=1) / np.sqrt(gains.size)
    return float(gains.mean()), float(half)


def ranking(candidates: Sequence[Tried], unit: str = "mm") -> Figure | None:
    """The score of every candidate, and the held-out gain of those that were fitted."""
    if not candidates:
        return None
    order = ranked(candidates)[:_DRAWN]
    fitted = any(np.isfinite(mean_gain(each)[0]) for each in order)
    lines = max(_label(each).count("\n") for each in order)
    height = 0.34 * len(order) * (1 + 0.45 * lines) + 1.3
    drawing, panels = sheet(9, height, columns=1 + fitted, sharey=True)
    _scores(panels[0], order)
    if fitted:
        _gains(panels[1], order, unit)
    for n, each in enumerate(order):
        _, colour = _VERDICT_STYLE[each.verdict]
        at = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 9.5}
        weight = "bold" if each.verdict == ACCEPTED else "normal"
        panels[-1].annotate(each.verdict, (1.02, n), color=colour, fontweight=weight, **at)
    caption = (
        "Left, the score test: the share of the calibrated residual's squares that a candidate would "
        "remove, to first order. Right, what it brings on held-out segments when fitted together with "
        "all declared parameters: dots are segments, the bar is the mean with its 95 % interval."
    )
    caption = caption if fitted else caption.split(" Right")[0]
    more = " All others are in the table." if len(candidates) > _DRAWN else ""
    return Figure("candidates", drawing, caption + more)


def _label(tried: Tried) -> str:
    return fill(spaced(tried.name), _LABEL)


def _scores(axes: "Axes", order: Sequence[Tried]) -> None:
    for n, each in enumerate(order):
        colour = _VERDICT_STYLE[each.verdict][1]
        faded = 0.35 if each.verdict in UNTESTED else 1.0
        axes.barh(n, 100 * each.score, height=0.6, color=colour, alpha=faded)
    axes.set_yticks(range(len(order)), [_label(each) for each in order])
    axes.set(ylim=(len(order) - 0.4, -0.6), xlim=(0, None), xlabel="score [% of the squares]")
    axes.tick_params(axis="y", length=0)
    for label, each in zip(axes.get_yticklabels(), order, strict=True):
        label.set_fontweight("bold" if each.verdict == ACCEPTED else "normal")
    tidy(axes, "x")


def _gains(axes: "Axes", order: Sequence[Tried], unit: str) -> None:
    axes.axvline(0, color=SOFT, lw=0.8)
    for n, each in enumerate(order):
        mean, half = mean_gain(each)
        marker, colour = _VERDICT_STYLE[each.verdict]
        if not np.isfinite(mean):
            at = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 8.5}
            axes.annotate("not fitted", (0.02, n), color=SOFT, **at)  # wherever zero lies
            continue
        gains = np.asarray(each.gain_by_segment)
        axes.plot(gains, np.full(gains.shape, n), "o", color=colour, alpha=0.25, ms=4, mew=0)
        axes.errorbar(
            mean, n, xerr=np.nan_to_num(half), fmt=marker, color=colour, ms=6, lw=2, capsize=3
        )
    axes.set_xlabel(f"gain on held-out segments [{unit}]")
    axes.margins(x=0.08)
    axes.locator_params(axis="x", nbins=4)  # so that long numbers have room
    axes.tick_params(axis="y", length=0)
    tidy(axes, "x")


def by_feature(twins: Mapping[str, Twin], name: str) -> Figure | None:
    """The residuals of all twins over the features that the first twin's follow most, markers and loads."""
    first = next(iter(twins))
    told = _leading(twins[first][1])
    if not told:
        return None
    pair = len(twins) > 1
    rows, columns = (len(told), len(twins)) if pair else (1, len(told))
    drawing, panels = sheet(9, 3.1 * rows + 0.3, columns, rows)
    for row, dependence in zip(panels.reshape(len(told), -1), told, strict=True):
        clouds = {stage: curve(c, dependence, f.joints) for stage, (c, f) in twins.items()}
        x, y = _span([c.x for c in clouds.values()], 0.003), _span([clouds[first].error], 0.002)
        for axes, (stage, drawn) in zip(row, clouds.items(), strict=True):
            _cloud(axes, drawn, STAGE_COLOUR[stage])
            for edge in dependence.shape.edges:
                axes.axvline(edge * drawn.per_unit, color=INK, lw=1, ls=":")
            axes.set(xlim=x, ylim=y)
            _headed(axes, stage)
        for axes in row[1:]:
            axes.set_ylabel("")
            axes.set_yticklabels([])
    said = "; ".join(d.text for d in told)
    scales = "The same rows on the same scales: points" if pair else "Points"
    dots = " Dotted lines mark the edges found." if any(d.shape.edges for d in told) else ""
    caption = f"With the {first} twin, {said}. {scales} are rows, the line their mean.{dots}"
    return Figure(name, drawing, caption)


def _leading(findings: Findings) -> list[Dependence]:
    """The greatest dependence of the markers and that of the loads, where there are any."""
    of = {d.kind == "load": d for d in reversed(findings.depends_on)}
    return [of[loads] for loads in (False, True) if loads in of]


def _cloud(axes: "Axes", drawn: Curve, colour: str) -> None:
    axes.plot(drawn.x, drawn.error, ".", color=SOFT, ms=3, alpha=0.25, mew=0, rasterized=True)
    axes.fill_between(drawn.middle, drawn.low, drawn.high, color=colour, alpha=0.25, lw=0)
    axes.plot(drawn.middle, drawn.mean, color=colour, lw=2.4)
    axes.axhline(0, color=SOFT, lw=0.8)
    axes.set(xlabel=drawn.x_label, ylabel=drawn.y_label)
    tidy(axes, "y")


def _span(values: Sequence[Array], tail: float) -> tuple[float, float]:
    """Limits that hold all but the tails, with a margin."""
    low, high = np.nanquantile(np.concatenate([v.ravel() for v in values]), [tail, 1 - tail])
    margin = 0.08 * (high - low) or 1.0
    return float(low - margin), float(high + margin)


def place_and_time(twins: Mapping[str, Twin]) -> Figure:
    """The error of each joint or marker over time, with all twins on one scale."""
    drawing, panels = sheet(9, 0.8 + 2.2 * len(twins), columns=1, rows=len(twins))
    twins = {
        stage: (short if found.joints else short.joined, found)
        for stage, (short, found) in twins.items()
    }
    shown = [marker_curve(comparison, found.joints) for comparison, found in twins.values()]
    names, _, label = shown[0]
    cells = [_cells(c, v) for (c, _), (_, v, _) in zip(twins.values(), shown, strict=True)]
    most = max(float(np.nanmax(each)) for each in cells)
    first = next(iter(twins.values()))[0]
    end = cells[0].shape[1] * _cell_rows(first) * first.period
    for axes, picture, stage in zip(panels, cells, twins, strict=True):
        image = axes.imshow(
            picture, aspect="auto", cmap="magma_r", vmin=0, vmax=most, interpolation="nearest",
            extent=(0, end, len(names) - 0.5, -0.5),
        )  # fmt: skip
        _headed(axes, stage)
        axes.set_yticks(np.arange(len(names)), names, fontsize=8.5)
        axes.spines[:].set_visible(False)
        axes.tick_params(colors=SOFT, labelcolor=INK, length=0)
    for axes in panels[:-1]:
        axes.set_xticklabels([])
    panels[-1].set_xlabel("time over all held-out segments [s]")
    bar = drawing.colorbar(image, ax=list(panels), pad=0.01, aspect=20 * len(twins))
    bar.set_label(label)
    bar.outline.set_visible(False)  # pyright: ignore
    scale = ", on one scale" if len(twins) > 1 else ""
    marker = next(iter(twins.values()))[0].marker
    caption = f"{marker.across} and when {marker.are} off{scale}: darker is more."
    return Figure("place_and_time", drawing, caption)


def _headed(axes: "Axes", stage: str) -> None:
    axes.set_title(stage, loc="left", fontsize=10, color=STAGE_COLOUR[stage], fontweight="bold")


def _cells(comparison: Comparison, values: Array) -> Array:
    """Root mean squares over a few seconds, (K, cells), of values (S, T, K), segments in order."""
    rows = _cell_rows(comparison)
    pieces = values.shape[1] // rows
    cut = values[:, : pieces * rows].reshape(len(values), pieces, rows, values.shape[2])
    order = np.lexsort((comparison.start, np.array(comparison.session)))
    return np.sqrt(np.mean(cut[order] ** 2, axis=2)).reshape(-1, values.shape[2]).T


def _cell_rows(comparison: Comparison) -> int:
    """Rows of a cell of the heat map: a few seconds, but no more than a segment."""
    return min(max(1, round(_HEAT_S / comparison.period)), comparison.time.shape[1])
