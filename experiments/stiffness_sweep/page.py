"""Write the report of the stiffness sweep."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.stiffness_sweep.answers import control
from experiments.stiffness_sweep.arms import disagreement
from experiments.stiffness_sweep.figures import figures
from experiments.stiffness_sweep.plan import CROSSED, GRID, NOISES, RATIO
from experiments.stiffness_sweep.rows import Rows
from experiments.stiffness_sweep.transfer import worst
from experiments.stiffness_sweep.trend import HELD, NOT, OPEN, TREND, Answer
from serpent_twin.numerals import counted
from serpent_twin.reporting.report import Report, Section, Table
from serpent_twin.reservoir.sweep.rows import SweepRow, error_of, readouts, steady_readouts, values

_CRITERIA = (
    f"A trend counts from a rank correlation of {TREND:g} on: it held if the whole 95 % interval lies "
    "beyond, did not hold if none of it does, and else cannot be told. Intervals, in brackets, are over "
    "resampled seeds; one seed has no interval."
)
_WORD = {HELD: "confirmed", NOT: "contradicted", OPEN: "open"}


def page(
    rows: Rows,
    answers: Sequence[Answer],
    arms: Mapping[str, Mapping[str, Any]],
    transfer: Mapping[str, Any] | None,
    facts: Mapping[str, str],
) -> Report:
    """The report."""
    parts = sections(rows, answers, arms, transfer)
    return Report(_title(rows, arms), lead(rows, answers), parts, facts)


def sections(
    rows: Rows,
    answers: Sequence[Answer],
    arms: Mapping[str, Mapping[str, Any]],
    transfer: Mapping[str, Any] | None,
) -> tuple[Section, ...]:
    """All tables and figures."""
    drawn = figures(rows, arms, transfer)
    parts = [
        Section("What was expected, and what came", _CRITERIA, (answers_table(answers),)),
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


def _title(rows: Rows, arms: Mapping[str, Any]) -> str:
    """What was swept, and which logged arms stand beside."""
    stiffness = [row.stiffness / 1e3 for row in rows[GRID]]
    beside = f", beside {', '.join(arms)}" if arms else ""
    return f"What stiffness does, {min(stiffness):.3g} … {max(stiffness):.3g} kN/m{beside}"


def lead(rows: Rows, answers: Sequence[Answer]) -> str:
    """The conclusion, a sentence first."""
    parts = []
    for verdict in (HELD, NOT, OPEN):
        if of := [answer.expectation for answer in answers if answer.verdict == verdict]:
            parts.append(f"{len(of)} {_WORD[verdict]} ({'; '.join(map(_uncapped, of))})")
    return f"{give(rows)} Of {counted(len(answers), 'expectation')} {_joined(parts)}. {best(rows)}"


def give(rows: Rows) -> str:
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


def best(rows: Rows) -> str:
    """Which stiffness serves pose and memory, in a sentence."""
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
    return f"{_joined(told)}."


def _joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _uncapped(text: str) -> str:
    return text[0].lower() + text[1:]


def answers_table(answers: Sequence[Answer]) -> Table:
    """One row an expectation."""
    lines = tuple((answer.expectation, answer.verdict) for answer in answers)
    return Table(("expected", "verdict"), lines)


def reasons(answers: Sequence[Answer]) -> str:
    """A paragraph an expectation."""
    return "\n\n".join(f"{each.expectation}: {each.verdict}. {each.why}" for each in answers)


def _besides(rows: Rows) -> tuple[Table, ...]:
    """The crossed commands and noises at one stiffness, and what the damping ratio held gives."""
    names = steady_readouts(rows[GRID])
    pose = (f"{name} mm" for name in names)
    header = ("useful capacity", "without noise", "mean delay periods", "consistency", *pose)
    commands = Table(
        ("rate Hz", "amplitude rad", *header),
        tuple((f"{r.rate:g}", f"{r.amplitude:g}", *_measured(r, names)) for r in rows[CROSSED]),
        f"Rate and amplitude crossed at {rows[CROSSED][0].stiffness / 1e3:.3g} kN/m; delays in "
        "command periods. The amplitude does not change pose errors: the published protocol "
        "has its own.",
    )
    ratio = Table(
        ("stiffness kN/m", "damping mN m s/rad", *header),
        tuple(
            (f"{r.stiffness / 1e3:.3g}", f"{1e3 * r.damping:.3g}", *_measured(r, names))
            for r in rows[RATIO]
        ),
        "Damping ratio of the cables' modes held instead of the damping constant.",
    )
    noises = Table(
        ("load noise %", *header),
        tuple((f"{100 * r.load_noise:g}", *_measured(r, names)) for r in rows[NOISES]),
        f"Noise of the loads, as a share of the stall torque, at {rows[NOISES][0].stiffness / 1e3:.3g} kN/m.",
    )
    return commands, ratio, noises


def _measured(row: SweepRow, names: Sequence[str]) -> tuple[str, ...]:
    errors = [error_of(name)(row) for name in names]
    numbers = (row.useful_total, row.noiseless_total, row.mean_delay, row.consistency, *errors)
    return tuple(f"{number:.2f}" for number in numbers)


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
    header = ("arm", "stiffness kN/m", "slack mm", "known from", "rows",
              *(f"{name} mm" for name in names), *(f"twin's {name} mm" for name in names))  # fmt: skip
    lines = tuple(
        (
            arm,
            f"{found['place']['stiffness'] / 1e3:.2f}",
            f"{1e3 * found['place']['slack']:.2f}",
            found["place"]["source"],
            f"{found['rows']}",
            *(f"{found['pose_mm'][name]:.2f}" for name in names),
            *(f"{found['twin_pose_mm'][name]:.2f}" for name in names),
        )
        for arm, found in arms.items()
    )
    note = (
        "The twin has the arm's median stiffness and slack and its cameras' noise, and is nominal else: what "
        "differs is the arm's other parameters, its loads' noise, and what no stiffness tells."
    )
    return Table(header, lines, note)


def _failed(rows: Sequence[SweepRow]) -> Table:
    lines = tuple(
        (f"{r.stiffness / 1e3:.3g}", f"{1e3 * r.slack:g}", f"{r.seed}", r.failed) for r in rows
    )
    return Table(("stiffness kN/m", "slack mm", "seed", "what failed"), lines)
