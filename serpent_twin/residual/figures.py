"""Draw the error."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.findings import Findings
from serpent_twin.residual.noise import expected_distance
from serpent_twin.residual.size import MOVING, load_size, marker_size
from serpent_twin.residual.spectrum import spectrum
from serpent_twin.residual.whiteness import Whiteness
from serpent_twin.runs.plot_style import COLOURS, INK, LINE, SOFT, finish, sheet, smooth, tidy
from serpent_twin.runs.report import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAP_S = 20.0  # drawn between sessions
_FAR_APART = 8.0  # times
_MEAN_S, _MEANS = 3.0, 10  # of the error in the course of time [s]; so many at least in a stretch
_LABELS = 20  # channels of a residual that are named
_GAP_ROWS = 1.5  # from which on a line is broken
_ABREAST, _UPRIGHT = 60, 30  # letters of all sessions' names, and names, for which there is room


def figures(
    comparisons: Mapping[str, Comparison], findings: Findings, moving_above: float = MOVING
) -> tuple[Figure, ...]:
    """Figures for named comparisons of the same rows; findings are those of the last one."""
    last = list(comparisons.values())[-1]
    drawn: list[Figure] = []
    if last.has_markers:
        drawn += [_by_marker(comparisons, findings), _over_time(comparisons, findings)]
    if last.has_loads:
        drawn.append(_by_motor(comparisons, findings, moving_above))
    if last.has_markers:
        drawn.append(_spectrum(comparisons, findings))
    return tuple(drawn)


def whiteness(found: Whiteness) -> Figure | None:
    """Autocorrelations of all channels, and their strongest correlation with an input; None without any."""
    if not found.channels:
        return None
    drawing, (left, right) = sheet(9, 3.9, columns=2)
    rho = np.array([each.autocorrelation[1:] for each in found.channels])
    end = (found.lags + 0.5) * found.period
    image = left.imshow(
        rho, aspect="auto", cmap="RdBu_r", vmin=-1, vmax=1, interpolation="nearest",
        extent=(0.5 * found.period, end, len(rho) - 0.5, -0.5),
    )  # fmt: skip
    left.set_xlabel("lag [s]")
    left.locator_params(axis="x", nbins=5)
    every = -(-len(rho) // _LABELS)
    names = [each.name for each in found.channels][::every]
    left.set_yticks(range(0, len(rho), every), names, fontsize=7)
    left.tick_params(colors=SOFT, labelcolor=INK, length=0)
    bar = drawing.colorbar(image, ax=left, pad=0.01)
    bar.set_label("autocorrelation")
    bar.outline.set_visible(False)  # pyright: ignore
    for n, each in enumerate(found.channels):
        right.barh(n, abs(each.correlation), height=0.7, color=COLOURS[2 if each.follows else 0])
        right.plot([each.input_bound] * 2, [n - 0.4, n + 0.4], color=INK, lw=1)
    right.set(
        ylim=(len(rho) - 0.5, -0.5), xlim=(0, 1), xlabel="strongest correlation with an input"
    )
    right.set_yticks([])
    tidy(right, "x")
    caption = (
        "Left, the autocorrelation of each channel of the residual: white noise has none. Right, its "
        f"strongest correlation with {found.inputs} at any lag; the mark is what chance reaches in one case "
        "of 20."
    )
    return Figure("whiteness", drawing, caption)


def _by_marker(comparisons: Mapping[str, Comparison], findings: Findings) -> Figure:
    """Mean distance of each marker, and the noise."""
    drawing, (axes,) = sheet(9, 3.9)
    names = next(iter(comparisons.values())).marker_names
    at = np.arange(len(names))
    measure = next(iter(comparisons.values())).marker
    style = _line(names, measure.one)
    for (name, comparison), colour in zip(comparisons.items(), _colours(comparisons), strict=True):
        mean = marker_size(comparison).by_marker
        axes.plot(at, mean, style, color=colour, lw=2, ms=6, label=name)
    floor = measure.scale * expected_distance(findings.noise.marker, measure.dimension)
    _floor(axes, at, floor, style)
    axes.set_ylabel(f"{measure.size} [{measure.unit}]")
    _millimetres(axes, comparisons, findings)
    _label(axes, at, names, measure.one)
    axes.margins(x=0.02)
    finish(drawing, axes)
    size = f"{measure.size[0].upper()}{measure.size[1:]}"
    caption = f"{size}, measured against predicted{measure.order}."
    return Figure("error_by_marker", drawing, caption)


def _millimetres(axes: "Axes", comparisons: Mapping[str, Comparison], findings: Findings) -> None:
    """A scale on which every twin's error can be read: logarithmic where they are far apart."""
    means = [marker_size(comparison).mean for comparison in comparisons.values()]
    if min(means) <= 0 or max(means) < _FAR_APART * min(means):
        axes.set_ylim(0, None)
        return
    axes.set_yscale("log")
    floor = findings.noise.mean_floor
    axes.set_ylim(0.5 * min(floor if floor > 0 else np.inf, *means), None)


