"""Write what a planned motion decides as a report."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.proposals import CommandColumn, Proposals
from serpent_twin.numerals import counted
from serpent_twin.recording.motion import Motion
from serpent_twin.recording.plan_criterion import Question
from serpent_twin.runs.plot_style import sheet, tidy
from serpent_twin.runs.report import Figure, Report, Section, Table

_NOTE = """\
Of two rivals: the probability that the log-likelihood ratio names the right one, Φ(d/2), where d is the
distance between one and the best fit of the other in standard deviations. Of one effect: the expected
standard error of its strength, as a share of its strength. Both to first order, with all declared parameters
fitted again. Of the distance, as much counts as the trace's held-out logs have confirmed, since no twin is
exact; an effect that the trace has not named is taken to be as strong as its logs can hide."""


def decides(questions: Sequence[Question], before: Array, after: Array) -> Table:
    """Each question with the logs' answer, and with the motion's."""
    columns = {
        "question": str,
        "measure": lambda each: (
            "probability of the right name" if each.rival else "relative standard error"
        ),
        "with these logs": lambda each: _answer(each, before),
        "after the motion": lambda each: _answer(each, after),
    }
    return Table.of(questions, columns, _NOTE)


def _answer(question: Question, gram: Array) -> str:
    if question.rival:
        return f"{question.probability(gram):.3f} (d = {question.distance(gram):.2g})"
    return f"{question.relative_error(gram):.3g}"


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


def _limits(several: Sequence[CommandColumn]) -> Table:
    """Between which limits each column stays."""
    columns = {
        "column": lambda each: each.name,
        "unit": lambda each: each.unit,
        "least": lambda each: f"{each.low:.4g}",
        "greatest": lambda each: f"{each.high:.4g}",
    }
    if any(np.isfinite(each.fastest) for each in several):
        columns["most change a second"] = lambda each: f"{each.fastest:.4g}"
    return Table.of(several, columns)


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
