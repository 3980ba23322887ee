"""Lay out what stiffness does to memory, computation and pose errors."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.result_page import PageContent
from experiments.stiffness_sweep.answers import answers, control
from experiments.stiffness_sweep.arms import disagreement
from experiments.stiffness_sweep.figures import figures
from experiments.stiffness_sweep.plan import CROSSED, GRID, NOISES, RATIO
from experiments.stiffness_sweep.rows import Rows
from experiments.stiffness_sweep.transfer import worst
from experiments.stiffness_sweep.trend import HELD, NOT, OPEN, TREND, Answer
from serpent_twin.numerals import counted, listed
from serpent_twin.reservoir.sweep_rows import (
    SweepRow,
    error_of,
    readouts,
    row_from,
    steady_readouts,
    values,
)
from serpent_twin.runs.report import Section, Table

_CRITERIA = (
    f"A trend counts from a rank correlation of {TREND:g} on: it held if the whole 95 % interval lies "
    "beyond, did not hold if none of it does, and else cannot be told. Intervals, in brackets, are over "
    "resampled seeds; one seed has no interval."
)
_VERDICTS = {
    "expected": lambda answer: answer.expectation,
    "verdict": lambda answer: answer.verdict,
}
_WORD = {HELD: "confirmed", NOT: "contradicted", OPEN: "open"}


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
    lead = _lead(rows, found)
    parts = (
        Section("", lead, (grid_table(rows[GRID]),)),
        *_sections(rows, found, arms, results["transfer"]),
        Section("Cost", cost),
    )
    quick = " --quick" if results["quick"] else ""
    command = f"python -m experiments.stiffness_sweep --logs LOGS --twins TRACES{quick} --out OUT"
    beside = f"; the logs of {', '.join(arms)}" if arms else ""
    return PageContent("Stiffness sweep", command, f"simulated arms{beside}", parts, lead)


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


def _sections(
    rows: Rows,
    answers: Sequence[Answer],
    arms: Mapping[str, Mapping[str, Any]],
    transfer: Mapping[str, Any] | None,
) -> tuple[Section, ...]:
    """All tables and figures."""
    drawn = figures(rows, arms, transfer)
    parts = [
        Section("What was expected, and what came", _CRITERIA, (Table.of(answers, _VERDICTS),)),
        Section("What the verdicts rest on", reasons(answers)),
        Section("Where it is best", "", (drawn["maps"],)),
        Section("What the body computes", control(rows), (drawn["capacity_by_degree"],)),
        Section("What it remembers", "", (drawn["memory_profile"],)),
        Section("Pose error of readouts", "", (drawn["pose_error"],)),
        Section("Other commands, other damping", "", (drawn["commands"], *_besides(rows))),
    ]
    if arms:
        shown = (drawn["arms_memory"],) if "arms_memory" in drawn else ()
        parts.append(Section("Logged arms", _told(arms), (_arms(arms), *shown)))
    if transfer:
        parts.append(Section("Readouts on other arms", worst(transfer), (drawn["transfer"],)))
    if failed := [row for row in rows[GRID] if row.failed]:
        parts.append(Section("What could not be measured", "", (_failed(failed),)))
    return tuple(parts)


def _lead(rows: Rows, answers: Sequence[Answer]) -> str:
    """The conclusion, a sentence first."""
    parts = []
    for verdict in (HELD, NOT, OPEN):
        if of := [answer.expectation for answer in answers if answer.verdict == verdict]:
            parts.append(f"{len(of)} {_WORD[verdict]} ({'; '.join(map(_uncapped, of))})")
    return f"{_give(rows)} Of {counted(len(answers), 'expectation')} {listed(parts)}. {_best(rows)}"


def _give(rows: Rows) -> str:
    """What soft strands cost and what they bring, in a sentence."""
    stiffness = sorted({row.stiffness for row in rows[GRID]})
    slack = sorted({row.slack for row in rows[GRID]})
    name = next(each for each in ("residual", "linear") if each in steady_readouts(rows[GRID]))
    error = {of: values(rows[GRID], error_of(of)) for of in ("analytical", name)}
    error = {of: np.nanmean(each, axis=-1) for of, each in error.items()}
    useful = np.nanmean(values(rows[GRID], lambda row: row.useful_total), axis=-1)
    total = np.nanmean(values(rows[GRID], lambda row: row.total), axis=-1)
    told = {of: f"from {each[0, -1]:.1f} to {each[0, 0]:.1f} mm" for of, each in error.items()}
    return (
        f"At {1e3 * slack[0]:g} mm of slack, strands of {stiffness[0] / 1e3:.3g} in place of "
        f"{stiffness[-1] / 1e3:.3g} kN/m raise the error of geometry {told['analytical']}, that of the "
        f"{name} readout {told[name]}; beyond the taps the sensors show {np.nanmin(useful[0]):.2f} … "
        f"{np.nanmax(useful[0]):.2f} of {np.nanmin(total[0]):.1f} … {np.nanmax(total[0]):.1f} capacities, "
        f"and at {1e3 * slack[-1]:g} mm of slack {np.nanmax(useful[-1]):.2f} at most."
    )


def _best(rows: Rows) -> str:
    """The stiffness that serves pose and memory best, in a sentence."""
    stiffness = sorted({row.stiffness for row in rows[GRID]})
    useful = np.nanmean(values(rows[GRID], lambda row: row.useful_total), axis=(0, 2))
    most = int(np.nanargmax(useful))
    told = ["Mean over slacks, the sensors show nothing above chance beyond taps"]
    if useful[most] > 0:
        at = f"{stiffness[most] / 1e3:.3g} kN/m ({useful[most]:.2f})"
        told = [f"Mean over slacks, the sensors show most beyond taps at {at}"]
    for name in readouts(rows[GRID]):
        every = values(rows[GRID], error_of(name))
        there = np.flatnonzero(~np.isnan(every).all(axis=(0, 2)))
        error = np.nanmean(every[:, there], axis=(0, 2))
        at = stiffness[there[np.argmin(error)]]
        told.append(f"{name} errs least at {at / 1e3:.3g} kN/m ({error.min():.1f} mm)")
    return f"{listed(told)}."


def _uncapped(text: str) -> str:
    return text[0].lower() + text[1:]


def reasons(answers: Sequence[Answer]) -> str:
    """A paragraph an expectation."""
    return "\n\n".join(f"{each.expectation}: {each.verdict}. {each.why}" for each in answers)


def _besides(rows: Rows) -> tuple[Table, ...]:
    """The crossed commands and noises at one stiffness, and what the damping ratio held gives."""
    measured = {
        "useful capacity": lambda row: f"{row.useful_total:.2f}",
        "without noise": lambda row: f"{row.noiseless_total:.2f}",
        "mean delay periods": lambda row: f"{row.mean_delay:.2f}",
        "consistency": lambda row: f"{row.consistency:.2f}",
    }
    for name in steady_readouts(rows[GRID]):
        measured[f"{name} mm"] = lambda row, name=name: f"{error_of(name)(row):.2f}"
    commands = Table.of(
        rows[CROSSED],
        {"rate Hz": lambda row: f"{row.rate:g}", "amplitude rad": lambda row: f"{row.amplitude:g}"}
        | measured,
        f"Rate and amplitude crossed at {rows[CROSSED][0].stiffness / 1e3:.3g} kN/m; delays in "
        "command periods. The amplitude does not change pose errors: the published protocol "
        "has its own.",
    )
    ratio = Table.of(
        rows[RATIO],
        {
            "stiffness kN/m": lambda row: f"{row.stiffness / 1e3:.3g}",
            "damping mN m s/rad": lambda row: f"{1e3 * row.damping:.3g}",
        }
        | measured,
        "Damping ratio of the cables' modes held instead of the damping constant.",
    )
    noises = Table.of(
        rows[NOISES],
        {"load noise %": lambda row: f"{100 * row.load_noise:g}"} | measured,
        f"Noise of the loads, as a share of the stall torque, at {rows[NOISES][0].stiffness / 1e3:.3g} kN/m.",
    )
    return commands, ratio, noises


def _told(arms: Mapping[str, Mapping[str, Any]]) -> str:
    told = [f"{name}, {disagreement(found)}." for name, found in arms.items()]
    refused = next((found["refused"] for found in arms.values() if found["refused"]), "")
    why = (
        "In logs a target stands for several rows, so row by row the commands are not independent inputs, "
        f"and capacities are left out. What the check said: {refused} One row for each target is kept "
        "instead, and only the linear memory is measured, as short logs carry no more."
    )
    left = {
        each["left_out"]: f"{name}, {channel}"
        for name, found in arms.items()
        for channel, each in found["memory"].items()
        if "left_out" in each
    }
    lost = [f"Left out for {where}, and where it is alike: {what}" for what, where in left.items()]
    return "\n\n".join([" ".join(told), why, *lost])


def _arms(arms: Mapping[str, Mapping[str, Any]]) -> Table:
    names = list(next(iter(arms.values()))["pose_mm"])
    columns = {
        "arm": "{arm}",
        "stiffness kN/m": lambda found: f"{found['place']['stiffness'] / 1e3:.2f}",
        "slack mm": lambda found: f"{1e3 * found['place']['slack']:.2f}",
        "known from": "{place[source]}",
        "rows": "{rows}",
        **{f"{name} mm": f"{{pose_mm[{name}]:.2f}}" for name in names},
        **{f"twin's {name} mm": f"{{twin_pose_mm[{name}]:.2f}}" for name in names},
    }
    note = (
        "The twin has the arm's median stiffness and slack and its cameras' noise, and is nominal else: what "
        "differs is the arm's other parameters, its loads' noise, and what no stiffness tells."
    )
    return Table.of(({"arm": arm} | dict(found) for arm, found in arms.items()), columns, note)


def _failed(rows: Sequence[SweepRow]) -> Table:
    columns = {
        "stiffness kN/m": lambda row: f"{row.stiffness / 1e3:.3g}",
        "slack mm": lambda row: f"{1e3 * row.slack:g}",
        "seed": lambda row: f"{row.seed}",
        "what failed": lambda row: row.failed,
    }
    return Table.of(rows, columns)
