"""Lay out the errors on measured machines."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.measured.metric import METRICS, Metric
from experiments.result_page import PageContent, traced_by_commit
from serpent_twin.identification.diagnosis import ACCEPTED, STANDS_IN, Diagnosis
from serpent_twin.identification.wording import full_name, spaced
from serpent_twin.runs.plot_style import COLOURS, INK, label_logarithmic, sheet, tidy
from serpent_twin.runs.report import Figure, Section, Table

_BARS = ("nominal", "calibrated", "corrected", "regression")
_CHANGED = ("before", "rezeroed", "after")
_OWN_WEIGHTS = (
    "No mass, pulley radius or stiffness is published, and geometry tells forces only up to one scale: the "
    "load is told in the trunk's own weights, and its mass in grams cannot be known; its interval spans the "
    "places, up to 0.1 m below the end, where it may hang. Other forces are in a unit in which a cable has "
    "6 kN/m, which no log can tell."
)
_ERRORS = """All errors are on runs to which nothing was fitted: {metrics}. The twin is simulated from
what drives the machine alone, whole or in windows that begin some seconds before they count. Each
regression is fitted to the same runs as the twin. References are the authors' published figures, on
their own cuts of the data{own}. After a change, the nominal twin is the corrected one of the machine as
it was, the calibrated one has its zero set anew, and the beginning of the run is fitted; the rest of it
judges."""
_LACKED = """Effects are in the order in which they were found, with 95 % intervals in brackets. What
was rejected gave no gain beyond chance."""


Found = Mapping[str, Mapping[str, Any]]
MachineRow = tuple[str, Mapping[str, Any], Mapping[str, Any]]
"""A machine's name, its entry in results.json, and one of its splits or changes"""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    found, settings = results["rigs"], results["settings"]
    command = "python -m experiments.measured --data measured"
    command += f" --held-out '{settings['held_out']}'" if settings["held_out"] else ""
    data = (
        f"logs of real machines recorded by others: {traced_by_commit(found)}; "
        "[Logs of measured machines](measured-logs.md#get-the-logs) has their sources and licences"
    )
    sections = (
        Section("", _errors_text(found), (errors_table(found),)),
        Section("What the twins lacked", _LACKED, (lacked_table(found),)),
        Section("What is left", _left(found)),
    )
    command += " --out measured_out"
    return PageContent("Measured machines", command, data, sections, _lead(found))


def pictures(found: Found) -> list[Section]:
    """Errors by split as bars, and in which unit a change of the machine is stated."""
    sections = [Section("Errors by split", "", (_bars(found),))]
    if any(of["changed"] for of in found.values()):
        sections.append(Section("The unit of a load", _OWN_WEIGHTS))
    return sections


def _errors_text(found: Found) -> str:
    metrics = "; ".join(f"{name}, {METRICS[of['metric']].words}" for name, of in found.items())
    own = [
        f"; the {name}'s is {of['reference_by']}"
        for name, of in found.items()
        if of["reference_by"]
    ]
    return _ERRORS.format(metrics=metrics, own="".join(own))


def _rows(found: Found) -> list[MachineRow]:
    """A row for each split of each machine, then for each run after a change."""
    return [
        (name, of, each) for name, of in found.items() for each in (*of["splits"], *of["changed"])
    ]


def _machine(row: MachineRow) -> str:
    return f"{row[0]}, changed" if "before" in row[2] else row[0]


def _judged_by(row: MachineRow) -> str:
    each = row[2]
    return f"the end of {_names([each['file']])}" if "before" in each else _names(each["held_out"])


def errors_table(found: Found) -> Table:
    """Errors before and after, what a regression leaves, and what others reached."""

    def stage(n: int) -> Callable[[MachineRow], str]:
        def cell(row: MachineRow) -> str:
            key = _CHANGED[n] if "before" in row[2] else _BARS[n]
            return _metric(row).told(row[2][key])

        return cell

    columns = {
        "machine": _machine,
        "judged by": _judged_by,
        **{name: stage(n) for n, name in enumerate(_BARS[:3])},
        "regression": lambda row: "; ".join(
            f"{_metric(row).told(value)} ({by})"
            for by, value in row[2].get("regression", {}).items()
        ),
        "reference": lambda row: "" if "before" in row[2] else _reference(row[1], _metric(row)),
    }
    return Table.of(_rows(found), columns)


def lacked_table(found: Found) -> Table:
    """What each twin lacked, and what was rejected."""
    columns = {
        "machine": _machine,
        "judged by": _judged_by,
        "effects": lambda row: _lacked(row[2]),
        "rejected": lambda row: ", ".join(map(spaced, row[2]["rejected"])),
    }
    return Table.of(_rows(found), columns)


