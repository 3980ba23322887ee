"""Write how near arms keep to paths as a page."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from experiments.follow.over_device import SLOW
from experiments.follow.paths import PATHS, SPEED
from experiments.follow.trial import (
    EACH,
    FIRST,
    GEOMETRY,
    LOADED,
    LOADED_OPEN,
    MENDED,
    NOMINAL,
    RATE,
    RATES,
    WAYS,
    WEIGHED,
    WEIGHED_LOADED,
    rms,
)
from experiments.result_page import PageContent, failures
from serpent_twin.arrays import Array
from serpent_twin.live.path_picture import drawn
from serpent_twin.numerals import counted
from serpent_twin.runs.plot_style import COLOURS, finish, sheet
from serpent_twin.runs.report import Figure, Section, Table

_AIM = 3.0
"""[mm] rms"""
_MEDIANS = "Error [mm rms], the median over the arms and, in brackets, the greatest."


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    rows = results["rows"]
    text = (
        "The last table says what nobody had declared of each arm. Its twin is what `trace` wrote from its "
        f"logs. The tip goes along each path at {1e3 * SPEED:.0f} mm/s, in {RATE:g} control steps a second "
        "and without a camera in the loop; errors are distances of the true tip, the gripper's end, from "
        "where it was to be at that instant. "
        "*Geometry* turns the motors as stiff cables would need it. The twins' ways turn them as rehearsed "
        "on a twin: the nominal one, or the arm's own. *Feedback* adds what the observer says that the "
        "joints lack."
    )
    refused = {
        f"{row['id']}, {path}": why for row in rows for path, why in row.get("refused", {}).items()
    }
    device = results.get("device")
    return PageContent(
        "Following paths",
        "python -m experiments.follow --study STUDY",
        f"{counted(len(rows), 'arm')} of `bench_arm`, which shares no physics with the twin",
        (
            Section("", text, (_on_path(_middle(rows)), _by_path(rows), _drawn(rows))),
            Section("By rate", _said(rows), (_rates(rows),)),
            *([Section("Over the wire", _OVER_DEVICE, (device_table(device),))] if device else []),
            Section("A mass taken up on the way", _LOADED, (_loaded(rows),)),
            Section("Arms", "", (_arms(rows),)),
            *failures("Paths that were refused", {"failed": results["failed"] | refused}),
        ),
    )


_LOADED = (
    "Half-way along the figure of eight the gripper takes up 50 g, a sixth of the arm's mass, of which "
    "neither rehearsal nor observer knows. Errors are those of the second half. The observer follows the "
    "motors' angles alone, and these do not show the mass. *Weighing* lets the weighing observer, trained on "
    "the arm's logs, estimate instead: it follows the mass by the loads. At this speed motors turn slowly or "
    "not at all, and the load of one that stands lies anywhere within its gear's friction, so that it takes "
    "time; and where nothing is taken up, some grams that are felt by mistake cost as many millimetres."
)


_OVER_DEVICE = (
    "`follow --backend real` in real time, with feedback, on the [emulator](../emulator.md) that simulates "
    "one arm's own twin: packets take their time at 1 MBd, and cameras stream at 120 Hz, whose markers "
    "steer nothing. A deadline is missed where a control step takes longer than its period."
)


def device_table(found: Mapping[str, Any]) -> Table:
    """What was stated of each rate over the wire."""

    def unless_slow(form: str) -> Callable[[Mapping[str, Any]], str]:
        return lambda of: "—" if SLOW in of else form.format_map(of)

    columns = {
        "Hz": "{rate}",
        "marker 9 as measured [mm rms]": unless_slow("{marker9_error_mm[rms]:.1f}"),
        "tip as estimated [mm rms]": unless_slow("{tip_error_as_estimated_mm[rms]:.1f}"),
        "reading to estimate [ms]": unless_slow("{latency_ms[median]:.1f}"),
        "its 99th percentile [ms]": unless_slow("{latency_ms[p99]:.1f}"),
        "missed deadlines": lambda of: (
            f"stopped: {of[SLOW]:.3g} steps a second"
            if SLOW in of
            else "{missed_deadlines} of {rows}".format_map(of)
        ),
    }
    return Table.of(({"rate": rate} | dict(of) for rate, of in found.items()), columns)


def _by_path(rows: Sequence[Any]) -> Table:
    """Medians over the arms, and the greatest."""

    def errors(path: str, way: str) -> Array:
        return rms(rows, path, way)

    columns = {
        "path": str,
        "arms": lambda path: str(errors(path, MENDED).size),
        **{way: lambda path, way=way: _median_and_most(errors(path, way)) for way in WAYS},
        "its twin to geometry": lambda path: (
            f"{np.median(errors(path, MENDED) / errors(path, GEOMETRY)):.3f}"
        ),
    }
    return Table.of((path for path in PATHS if errors(path, MENDED).size), columns, _MEDIANS)


def _median_and_most(errors: Array) -> str:
    return f"{np.median(errors):.1f} ({errors.max():.1f})"


def _middle(rows: Sequence[Any]) -> Mapping[str, Any]:
    """The row of the arm whose error by its own twin on the first path is the median, or just below."""
    errors = rms(rows, FIRST, MENDED)
    return rows[int(np.argsort(errors, kind="stable")[(len(rows) - 1) // 2])]


def _on_path(row: Mapping[str, Any]) -> Figure:
    """Where one arm's tip truly was."""
    wanted, ways = np.array(row["wanted"]), row["paths"][FIRST]
    tips = {way: np.array(ways[way]["tip"]) for way in (GEOMETRY, NOMINAL, MENDED)}
    drawing = drawn(np.arange(len(wanted)) * EACH / RATE, wanted, tips)
    kind = row["name"].replace("_", " ")
    caption = (
        f"Where the tip of an arm truly was on the {FIRST}; by its own twin it was as far off as the middle "
        f"one of all. What nobody declared: {kind}."
    )
    return Figure("follow_path", drawing, caption)


