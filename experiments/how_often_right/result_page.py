"""Write docs/results/how-often-right.md."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from experiments.confusion.result_page import RIGHT, WRONG, counts_drawing
from experiments.confusion.score import quantity
from experiments.how_often_right.rates import NAMED, STRONG
from experiments.result_page import PageContent
from serpent_twin.identification.wording import spaced
from serpent_twin.numerals import counted
from serpent_twin.runs.plot_style import INK, label_logarithmic, tidy
from serpent_twin.runs.report import Figure, Section, Table

_TEXT = """Every arm is another one of `bench_arm`, whose cable law, integration and servo model
the twin does not share. Its fault, that fault's strength and place, and all other numbers are drawn. The last
session of each arm judged its trace. Lines of all arms, those whose trace failed included, are in
`how-often-right.csv` beside this page; only those of one version of the project are counted together. Arms as
built are those whose links, axes and cameras are off as well; those of all other arms are exactly as drawn.
The lines of earlier traces are kept as they were, and later versions do better. The last column shows best
how good the program is now. In brackets, 95 % intervals."""
_LIMITS = """Every trace states, for each effect, the strength from which on it would be accepted: the
detection limit, computed from that arm's own logs before any search. The table has its median, the effect
present or not. Limits and what is counted in them are of arms since limits are what a fit cannot take up;
before, they were stated to first order, and promised too much. Of the effect that an arm has, the limit is
for the true values of its other parameters, such as the grip of a clamp. Right is an arm on which this effect
was named and no other. Sessions include the one that judged."""
_COMPOSED = """Discovered is a fault whose law, and its place, was composed, or is among those that the report
calls equivalent, and nothing else. What was left before and after is in errors of a complete twin; it and how
far the law's size was off are medians over the arms on which it was discovered.

What a fault's law was worth was computed from seed 34 on: by how many squared standard errors (σ²) the true
law, with its true thresholds and to first order, would have explained the training logs better than the
calibrated twin did. From 30 on, a trace would try it where little is left."""
_MARKS = ("o", "s", "^", "D", "v")


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    sections = [Section("", _TEXT, (_rates(results),))]
    if results["effects"]:
        sections.append(
            Section("From which strength on", _LIMITS, (*_dots(results), _effects(results)))
        )
    if results["outside"]:
        sections.append(Section("What no catalogue lists", _COMPOSED, (_outside(results),)))
    sections.append(Section("What was there, and what was called", "", (_matrix(results),)))
    sections.append(Section("By commit", "", (_commits(results),)))
    data = f"{counted(results['arms'], 'arm')} of `bench_arm`, version {results['versions_of_lines'][0]}"
    command = "python -m experiments.how_often_right"
    return PageContent("How often it is right", command, data, tuple(sections))


def _rates(results: Mapping[str, Any]) -> Table:
    of_last = {"aim": "", "as_built_said": "", "last_said": ""}
    from_where = f"stated detection limits from which on {100 * NAMED:.0f} % are named"
    rows = [{"name": name, **of} for name, of in results["rates"].items()]
    rows.append(of_last | {"name": from_where, "aim": "1", "said": results["named_from"]})
    if seconds := results["median_seconds"]:
        rows.append(of_last | {"name": "median of a trace's time", "said": f"{seconds:.0f} s"})
    columns = {
        "": "{name}",
        "aim": "{aim}",
        "all": "{said}",
        f"{results['as_built']} as built": "{as_built_said}",
        f"the {results['last']} traced last": "{last_said}",
    }
    return Table.of(rows, columns)


def _effects(results: Mapping[str, Any]) -> Table:
    def limit(each: Mapping[str, Any], sessions: str) -> str:
        at = each["stated"][sessions]
        return quantity(at, each["unit"]) if at else ""

    columns: dict[str, Any] = {"effect": lambda each: spaced(each["effect"])}
    for number in results["effects"][0]["stated"]:
        columns[f"limit, {number} sessions"] = partial(limit, sessions=number)
    columns |= {
        "named right": "{right}",
        "from twice its limit on": "{strong}",
        "off, median": lambda each: _number(each["median_off"], ".0%"),
        "in its interval": "{held}",
    }
    return Table.of(results["effects"], columns)


def _outside(results: Mapping[str, Any]) -> Table:
    columns = {
        "fault": lambda each: spaced(each["fault"]),
        "discovered": "{discovered[count]} of {discovered[of]}",
        "called unexplained": "{unexplained}",
        "size off": lambda each: _number(each["median_off"], ".0%"),
        "left before": lambda each: _number(each["before"], ".2f"),
        "left after": lambda each: _number(each["after"], ".2f"),
    }
    return Table.of(results["outside"], columns)


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def _dots(results: Mapping[str, Any]) -> tuple[Figure, ...]:
    """A dot for every arm over its effect's strength in detection limits, by number of sessions."""
    if not results["trials"]:
        return ()
    names = sorted({name for name, *_ in results["trials"]}, reverse=True)
    numbers = sorted({sessions for *_, sessions in results["trials"]})
    drawing = Drawing(figsize=(9, 1.2 + 0.32 * len(names)), layout="constrained")
    axes = drawing.add_subplot()
    for name, times, right, sessions in results["trials"]:
        mark = _MARKS[numbers.index(sessions) % len(_MARKS)]
        colour = RIGHT if right else WRONG
        axes.plot(times, names.index(name), mark, color=colour, alpha=0.7, mew=0)
    for times in (1.0, STRONG):
        axes.axvline(times, color=INK, lw=0.8, ls="--" if times == 1.0 else "-")
    axes.set(
        xscale="log", xlabel="strength in stated detection limits", ylim=(-0.6, len(names) - 0.4)
    )
    axes.set_yticks(range(len(names)), [*map(spaced, names)])
    label_logarithmic(axes)
    tidy(axes, grid="y", labelsize=8)
    told = ", ".join(f"{mark} {n}" for mark, n in zip("●■▲◆▼", numbers, strict=False))
    note = (
        "Each mark is an arm with one effect of the catalogue, green if that effect alone was named, else "
        f"red. Shapes show the number of sessions: {told}."
    )
    return (Figure("how_often_right", drawing, note),)


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
    columns = {
        "commit": "{commit}",
        "arms": "{arms}",
        "right": "{right}",
        "false alarms": "{false_alarms}",
        "median time": lambda each: quantity(each["seconds"], "s") if each["seconds"] else "",
    }
    return Table.of(results["commits"], columns)
