"""Write docs/results/how-often-right.md."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from experiments.confusion.page import RIGHT, WRONG, counts_drawing
from experiments.confusion.score import quantity
from experiments.result_page import PageContent
from serpent_twin.numerals import counted
from serpent_twin.reporting.plot_style import INK, label_logarithmic, tidy
from serpent_twin.reporting.report import Figure, Section, Table

_TEXT = """Every arm is another one of `bench_arm`, whose cable law, integration and servo model
the twin does not share. Its fault, that fault's strength and place, and all other numbers are drawn. The last
session of each arm judged its trace. Lines of all arms, those whose trace failed included, are in
`how-often-right.csv` beside this page; only those of one version of the project are counted together. In
brackets, 95 % intervals."""
_LIMITS = """The limit is the strength from which on a logistic curve over the arms has 90 % named
right: this effect and no other. It is a number only where it lies within the strengths tried. Sessions
include the one that judged."""
_COMPOSED = """Discovered is a fault whose law, and its place, was composed, or is among those that the report
calls equivalent, and nothing else. What was left before and after is in errors of a complete twin; it and how
far the law's size was off are medians over the arms on which it was discovered.

What a fault's law was worth is computed since seed 34: by how many squared standard errors (σ²) the true law,
with its true thresholds and to first order, would have explained the training logs better than the calibrated
twin did. From 30 on, a trace would try it where little is left."""
_COLUMNS = 4
_MARKS = ("o", "s", "^", "D", "v")


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    sections = [Section("", _TEXT, (_rates(results),))]
    if results["effects"]:
        sections.append(
            Section("From which strength on", _LIMITS, (_dots(results), _effects(results)))
        )
    if results["outside"]:
        sections.append(Section("What no catalogue lists", _COMPOSED, (_outside(results),)))
    sections.append(Section("What was there, and what was called", "", (_matrix(results),)))
    sections.append(Section("By commit", "", (_commits(results),)))
    data = f"{counted(results['arms'], 'arm')} of `bench_arm`, version {results['versions_of_lines'][0]}"
    command = "python -m experiments.how_often_right"
    return PageContent("How often it is right", command, data, tuple(sections))


def _rates(results: Mapping[str, Any]) -> Table:
    lines = [(name, of["aim"], of["said"]) for name, of in results["rates"].items()]
    if results["median_seconds"]:
        lines.append(("median of a trace's time", "", f"{results['median_seconds']:.0f} s"))
    return Table(("", "aim", "found"), tuple(lines))


def _effects(results: Mapping[str, Any]) -> Table:
    lines = []
    for each in results["effects"]:
        off = f"{each['median_off']:.0%}" if each["median_off"] is not None else ""
        name = each["effect"].replace("_", " ")
        lines.append((name, str(each["sessions"]), each["said"], each["right"], off, each["held"]))
    head = (
        "effect",
        "sessions",
        "detection limit",
        "named right",
        "off, median",
        "in its interval",
    )
    return Table(head, tuple(lines))


def _outside(results: Mapping[str, Any]) -> Table:
    def number(value: float | None, form: str) -> str:
        return "" if value is None else format(value, form)

    lines = [
        (
            each["fault"].replace("_", " "),
            f"{each['discovered']['count']} of {each['discovered']['of']}",
            str(each["unexplained"]),
            number(each["median_off"], ".0%"),
            number(each["before"], ".2f"),
            number(each["after"], ".2f"),
        )
        for each in results["outside"]
    ]
    head = ("fault", "discovered", "called unexplained", "size off", "left before", "left after")
    return Table(head, tuple(lines))


def _dots(results: Mapping[str, Any]) -> Figure:
    """A dot for every arm over its fault's strength: right above, wrong below, by number of sessions."""
    names = sorted({name for name, *_ in results["trials"]})
    numbers = sorted({sessions for *_, sessions in results["trials"]})
    height = -(-len(names) // _COLUMNS)
    drawing = Drawing(figsize=(11, 1.6 * height), layout="constrained")
    for k, name in enumerate(names):
        axes, some = drawing.add_subplot(height, _COLUMNS, k + 1), _of(results, name)
        for n, sessions in enumerate(numbers):
            for good, colour in ((True, RIGHT), (False, WRONG)):
                at = [s for s, _, right, of in some if right == good and of == sessions]
                level = float(good) + 0.15 * (n - (len(numbers) - 1) / 2)
                mark = _MARKS[n % len(_MARKS)]
                axes.plot(at, np.full(len(at), level), mark, color=colour, alpha=0.6, mew=0)
        axes.set(xscale="log", ylim=(-0.5, 1.5), xlabel=some[0][1] if some[0][1] != "1" else "")
        axes.set_yticks([0, 1], ["wrong", "right"])
        axes.set_title(name.replace("_", " "), loc="left", fontsize=9)
        label_logarithmic(axes)
        tidy(axes, grid=None, labelsize=8)
    told = ", ".join(f"{mark} {n}" for mark, n in zip("●■▲◆▼", numbers, strict=False))
    note = f"Every arm with one effect of the catalogue; marks by its number of sessions: {told}."
    return Figure("how_often_right", drawing, note)


def _of(results: Mapping[str, Any], name: str) -> list[tuple[float, str, bool, int]]:
    """Strength, unit, whether it was named right, and sessions of each arm with an effect."""
    return [(s, unit, right, n) for there, s, unit, right, n in results["trials"] if there == name]


def _matrix(results: Mapping[str, Any]) -> Figure:
    there = sorted(
        {there for there, *_ in results["called"]}, key=lambda name: (name == "none", name)
    )
    called = sorted(
        {said for _, said, _ in results["called"]}, key=lambda name: (name not in there, name)
    )
    counts = np.zeros((len(there), len(called)))
    for a, b, count in results["called"]:
        counts[there.index(a), called.index(b)] = count
    drawing = counts_drawing(there, called, counts, lambda *_: INK)
    return Figure("taken_for", drawing, "Numbers of arms with one fault or none.")


def _commits(results: Mapping[str, Any]) -> Table:
    lines = tuple(
        (
            each["commit"],
            str(each["arms"]),
            each["right"],
            each["false_alarms"],
            quantity(each["seconds"], "s") if each["seconds"] else "",
        )
        for each in results["commits"]
    )
    return Table(("commit", "arms", "right", "false alarms", "median time"), lines)