def _drawn(rows: Sequence[Any]) -> Figure:
    drawing, (axes,) = sheet(7.0, 3.2)
    for n, way in enumerate(WAYS):
        errors = np.sort(rms(rows, FIRST, way))
        across = n + np.linspace(-0.2, 0.2, len(errors)) * (len(errors) > 1)
        axes.plot(across, errors, "o", color=COLOURS[n + 1], ms=5)
    axes.axhline(_AIM, color=COLOURS[0], lw=1.0, ls="--")
    axes.set_yscale("log")
    axes.set_xticks(range(len(WAYS)), WAYS)
    axes.set_ylabel("error of the tip [mm rms]")
    finish(drawing, axes, legend=False)
    caption = f"Every arm on the {FIRST}; the dashed line is the aim of {_AIM:g} mm."
    return Figure("follow", drawing, caption)


def _said(rows: Sequence[Any]) -> str:
    fastest = f"{RATES[-1]:g}"
    median = np.median([row["rates"][fastest]["median_ms"] for row in rows])
    worst = np.max([row["rates"][fastest]["p99_ms"] for row in rows])
    return (
        f"The figure of eight with feedback. At {fastest} Hz an estimate takes {median:.1f} ms, its 99th "
        f"percentile {worst:.1f} ms on the slowest arm, on one core that may have had other work."
    )


def _rates(rows: Sequence[Any]) -> Table:
    def of(rate: float, what: str) -> Array:
        return np.array([row["rates"][f"{rate:g}"][what] for row in rows])

    columns = {
        "Hz": lambda rate: f"{rate:g}",
        "median [mm rms]": lambda rate: f"{np.median(of(rate, 'rms')):.1f}",
        "greatest [mm rms]": lambda rate: f"{of(rate, 'rms').max():.1f}",
        "estimate [ms]": lambda rate: f"{np.median(of(rate, 'median_ms')):.1f}",
    }
    return Table.of(RATES, columns)


def _loaded(rows: Sequence[Any]) -> Table:
    def cell(way: str, of: str) -> str:
        return _median_and_most(np.array([row["loaded"][way][of] for row in rows]))

    columns = {
        "way": str,
        "error": lambda way: cell(way, "rms"),
        "in the last sixth of the path": lambda way: cell(way, "last_rms"),
    }
    return Table.of((LOADED_OPEN, LOADED, WEIGHED_LOADED, WEIGHED), columns, _MEDIANS)


def _arms(rows: Sequence[Any]) -> Table:
    def mean(row: Any, way: str) -> str:
        return f"{np.mean([of[way]['rms'] for of in row['paths'].values()]):.1f}"

    columns = {"what nobody declared": lambda row: row["name"].replace("_", " ")}
    columns |= {way: partial(mean, way=way) for way in WAYS}
    return Table.of(rows, columns, "Mean over the paths that were not refused [mm rms].")
