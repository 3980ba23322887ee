"""Write what a planned motion decides as a report."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from serpent_twin.machines.proposals import CommandColumn, Proposals
from serpent_twin.numerals import counted
from serpent_twin.planning.criterion import Evidence, Question
from serpent_twin.recording.motion import Motion
from serpent_twin.reporting.plot_style import sheet, tidy
from serpent_twin.reporting.report import Figure, Report, Section, Table

_NOTE = """\
Of two rivals: the probability that the log-likelihood ratio names the right one, Φ(d/2), where d is the
distance between one and the best fit of the other in standard deviations; of the distance, as much counts
as the trace's held-out logs have confirmed, since no twin is exact. Of an effect that the trace found: the
expected standard error of its strength, as a share of its strength. Of one that it did not find: the least
strength that a trace would name, three standard errors from zero and worth its parameters, beyond chance,
in the logs or in the motion; the twin's error is taken to grow in the motion as the response does. All to
first order, with all declared parameters fitted again."""


def decides(questions: Sequence[Question], before: Evidence, motion: Evidence) -> Table:
    """Each question with the logs' answer, and with the motion's."""
    return Table(
        ("question", "measure", "with these logs", "after the motion"),
        tuple(_row(each, before, motion) for each in questions),
        _NOTE,
    )


def _row(question: Question, before: Evidence, motion: Evidence) -> tuple[str, ...]:
    grams = (before.gram, before.gram + motion.gram)
    if question.rival:
        values = [
            f"{question.probability(gram):.3f} (d = {question.distance(gram):.2g})"
            for gram in grams
        ]
        return str(question), "probability of the right name", *values
    if question.limit_before:
        limits = question.limit_before, question.limit(grams[1], motion)
        values = [_strength(question, times) for times in limits]
        return str(question), "least strength that is named", *values
    values = [f"{question.relative_error(gram):.3g}" for gram in grams]
    return str(question), "relative standard error", *values


def _strength(question: Question, times: float) -> str:
    unit = "" if question.unit == "1" else f" {question.unit}"
    return f"{times * question.strength:.3g}{unit}" if np.isfinite(times) else "none"


def page(
    motion: Motion,
    table: Table,
    kinds: Sequence[str],
    proposals: Proposals[Any],
    facts: Mapping[str, str],
) -> Report:
    """The report of a plan: what it decides, and the motion drawn."""
    seconds = proposals.targets.shape[1] / motion.rate_hz
    rows = tuple((str(n + 1), f"{n * seconds:g}", kind) for n, kind in enumerate(kinds))
    pieces = Table(("piece", "begins [s]", "kind"), rows)
    return Report(
        "The next motion",
        f"{counted(len(motion.targets), 'row')}, {len(motion.targets) / motion.rate_hz:g} s, in "
        f"{counted(len(kinds), 'piece')}.",
        (
            Section("What it decides", "", (table,)),
            Section("The motion", "", (_drawn(motion, proposals.columns), pieces)),
            Section("Its limits", proposals.about, (_limits(proposals.columns),)),
        ),
        facts,
    )


def _limits(columns: Sequence[CommandColumn]) -> Table:
    """Between which limits each column stays."""
    limited = any(np.isfinite(each.fastest) for each in columns)
    rows = [
        (each.name, each.unit, f"{each.low:.4g}", f"{each.high:.4g}", f"{each.fastest:.4g}")
        for each in columns
    ]
    header = ("column", "unit", "least", "greatest", "most change a second")
    last = len(header) if limited else -1
    return Table(header[:last], tuple(row[:last] for row in rows))


def _drawn(motion: Motion, columns: Sequence[CommandColumn]) -> Figure:
    """The columns of each unit together."""
    units = list(dict.fromkeys(each.unit for each in columns))
    drawing, several = sheet(7.0, 1.0 + 2.0 * len(units), rows=len(units))
    time = np.arange(len(motion.targets)) / motion.rate_hz
    for unit, axes in zip(units, several, strict=True):
        for n, each in enumerate(columns):
            if each.unit == unit:
                axes.plot(time, motion.targets[:, n], linewidth=0.8, label=each.name)
        axes.set_xlabel("time [s]")
        axes.set_ylabel(f"[{unit}]")
        axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
        tidy(axes)
    return Figure("motion", drawing, "What commands the machine.")
