"""Lay out how often the trace names an injected effect."""

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
from experiments.result_page import PageContent, failures
from serpent_twin.arrays import Array
from serpent_twin.identification.wording import spaced
from serpent_twin.numerals import counted, listed
from serpent_twin.runs.plot_style import COLOURS, INK, label_logarithmic, tidy
from serpent_twin.runs.report import Figure, Section, Table

RIGHT, WRONG = COLOURS[3], COLOURS[2]
_SOURCE = "arms of `bench_arm`, with a cable law, an integration and a servo model of their own"
_TEXT = """Effects were injected into arms whose other parameters and noises are drawn at random;
`trace` then ran on their logs, the last session of each arm held out. "right" means that all injected
effects were named and nothing else; of an effect outside the catalogue, that the right law was discovered at
its place, or that the error was called unexplained."""
_MATRIX = (
    "Each row is one fault, each column what the trace said of arms that had it and nothing else. "
    "Strengths from far below to above what is typical are counted together."
)
_LIMITS = (
    "The limit is the strength at which a logistic curve over the trials reaches 95 % named right: the "
    "fault alone, and no other beside it. It is a number only where it lies within the strengths tried."
)


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    rows, settings, asked = results["rows"], results["settings"], results["asked"]
    numbers = settings["sessions"]
    size = f"--sessions {' '.join(map(str, numbers))} --steps {settings['steps']}"
    seed = f" --seed {settings['seed']}" if settings["seed"] else ""
    some = f" --only {' '.join(asked['only'])}" if asked["only"] else ""
    if results["not_run"] or results["failed"]:
        some += f" --trials {len(rows)}"
    command = f"python -m experiments.confusion --source {settings['source']} {size}{seed}"
    command += f" --rounds {asked['rounds']}{some}"
    data = f"{_SOURCE}; {listed(numbers)} sessions × {settings['steps']:,} steps each"
    sections = [
        Section("", _TEXT, (_arms_table(rows),)),
        Section("Rates", "", (_aims_table(rows, results),)),
    ]
    if any(row["kind"] in (KNOWN, PAIR) for row in rows):
        sections.append(Section("Strengths", "", (_strengths_table(rows),)))
    if found := limits(rows):
        sections.append(Section("Detection limits", "", (_limits_table(found),)))
    sections += failures("Arms that could not be traced", results)
    return PageContent("Injected effects", command, data, tuple(sections), _lead(rows))


def pictures(rows: Sequence[Row]) -> list[Section]:
    """What was called of what was there, and how weak a fault is noticed, as pictures."""
    sections = list[Section]()
    if any(row["kind"] != PAIR for row in rows):
        sections.append(Section("What was there, and what was called", _MATRIX, (_picture(rows),)))
    if found := limits(rows):
        sections.append(Section("How weak a fault is noticed", _LIMITS, (_curves(found),)))
    return sections


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
        range(len(columns)), [name.replace("_", " ") for name in columns], rotation=45, ha="right"
    )
    axes.set_yticks(range(len(there)), [name.replace("_", " ") for name in there])
    axes.set(xlabel="called", ylabel="there")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return drawing


def _aims_table(rows: Sequence[Row], figures: Mapping[str, Any]) -> Table:
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


def _limits_table(found: Sequence[Limit]) -> Table:
    """Strength from which on each effect is named."""
    columns = {
        "effect": lambda each: spaced(each.name),
        "detection limit": lambda each: each.said,
        "named right at any strength": lambda each: str(each.right),
        "tried": lambda each: (
            f"{each.strength.min():.3g} … {quantity(each.strength.max(), each.unit)}"
        ),
    }
    return Table.of(found, columns)


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


def _strengths_table(rows: Sequence[Row]) -> Table:
    """How often intervals hold the true strength."""
    lines = tuple((name.replace("_", " "), str(held)) for name, held in coverage(rows).items())
    note = (
        f"Of effects that were there and named. Strength within 10 % of the truth: {within(rows)}."
    )
    return Table(("effect", "true strength within the 95 % interval"), lines, note)


def _arms_table(rows: Sequence[Row]) -> Table:
    """One row an arm: what it had, and what it was called."""
    columns = {
        "arm": "{id}",
        "strength": strengths_told,
        "called": called_all,
        "calibrated mm": "{error_mm[calibrated]:.2f}",
        "corrected mm": "{error_mm[corrected]:.2f}",
        "right": lambda row: "yes" if right(row) else "no",
    }
    return Table.of(rows, columns)


def strengths_told(row: Row) -> str:
    """The strengths of what was there, with their units."""
    return ", ".join(quantity(e["strength"], e["unit"]) for e in row["truth"]["effects"])


def called_all(row: Row) -> str:
    """The names of all that was found, or what was called in their place."""
    return " + ".join(effect["name"] for effect in row["named"]) or called(row)
