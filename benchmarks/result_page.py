"""Write speed and memory as a page."""

from collections.abc import Mapping
from typing import Any

from benchmarks.rows import told
from experiments.result_page import PageContent
from serpent_twin.runs.report import Section, Table

TITLES = {
    "collect_speed": "Collecting sessions",
    "trace_speed": "A trace and its parts, beside an earlier version",
    "any_model_speed": "A trace of any model",
    "right_names": "Arms of earlier studies, traced again",
    "sweep_speed": "Sweeping compliance",
    "estimate_speed": "One estimate, on one core",
    "structure": "The code",
}
_TEXT = """Ratios are to bare MuJoCo that takes as many steps of the same model in the same run. Times
depend on the machine and on what else it does; the load average before a benchmark began is the number
of processes that were already running or waiting."""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    found = results["benchmarks"]
    data = "simulated sessions, and the logs in `data/` for the traces"
    sections = [Section("", f"{_TEXT} The machine has {results['cores']} cores.")]
    sections += [
        Section(TITLES[name], _busy(of["load_before"]), (_table(of["rows"]),))
        for name, of in found.items()
    ]
    return PageContent("Speed", "python -m benchmarks --out bench", data, tuple(sections))


def _busy(load: float) -> str:
    return f"Load average before: {load:.1f}."


def _table(rows: list[Mapping[str, Any]]) -> Table:
    cells = tuple((row["what"], told(row["value"], row["unit"]), row["aim"]) for row in rows)
    return Table(("what", "measured", "aim"), cells)