def _reference(of: Mapping[str, Any], metric: Metric) -> str:
    """What others reached; empty where nothing is known."""
    return "" if of["reference"] is None else metric.told(of["reference"])


def _metric(row: MachineRow) -> Metric:
    return METRICS[row[1]["metric"]]


def _lacked(each: Mapping[str, Any]) -> str:
    """The effects that a twin lacked, with their numbers, or those that come nearest but leave too much to be
    the cause; and the load in the machine's own weights.
    """
    told = "; ".join(each["found"]) or "nothing that is beyond chance"
    if each["stand_ins"]:
        told = f"no cause is named; nearest come {'; '.join(each['stand_ins'])}"
    if ratio := each.get("payload_ratio"):
        span = f"[{ratio['low']:.1f} … {ratio['high']:.1f}]"
        told += f"; {ratio['value']:.1f} {span} × the machine's own weight"
    return told


def _left(found: Found) -> str:
    """Sentences on what the errors that are left depend on."""
    told = [
        f"{name}, judged by {_names(each['held_out'])}: {each['unexplained']}"
        for name, of in found.items()
        for each in of["splits"]
        if each["unexplained"]
    ]
    return "\n\n".join(told) or "No error is left that depends on what was examined."


def _lead(found: Found) -> str:
    """One sentence that the numbers support."""
    told = []
    for name, of in found.items():
        metric, (low, high) = METRICS[of["metric"]], of.get("spread", (0.0, 0.0))
        over = f"{low:.2f} … {metric.told(high)} over {len(of['splits'])} splits"
        spread = f", {over}" if high > low else ""
        first = of["splits"][0]
        beside = "reference" if of["reference_by"] else "published"
        known = _reference(of, metric)
        told.append(
            f"{name}, {first['nominal']:.2f} → {metric.told(first['corrected'])} "
            f"({_and(first.get('effects', ()))} found{spread}{known and f'; {beside} {known}'})"
        )
        told += [
            f"{name} in {_names([each['file']])}, {each['before']:.2f} → "
            f"{metric.told(each['after'])} ({_and(each.get('effects', ()))} found)"
            for each in of["changed"]
        ]
    return f"Error on held-out runs, nominal → corrected: {'; '.join(told)}."


def _bars(found: Found) -> Figure:
    """Errors of every stage for every split, and the reference."""
    drawing, panels = sheet(3 + 3 * len(found), 3.6, len(found))
    for axes, (name, of) in zip(panels, found.items(), strict=True):
        for n, each in enumerate(of["splits"]):
            values = [
                *(each[s] for s in _BARS[:3]),
                min(each["regression"].values(), default=np.nan),
            ]
            for k, (value, colour) in enumerate(zip(values, COLOURS, strict=False)):
                axes.bar(
                    n + 0.2 * (k - 1.5), value, 0.18, color=colour, label=None if n else _BARS[k]
                )
        if of["reference"] is not None:
            axes.axhline(of["reference"], color=INK, lw=1, ls="--", label="reference")
        axes.set_xticks(range(len(of["splits"])), [_short(e["held_out"]) for e in of["splits"]])
        axes.set(
            title=name,
            ylabel=f"{METRICS[of['metric']].words} [{METRICS[of['metric']].unit}]",
            yscale="log",
        )
        label_logarithmic(axes)
        tidy(axes, grid=None)
    drawing.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False
    )
    caption = "Errors on held-out runs, by split; the dashed line is the reference."
    return Figure("errors", drawing, caption)


def effect_told(effect: Mapping[str, Any]) -> str:
    """An effect with its place, or a composed law in words, with its numbers and intervals."""
    told = ", ".join(f"{n} {_interval(e)} {e['unit']}" for n, e in effect["parameters"].items())
    return f"{spaced(full_name(effect))} ({told})"


def _interval(estimate: Mapping[str, Any]) -> str:
    low, high = estimate["low"], estimate["high"]
    return f"{estimate['value']:.3g} [{f'{low:.3g} … {high:.3g}' if low < high else 'given'}]"


def rejected(found: Diagnosis) -> list[str]:
    """The candidates that neither are causes nor come nearest."""
    return [t.name for t in found.candidates if t.verdict not in (ACCEPTED, STANDS_IN)]


def _and(effects: Sequence[str]) -> str:
    return " and ".join(name.replace("_", " ") for name in effects) or "nothing"


def _names(files: Sequence[str]) -> str:
    return ", ".join(name.removesuffix(".parquet") for name in files)


def _short(files: Sequence[str]) -> str:
    """What the names begin with, for an axis."""
    first = files[0].removesuffix(".parquet")
    return first if len(files) == 1 else f"{first}, … ({len(files)})"
