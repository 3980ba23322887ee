"""Write what stiffness does to memory, computation and pose errors as a page."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.result_page import PageContent
from experiments.stiffness_sweep.answers import answers
from experiments.stiffness_sweep.page import lead, sections
from experiments.stiffness_sweep.plan import GRID
from serpent_twin.reporting.report import Section, Table
from serpent_twin.reservoir.sweep.rows import (
    SweepRow,
    error_of,
    row_from,
    steady_readouts,
    values,
)

_COST = """The {points} points took {seconds:.1f} s each of one core in the mean. The simulation of a
point takes {steps:,} command periods and runs at {ratio:.2f} × the rate of a bare multi-threaded MuJoCo
rollout."""


def grid_table(rows: Sequence[SweepRow]) -> Table:
    """Useful capacity and the error of the residual readout, a row a slack, a column a stiffness."""
    name = next(each for each in ("residual", "linear") if each in steady_readouts(rows))
    useful = np.nanmean(values(rows, lambda row: row.useful_total), axis=-1)
    error = np.nanmean(values(rows, error_of(name)), axis=-1)
    stiffness = (f"{k / 1e3:.3g} kN/m" for k in sorted({row.stiffness for row in rows}))
    cells = tuple(
        (f"{1e3 * slack:g} mm", *(f"{u:.2f} / {e:.1f}" for u, e in zip(us, es, strict=True)))
        for slack, us, es in zip(sorted({row.slack for row in rows}), useful, error, strict=True)
    )
    note = f"Useful capacity that the sensors show / error of {name} [mm], mean over seeds."
    return Table(("slack", *stiffness), cells, note)


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
        Section("", lead(rows, found), (grid_table(rows[GRID]),)),
        *sections(rows, found, arms, results["transfer"]),
        Section("Cost", cost),
    )
    quick = " --quick" if results["quick"] else ""
    command = f"python -m experiments.stiffness_sweep --logs LOGS --twins TRACES{quick} --out OUT"
    beside = f"; the logs of {', '.join(arms)}" if arms else ""
    return PageContent("Stiffness sweep", command, f"simulated arms{beside}", parts)
