"""Report the traces of the measured machines side by side."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.measured.metric import METRICS, Metric
from serpent_twin.identification.diagnosis import ACCEPTED, STANDS_IN, Diagnosis
from serpent_twin.identification.wording import full_name, spaced
from serpent_twin.reporting.plot_style import COLOURS, INK, label_logarithmic, sheet, tidy
from serpent_twin.reporting.report import Figure, Report, Section, Table

_BARS = ("nominal", "calibrated", "corrected", "regression")
_HEADER = ("rig", "judged by", "metric", "nominal", "calibrated", "corrected", "regression",
           "sketch", "reference", "what the twin lacked", "rejected")  # fmt: skip
_OWN_WEIGHTS = (
    "No mass, pulley radius or stiffness is published, and geometry tells forces only up to one scale: the "
    "load is told in the trunk's own weights, and its mass in grams cannot be known; its interval spans the "
    "places, up to 0.1 m below the end, where it may hang. Other forces are in a unit in which a cable has "
    "6 kN/m, which no log can tell."
)
Found = Mapping[str, Mapping[str, Any]]


def effect_told(effect: Mapping[str, Any]) -> str:
    """An effect with its place, or a composed law in words, with its numbers and intervals."""
    told = ", ".join(f"{n} {_interval(e)} {e['unit']}" for n, e in effect["parameters"].items())
    return f"{spaced(full_name(effect))} ({told})"


def table(found: Found) -> Table:
    """One row a split: errors before and after, what was missing, what others reached; then the changes."""
    rows = [row for name, of in found.items() for row in [*_splits(name, of), *_changes(name, of)]]
    note = (
        "All errors are on runs to which nothing was fitted, simulated whole, or in windows that begin some "
        "seconds before they count. "
        "The last of several regressions reads what the twin has to predict. References are the authors' "
        f"published figures, on their own cuts of the data{_unpublished(found)}. In brackets, 95 % intervals."
    )
    if any(of["changed"] for of in found.values()):
        note += (
            " After a change, the nominal twin is the corrected one of the machine as it was; the run's "
            "beginning is fitted, its end judges."
        )
    return Table(_HEADER, tuple(rows), note)


def _splits(name: str, of: Mapping[str, Any]) -> list[tuple[str, ...]]:
    return [
        (
            name,
            _listed(each["held_out"]),
            _heading(_metric(of)),
            *(f"{each[stage]:.2f}" for stage in _BARS[:3]),
            " / ".join(f"{v:.2f}" for v in each["regression"].values()),
            f"{of['sketch']:.2f}",
            f"{of['reference']:.2f}",
            lacked(each),
            _rejected(each),
        )
        for each in of["splits"]
    ]


def _changes(name: str, of: Mapping[str, Any]) -> list[tuple[str, ...]]:
    return [
        (
            f"{name}, changed",
            f"end of {_listed([each['file']])}",
            _heading(_metric(of)),
            *(f"{each[stage]:.2f}" for stage in ("before", "rezeroed", "after")),
            *("", "", ""),
            lacked(each),
            _rejected(each),
        )
        for each in of["changed"]
    ]


def page(found: Found) -> Report:
    """The report."""
    sections = [Section("Before and after", "", (table(found), _bars(found)))]
    for name, of in found.items():
        texts = [_said(each, _metric(of)) for each in of["splits"]]
        sections.append(Section(name, "\n\n".join(texts)))
        if of["changed"]:
            texts = [_change_said(name, each, _metric(of)) for each in of["changed"]]
            sections.append(Section(f"{name}, changed", "\n\n".join([*texts, _OWN_WEIGHTS])))
    return Report(
        f"The loop on measured machines: {', '.join(found)}", lead(found), tuple(sections)
    )


def lead(found: Found) -> str:
    """One sentence that the numbers support."""
    told = []
    for name, of in found.items():
        metric, (low, high) = _metric(of), of["spread"]
        over = f"{low:.2f} … {metric.told(high)} over {len(of['splits'])} splits"
        spread = f", {over}" if high > low else ""
        told.append(
            f"{name}, {of['nominal']:.2f} → {metric.told(of['corrected'])} ({_names(of['effects'])} "
            f"found{spread}; {'reference' if of['reference_by'] else 'published'} "
            f"{metric.told(of['reference'])})"
        )
        told += [
            f"{name} in {_listed([each['file']])}, {each['before']:.2f} → "
            f"{metric.told(each['after'])} ({_names(each['effects'])} found)"
            for each in of["changed"]
        ]
    return f"Error on held-out runs, nominal → corrected: {'; '.join(told)}."


def _said(each: Mapping[str, Any], metric: Metric) -> str:
    """A split in words, and where the twin loses."""
    best, by = (
        min((v, k) for k, v in each["regression"].items()) if each["regression"] else (np.inf, "")
    )
    compared = ""
    if best < each["corrected"]:
        compared = f" A regression does better: {metric.told(best)} ({by})."
    elif np.isfinite(best):
        compared = f" The best plain regression leaves {metric.told(best)} ({by})."
    rest = f" {each['unexplained']}" if each["unexplained"] else ""
    corrected = metric.told(each["corrected"])
    return f"Judged by {_listed(each['held_out'])}: {corrected}.{compared}{rest}"


def _change_said(name: str, each: Mapping[str, Any], metric: Metric) -> str:
    """A change in words."""
    load = ""
    if ratio := each["payload_ratio"]:
        load = f" The load is {_interval(ratio)} of the {name}'s own weight."
    before, zeroed, after = (metric.told(each[k]) for k in ("before", "rezeroed", "after"))
    course = f"The twin of the {name} as it was leaves {before}, calibrated again {zeroed}"
    course += f", with what was found {after}." if each["found"] else "."
    return f"{_listed([each['file']])}: {lacked(each)}.{load} {course}"


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
        axes.axhline(of["reference"], color=INK, lw=1, ls="--", label="reference")
        axes.set_xticks(range(len(of["splits"])), [_short(e["held_out"]) for e in of["splits"]])
        axes.set(title=name, ylabel=f"{_metric(of).words} [{_metric(of).unit}]", yscale="log")
        label_logarithmic(axes)
        tidy(axes, grid=None)
    drawing.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False
    )
    caption = "Errors on held-out runs, by split; the dashed line is the reference."
    return Figure("errors", drawing, caption)


def _interval(estimate: Mapping[str, Any]) -> str:
    low, high = estimate["low"], estimate["high"]
    return f"{estimate['value']:.3g} [{f'{low:.3g} … {high:.3g}' if low < high else 'given'}]"


def _metric(of: Mapping[str, Any]) -> Metric:
    return METRICS[of["metric"]]


def _heading(metric: Metric) -> str:
    return f"{metric.short} {metric.unit}"


def lacked(each: Mapping[str, Any]) -> str:
    """Name the effects that a twin lacked, with their numbers; or those that come nearest but leave too
    much to be the cause.
    """
    if each["stand_ins"]:
        return f"no cause is named; nearest come {'; '.join(each['stand_ins'])}"
    return "; ".join(each["found"]) or "nothing that is beyond chance"


def rejected(found: Diagnosis) -> list[str]:
    """The candidates that neither are causes nor come nearest."""
    return [t.name for t in found.candidates if t.verdict not in (ACCEPTED, STANDS_IN)]


def _rejected(each: Mapping[str, Any]) -> str:
    return ", ".join(name.replace("_", " ") for name in each["rejected"])


def _names(effects: Sequence[str]) -> str:
    return " and ".join(name.replace("_", " ") for name in effects) or "nothing"


def _unpublished(found: Found) -> str:
    """Whose references are not the authors'."""
    own = [(name, of["reference_by"]) for name, of in found.items() if of["reference_by"]]
    return "".join(f"; the {name}'s is {by}, for none is published" for name, by in own)


def _listed(files: Sequence[str]) -> str:
    return ", ".join(name.removesuffix(".parquet") for name in files)


def _short(files: Sequence[str]) -> str:
    """What the names begin with, for an axis."""
    first = files[0].removesuffix(".parquet")
    return first if len(files) == 1 else f"{first}, … ({len(files)})"
