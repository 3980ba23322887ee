"""Write what a planned motion decides as a report."""

from collections.abc import Mapping, Sequence

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.planning.criterion import Question
from serpent_twin.recording.motion import Motion
from serpent_twin.reporting.plot_style import sheet, tidy
from serpent_twin.reporting.report import Figure, Report, Section, Table

_NOTE = """\
Of two rivals: the probability that the log-likelihood ratio names the right one, Φ(d/2), where d is the
distance between one and the best fit of the other in standard deviations. Of one effect: the expected
standard error of its strength, as a share of its strength. Both to first order, with all declared parameters
fitted again. Of the distance, as much counts as the trace's held-out logs have confirmed, since no twin is
exact; an effect that the trace has not named is taken to be as strong as its logs can hide."""


def decides(questions: Sequence[Question], before: Array, after: Array) -> Table:
    """Each question with the logs' answer, and with the motion's."""
    return Table(
        ("question", "measure", "with these logs", "after the motion"),
        tuple(_row(each, before, after) for each in questions),
        _NOTE,
    )


def _row(question: Question, before: Array, after: Array) -> tuple[str, ...]:
    if question.rival:
        values = [
            f"{question.probability(gram):.3f} (d = {question.distance(gram):.2g})"
            for gram in (before, after)
        ]
        return str(question), "probability of the right name", *values
    values = [f"{question.relative_error(gram):.3g}" for gram in (before, after)]
    return str(question), "relative standard error", *values


def page(
    motion: Motion, table: Table, kinds: Sequence[str], seconds: float, facts: Mapping[str, str]
) -> Report:
    """The report of a plan: what it decides, and the motion drawn."""
    rows = tuple((str(n + 1), f"{n * seconds:g}", kind) for n, kind in enumerate(kinds))
    pieces = Table(("piece", "begins [s]", "kind"), rows)
    return Report(
        "The next motion",
        f"{len(motion.targets) / motion.rate_hz:g} s of motion, in {len(kinds)} pieces.",
        (
            Section("What it decides", "", (table,)),
            Section(
                "The motion", "Each piece ends with the arm straight.", (_drawn(motion), pieces)
            ),
        ),
        facts,
    )


def _drawn(motion: Motion) -> Figure:
    drawing, (axes,) = sheet(7.0, 3.0)
    time = np.arange(len(motion.targets)) / motion.rate_hz
    axes.plot(time, np.rad2deg(motion.targets), linewidth=0.8)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("joint target [°]")
    tidy(axes)
    return Figure("motion", drawing, "Joint targets of the nine joints.")