def _over_time(comparisons: Mapping[str, Comparison], findings: Findings) -> Figure:
    """Distance averaged over markers, sessions one after another."""
    drawing, (axes,) = sheet(9, 3.9)
    first = next(iter(comparisons.values()))
    clock, zero = _one_after_another(first)
    stretches = _stretches(first)
    rows = _window(first, stretches)
    for (name, comparison), colour in zip(comparisons.items(), _colours(comparisons), strict=True):
        error = marker_size(comparison).by_row
        for n, those in enumerate(stretches):
            then = clock[those].ravel()
            order = np.argsort(then, kind="stable")  # segments may overlap by some rows
            mean = smooth(error[those].ravel()[order], rows)
            axes.plot(then[order], mean, color=colour, lw=1.3, label=None if n else name)
    if np.isfinite(floor := findings.noise.mean_floor):
        axes.axhspan(0, floor, color=LINE, lw=0, label="noise of the measurement")
    jump = findings.marker_change.jump if findings.marker_change else None
    if jump is not None and findings.marker_change and findings.marker_change.steady == "jump":
        axes.axvline(zero[jump.session] + jump.time_s, color=INK, lw=1, ls=":")
    _name_sessions(axes, clock, first.session)
    over = f", mean over {rows * first.period:.2g} s" if rows > 1 else ""
    label = f"{first.marker.one} error{over} [{first.marker.unit}]"
    axes.set(xlabel="time [s]", ylabel=label)
    _millimetres(axes, comparisons, findings)
    axes.margins(x=0)
    finish(drawing, axes)
    caption = f"{first.marker.size.capitalize()} in the course of the sessions."
    return Figure("error_over_time", drawing, caption)


