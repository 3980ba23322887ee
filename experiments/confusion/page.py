"""Write the report of the confusion experiment."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from experiments.confusion.plan import CLEAN, KNOWN, OUTSIDE, PAIR
from experiments.confusion.score import (
    Limit,
    Row,
    Share,
    called,
    coverage,
    discovered,
    limits,
    matrix,
    quantity,
    right,
    share,
    within,
)
from serpent_twin.arrays import Array
from serpent_twin.numerals import counted
from serpent_twin.reporting.plot_style import COLOURS, INK, label_logarithmic, tidy
from serpent_twin.reporting.report import Figure, Report, Section, Table

RIGHT, WRONG = COLOURS[3], COLOURS[2]


def page(rows: Sequence[Row], figures: Mapping[str, Any], facts: Mapping[str, str]) -> Report:
    """The report over all rows."""
    found = limits(rows)
    sections = list[Section]()
    if any(row["kind"] != PAIR for row in rows):
        matrices = _picture(rows), _counts(rows)
        sections.append(Section("What was there, and what was called", _MATRIX, matrices))
    sections.append(Section("How the aims are met", "", (aims_table(rows, figures),)))
    if found:
        sections.append(
            Section("How weak a fault is noticed", _LIMITS, (_curves(found), limits_table(found)))
        )
    sections.append(Section("How good the strengths are", "", (strengths_table(rows),)))
    if others := [r for r in rows if r["kind"] in (PAIR, OUTSIDE)]:
        sections.append(Section("Pairs, and what the catalogue lacks", "", (arms_table(others),)))
    if bad := [r for r in rows if r["kind"] in (CLEAN, KNOWN) and not right(r)]:
        sections.append(
            Section("Every arm of the catalogue that was called wrongly", "", (arms_table(bad),))
        )
    return Report(
        f"What the trace confuses, over {counted(len(rows), 'arm')}",
        _lead(rows),
        tuple(sections),
        facts,
    )


_MATRIX = (
    "Each row is one fault, each column what the trace said of arms that had it and nothing else. "
    "Strengths from far below to above what is typical are counted together."
)
_LIMITS = (
    "The limit is the strength at which a logistic curve over the trials reaches 95 % named right: the "
    "fault alone, and no other beside it. It is a number only where it lies within the strengths tried."
)


def _lead(rows: Sequence[Row]) -> str:
    by = {kind: [r for r in rows if r["kind"] == kind] for kind in (CLEAN, KNOWN, PAIR, OUTSIDE)}
    parts = [f"{counted(len(rows), 'arm was', 'arms were')} traced."]
    if by[CLEAN]:
        parts.append(f"False alarms in clean arms: {share(by[CLEAN], lambda r: r['named'])}.")
    if by[KNOWN]:
        parts.append(f"One effect alone, named right at any strength: {share(by[KNOWN], right)}.")
    if by[PAIR]:
        parts.append(f"Pairs named right: {share(by[PAIR], right)}.")
    if by[OUTSIDE]:
        parts.append(
            f"Faults outside the catalogue discovered: {share(by[OUTSIDE], discovered)}; discovered or "
            f"called unexplained: {share(by[OUTSIDE], right)}."
        )
    parts.append(f"True strength within its 95 % interval: {coverage(rows)['all']}.")
    return " ".join(parts)


def _picture(rows: Sequence[Row]) -> Figure:
    there, columns, counts = matrix(rows)
    verdicts = {(row["name"], called(row)): right(row) for row in rows if row["kind"] != PAIR}

    def colour(i: int, j: int) -> str:
        return RIGHT if verdicts[there[i], columns[j]] else WRONG

    drawing = counts_drawing(there, columns, counts, colour)
    return Figure("confusion", drawing, "Number of arms; green is right, red is wrong.")


def counts_drawing(
    there: Sequence[str], columns: Sequence[str], counts: Array, colour: Callable[[int, int], str]
) -> Drawing:
    """What was called (columns) of what was there (rows), each count in a colour."""
    drawing = Drawing(figsize=(2.6 + 0.5 * len(columns), 1.8 + 0.36 * len(there)))
    axes = drawing.add_subplot()
    parts = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(parts, cmap="Greys", vmin=0, vmax=4, aspect="auto")
    for i, j in zip(*np.nonzero(counts), strict=True):
        told = f"{counts[i, j]:.0f}"
        axes.text(j, i, told, ha="center", va="center", color=colour(i, j), weight="bold")
    axes.set_xticks(
        range(len(columns)), [c.replace("_", " ") for c in columns], rotation=45, ha="right"
    )
    axes.set_yticks(range(len(there)), [t.replace("_", " ") for t in there])
    axes.set(xlabel="called", ylabel="there")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return drawing


def _counts(rows: Sequence[Row]) -> Table:
    there, columns, counts = matrix(rows)
    cells = tuple(
        (name, *(f"{n:.0f}" if n else "" for n in line))
        for name, line in zip(there, counts, strict=True)
    )
    return Table(("there", *columns), cells, "Columns: what was called.")


def aims_table(rows: Sequence[Row], figures: Mapping[str, Any]) -> Table:
    """The rates beside what is wanted."""
    clean = [r for r in rows if r["kind"] == CLEAN]
    above = figures["named_right_above_limit"]
    lines = (
        ("false alarms in clean arms", "0 of 20", share(clean, lambda r: r["named"])),
        ("clean arms called unexplained", "0 of 20", share(clean, lambda r: r["unexplained"])),
        ("named right above the limit", "95 %", Share(above["count"], above["of"])),
        ("95 % intervals that hold the truth", "90 %", coverage(rows)["all"]),
    )
    note = (
        "In brackets, 95 % intervals of the shares. The limits are fitted to the same arms as the share "
        "above them, which flatters it a little."
    )
    return Table(("", "aim", "found"), tuple((a, b, str(c)) for a, b, c in lines), note)


def limits_table(found: Sequence[Limit]) -> Table:
    """From which strength on each effect is named."""
    lines = tuple((each.name.replace("_", " "), each.said, str(each.right),
                   f"{each.strength.min():.3g} … {quantity(each.strength.max(), each.unit)}")
                  for each in found)  # fmt: skip
    return Table(("effect", "detection limit", "named right at any strength", "tried"), lines)


def _curves(found: Sequence[Limit]) -> Figure:
    """A dot for every trial over its strength: right above, wrong below."""
    columns = 4
    height = -(-len(found) // columns)
    drawing = Drawing(figsize=(11, 1.5 * height), layout="constrained")
    for k, each in enumerate(found):
        axes = drawing.add_subplot(height, columns, k + 1)
        for good, colour in ((True, RIGHT), (False, WRONG)):
            at = each.strength[each.correct == good]
            axes.plot(at, np.full(len(at), float(good)), "o", color=colour, alpha=0.6, mew=0)
        if np.isfinite(each.limit):
            axes.axvline(each.limit, color=INK, lw=1, ls=":")
        axes.set(xscale="log", ylim=(-0.5, 1.5), xlabel="" if each.unit == "1" else each.unit)
        axes.set_yticks([0, 1], ["wrong", "right"])
        axes.set_title(each.name.replace("_", " "), loc="left", fontsize=9)
        label_logarithmic(axes)
        tidy(axes, grid=None, labelsize=8)
    return Figure("limits", drawing, "Every arm with one effect; the dotted line is the limit.")


def strengths_table(rows: Sequence[Row]) -> Table:
    """How often intervals hold the true strength."""
    lines = tuple((name.replace("_", " "), str(held)) for name, held in coverage(rows).items())
    note = (
        f"Of effects that were there and named. Strength within 10 % of the truth: {within(rows)}."
    )
    return Table(("effect", "true strength within the 95 % interval"), lines, note)


def arms_table(rows: Sequence[Row]) -> Table:
    """One row an arm: what it had, and what it was called."""
    lines = []
    for row in rows:
        strengths = ", ".join(quantity(e["strength"], e["unit"]) for e in row["truth"]["effects"])
        said = " + ".join(e["name"] for e in row["named"]) or called(row)
        error = row["error_mm"]
        lines.append((row["id"], strengths, said, f"{error['calibrated']:.2f}",
                      f"{error['corrected']:.2f}", "yes" if right(row) else "no"))  # fmt: skip
    return Table(
        ("arm", "strength", "called", "calibrated mm", "corrected mm", "right"), tuple(lines)
    )
