"""Write the errors on measured machines as a page."""

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.measured.metric import METRICS, Metric
from experiments.measured.page import Found, lacked
from experiments.result_page import PageContent, traced_by_commit
from serpent_twin.identification.wording import spaced
from serpent_twin.reporting.report import Section, Table

_HEADER = ("machine", "judged by", "nominal", "calibrated", "corrected", "regression", "reference")
_ERRORS = """All errors are on runs to which nothing was fitted: {metrics}. The twin is simulated from
what drives the machine alone, whole or in windows that begin some seconds before they count. Each
regression is fitted to the same runs as the twin. References are the authors' published figures, on
their own cuts of the data{own}. After a change, the nominal twin is the corrected one of the machine as
it was, the calibrated one has its zero set anew, and the beginning of the run is fitted; the rest of it
judges."""
_LACKED = """Effects are in the order in which they were found, with 95 % intervals in brackets. What
was rejected gave no gain beyond chance."""


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
        Section("", _errors_text(found), (Table(_HEADER, _rows(found, _errors)),)),
        Section("What the twins lacked", _LACKED, (_lacked_table(found),)),
        Section("What is left", _left(found)),
    )
    return PageContent("Measured machines", f"{command} --out measured_out", data, sections)


def _errors_text(found: Found) -> str:
    metrics = "; ".join(f"{name}, {METRICS[of['metric']].words}" for name, of in found.items())
    own = [
        f"; the {name}'s is {of['reference_by']}"
        for name, of in found.items()
        if of["reference_by"]
    ]
    return _ERRORS.format(metrics=metrics, own="".join(own))


def _rows(found: Found, cells: Any) -> tuple[tuple[str, ...], ...]:
    """A row for each split of each machine, and for each run after a change."""
    rows = []
    for name, of in found.items():
        metric = METRICS[of["metric"]]
        rows += [
            (name, _names(each["held_out"]), *cells(each, metric, of)) for each in of["splits"]
        ]
        rows += [
            (f"{name}, changed", f"the end of {_names([each['file']])}", *cells(each, metric, of))
            for each in of["changed"]
        ]
    return tuple(rows)


def _errors(each: Mapping[str, Any], metric: Metric, of: Mapping[str, Any]) -> tuple[str, ...]:
    if "before" in each:
        return (*(metric.told(each[k]) for k in ("before", "rezeroed", "after")), "", "")
    regressions = "; ".join(f"{metric.told(v)} ({k})" for k, v in each["regression"].items())
    stages = (metric.told(each[stage]) for stage in ("nominal", "calibrated", "corrected"))
    return (*stages, regressions, metric.told(of["reference"]))


def _lacked_table(found: Found) -> Table:
    return Table(("machine", "judged by", "effects", "rejected"), _rows(found, _effects))


def _effects(each: Mapping[str, Any], metric: Metric, of: Mapping[str, Any]) -> tuple[str, str]:
    rejected = ", ".join(map(spaced, each["rejected"]))
    ratio = each.get("payload_ratio")
    weighs = ""
    if ratio:
        span = f"[{ratio['low']:.1f} … {ratio['high']:.1f}]"
        weighs = f"; {ratio['value']:.1f} {span} × the machine's own weight"
    return lacked(each) + weighs, rejected


def _left(found: Found) -> str:
    """On what the errors that are left depend."""
    told = [
        f"{name}, judged by {_names(each['held_out'])}: {each['unexplained']}"
        for name, of in found.items()
        for each in of["splits"]
        if each["unexplained"]
    ]
    return "\n\n".join(told) or "No error is left that depends on what was examined."


def _names(files: Sequence[str]) -> str:
    return ", ".join(name.removesuffix(".parquet") for name in files)