def _name_sessions(axes: "Axes", clock: Array, session: Sequence[str]) -> None:
    """Each session's name above where it begins, upright where names would meet; of very many, some."""
    begins = dict(zip(reversed(session), reversed(clock[:, 0]), strict=True))
    if len(begins) == 1:
        return
    upright = sum(map(len, begins)) > _ABREAST
    for name, begin in list(begins.items())[:: -(-len(begins) // _UPRIGHT)]:
        axes.annotate(
            name.removesuffix(".parquet"),
            (begin, 1.01),
            xycoords=("data", "axes fraction"),
            color=SOFT,
            fontsize=9,
            rotation=90 if upright else 0,
        )


def _by_motor(
    comparisons: Mapping[str, Comparison], findings: Findings, moving_above: float
) -> Figure:
    """Load error of each motor, in motion and at rest."""
    sizes = {name: load_size(each, moving_above) for name, each in comparisons.items()}
    states = {"in motion": "moving", "at rest": "resting"}
    if not any(np.isfinite(size.resting).any() for size in sizes.values()):
        del states["at rest"]
    drawing, panels = sheet(9, 3.7, columns=len(states), sharey=True)
    panels = np.atleast_1d(panels)
    measure = next(iter(comparisons.values())).load
    names = next(iter(comparisons.values())).load_names
    of_motors = names == next(iter(comparisons.values())).motor_names
    at, style = np.arange(len(names)), _line(names, "motor")
    for (name, size), colour in zip(sizes.items(), _colours(comparisons), strict=True):
        for axes, state in zip(panels, states.values(), strict=True):
            axes.plot(at, getattr(size, state), style, color=colour, lw=2, ms=6, label=name)
    for axes, title in zip(panels, states, strict=True):
        floor = measure.scale * findings.noise.load
        _floor(axes, at, floor, style)
        if of_motors:
            axes.set_title(title, loc="left", fontsize=10, color=SOFT)
        axes.set_ylim(0, None)
        _label(axes, at, names, "motor" if of_motors else "measured at")
    panels[0].set_ylabel(f"{measure.size} [{measure.unit}]")
    for axes in panels[1:]:
        finish(drawing, axes, legend=False)
    finish(drawing, panels[0])
    caption = f"Load error by motor; in motion is above {moving_above:g} rad/s."
    if not of_motors:
        caption = f"Error of each {measure.one}."
    return Figure("load_error_by_motor", drawing, caption)


def _spectrum(comparisons: Mapping[str, Comparison], findings: Findings) -> Figure:
    """Power of the marker residual by frequency."""
    drawing, (axes,) = sheet(9, 3.7)
    for (name, short), colour in zip(comparisons.items(), _colours(comparisons), strict=True):
        comparison = short.joined
        values = comparison.marker.scale * comparison.marker_residual.reshape(
            *comparison.time.shape, -1
        )
        frequency, power = spectrum(values, comparison.period)
        axes.semilogy(frequency[1:-1], power[1:-1], color=colour, lw=1.8, label=name)
    last = list(comparisons.values())[-1]
    measure = last.marker
    level = 2 * last.period * measure.dimension * measure.scale**2
    level *= float(np.sum(findings.noise.marker**2))
    if np.isfinite(level):
        axes.axhline(level, color=SOFT, lw=1, ls="--", label="noise of the measurement")
    change = findings.marker_change
    if change and change.swings and change.line:
        axes.axvline(change.line.frequency_hz, color=INK, lw=1, ls=":")
        text = f"  {change.line.frequency_hz:.2f} Hz"
        axes.annotate(text, (change.line.frequency_hz, 0.93), xycoords=("data", "axes fraction"))
    axes.set(xlabel="frequency [Hz]", ylabel=f"power [{measure.unit}²/Hz]")
    axes.margins(x=0)
    finish(drawing, axes)
    caption = f"Spectrum of the {measure.one} residual, all coordinates added up."
    return Figure("residual_spectrum", drawing, caption)


def _colours(names: Mapping[str, Any]) -> Sequence[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(len(names))]


def _one_after_another(comparison: Comparison) -> tuple[Array, dict[str, float]]:
    """Times of all rows (S, T) [s] with the sessions in a row, and where each session's time 0 lies."""
    starts: dict[str, float] = {}
    clock, end = comparison.time.astype(float).copy(), 0.0
    for name in dict.fromkeys(comparison.session):
        own = np.array([s == name for s in comparison.session])
        starts[name] = end - comparison.time[own].min() if starts else 0.0
        clock[own] += starts[name]
        end = clock[own].max() + GAP_S
    return clock, starts


def _line(names: Sequence[str], word: str) -> str:
    """Points, joined where names are a word and a number: along a chain, neighbours are neighbours."""
    return "o-" if all(name.startswith(f"{word} ") for name in names) else "o"


def _floor(axes: "Axes", at: np.ndarray, floor: Array, style: str) -> None:
    """The noise at each place: a band where places are joined, else a bar at each."""
    if "-" in style:
        axes.fill_between(at, 0, floor, color=LINE, lw=0, label="noise of the measurement")
    else:
        axes.bar(at, floor, 0.5, color=LINE, label="noise of the measurement", zorder=0)


def _stretches(comparison: Comparison) -> list[list[int]]:
    """Segments that follow each other without a gap, in the order of time, session by session."""
    found: list[list[int]] = []
    for name in dict.fromkeys(comparison.session):
        own = [n for n, session in enumerate(comparison.session) if session == name]
        end = -np.inf
        for n in sorted(own, key=lambda n: comparison.start[n]):
            if comparison.start[n] - end > _GAP_ROWS * comparison.period:
                found.append([])
            found[-1].append(n)
            end = comparison.time[n, -1]
    return found


def _window(comparison: Comparison, stretches: Sequence[Sequence[int]]) -> int:
    """Rows over which an error is averaged: 3 s, but no more than a share of the longest stretch."""
    longest = max(map(len, stretches)) * comparison.time.shape[1]
    return max(1, min(round(_MEAN_S / comparison.period), longest // _MEANS))


def _label(axes: "Axes", at: np.ndarray, names: Sequence[str], word: str) -> None:
    """Label with numbers where names are a word and a number, else with slanted names."""
    if all(name.startswith(f"{word} ") for name in names):
        axes.set_xticks(at, [name.removeprefix(f"{word} ") for name in names])
        axes.set_xlabel(word)
    else:
        axes.set_xticks(at, names, rotation=30, ha="right")
