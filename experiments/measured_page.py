"""What do the measured machines' traces look like side by side?"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from measured_metric import METRICS, Metric

from serpent_twin.report import Figure, Report, Section, Table
from serpent_twin.residual.figures import COLOURS, INK, SOFT

_BARS = ("nominal", "calibrated", "corrected", "regression")
Found = Mapping[str, Mapping[str, Any]]


def table(found: Found) -> Table:
    """One row a split: errors before and after, what was missing, what others reached."""
    header = ("rig", "judged by", "metric", "nominal", "calibrated", "corrected", "regression",
              "sketch", "published", "what the twin lacked", "rejected")  # fmt: skip
    rows = tuple(
        (
            name,
            _listed(each["held_out"]),
            f"{_metric(of).short} {_metric(of).unit}",
            *(f"{each[stage]:.2f}" for stage in _BARS[:3]),
            " / ".join(f"{v:.2f}" for v in each["regression"].values()),
            f"{of['sketch']:.2f}",
            f"{of['reference']:.2f}",
            "; ".join(each["found"]) or "nothing that is beyond chance",
            ", ".join(n.replace("_", " ") for n in each["rejected"]),
        )
        for name, of in found.items()
        for each in of["splits"]
    )
    note = (
        "All errors are on runs to which nothing was fitted, each simulated from its first row to its last. "
        "Where two regressions are given, the second reads a torque that the twin predicts. Published "
        "figures are on the authors' own cuts of the data. In brackets, 95 % intervals."
    )
    return Table(header, rows, note)


def page(found: Found) -> Report:
    """The report."""
    sections = [Section("Before and after", "", (table(found), _bars(found)))]
    for name, of in found.items():
        texts = [_said(each, _metric(of)) for each in of["splits"]]
        sections.append(Section(name, "\n\n".join(texts)))
    return Report("The loop on measured machines", lead(found), tuple(sections))


def lead(found: Found) -> str:
    """One sentence that the numbers support."""
    told = []
    for name, of in found.items():
        metric, (low, high) = _metric(of), of["spread"]
        over = f"{low:.2f} … {metric.told(high)} over {len(of['splits'])} splits"
        spread = f", {over}" if high > low else ""
        named = " and ".join(e.replace("_", " ") for e in of["effects"]) or "nothing"
        told.append(
            f"{name}, {of['nominal']:.2f} → {metric.told(of['corrected'])} ({named} found{spread}; published "
            f"{metric.told(of['reference'])})"
        )
    return f"Error on held-out runs, nominal → corrected: {'; '.join(told)}."


def _said(each: Mapping[str, Any], metric: Metric) -> str:
    """A split in words, and where the twin loses."""
    best, by = (
        min((v, k) for k, v in each["regression"].items()) if each["regression"] else (np.inf, "")
    )
    compared = ""
    if best < each["corrected"]:
        compared = f" A regression from {by} does better: {metric.told(best)}."
    elif np.isfinite(best):
        compared = f" The best plain regression leaves {metric.told(best)}."
    rest = f" {each['unexplained']}" if each["unexplained"] else ""
    corrected = metric.told(each["corrected"])
    return f"Judged by {_listed(each['held_out'])}: {corrected}.{compared}{rest}"


def _bars(found: Found) -> Figure:
    """Errors of every stage for every split, and the published one."""
    from matplotlib.figure import Figure as Drawing

    drawing = Drawing(figsize=(9, 3.6), layout="constrained")
    panels = np.atleast_1d(drawing.subplots(1, len(found)))
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
        axes.axhline(of["reference"], color=INK, lw=1, ls="--", label="published")
        axes.set_xticks(range(len(of["splits"])), [_short(e["held_out"]) for e in of["splits"]])
        axes.set(title=name, ylabel=f"{_metric(of).words} [{_metric(of).unit}]", yscale="log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=SOFT, labelcolor=INK)
    drawing.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False
    )
    caption = "Errors on held-out runs, by split; the dashed line is what the authors published."
    return Figure("errors", drawing, caption)


def _metric(of: Mapping[str, Any]) -> Metric:
    return METRICS[of["metric"]]


def _listed(files: list[str]) -> str:
    return ", ".join(name.removesuffix(".parquet") for name in files)


def _short(files: list[str]) -> str:
    """What the names begin with, for an axis."""
    first = files[0].removesuffix(".parquet")
    return first if len(files) == 1 else f"{first}, … ({len(files)})"
