"""Write what stiffness does to memory, computation and pose errors as a page."""

from collections.abc import Mapping
from typing import Any

from experiments.result_page import PageContent
from experiments.stiffness_sweep.answers import answers
from experiments.stiffness_sweep.page import lead, sections
from experiments.stiffness_sweep.plan import GRID
from serpent_twin.reporting.report import Section
from serpent_twin.reservoir.sweep.rows import row_from

_COST = """The {points} points took {seconds:.1f} s each of one core in the mean. The simulation of a
point takes {steps:,} command periods and runs at {ratio:.2f} × the rate of a bare multi-threaded MuJoCo
rollout."""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    named = {GRID: results["table"], **results["besides"]}
    rows = {name: [row_from(each) for each in of] for name, of in named.items()}
    found, arms = answers(rows), results["arms"]
    cost = _COST.format(
        points=results["points"],
        seconds=results["seconds_per_point"],
        steps=results["settings"]["plan"]["steps"],
        ratio=results["engine_ratio"],
    )
    parts = (
        Section("", lead(rows, found)),
        *sections(rows, found, arms, results["transfer"]),
        Section("Cost", cost),
    )
    quick = " --quick" if results["quick"] else ""
    command = f"python -m experiments.stiffness_sweep --logs LOGS --twins TRACES{quick} --out OUT"
    beside = f"; the logs of {', '.join(arms)}" if arms else ""
    return PageContent("Stiffness sweep", command, f"simulated arms{beside}", parts)
