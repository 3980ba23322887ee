"""Plan a motion from its options, and write it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.errors import SerpentError
from serpent_twin.machines import ARM
from serpent_twin.machines.proposals import Proposals
from serpent_twin.recording import motion, plan_criterion, plan_evidence, plan_page, traced
from serpent_twin.recording.plan_criterion import Question
from serpent_twin.recording.traced import Traced
from serpent_twin.runs.progress import Progress
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.runs.report import text_table, write
from serpent_twin.stored import within

PIECE = 20.0
"""Seconds of a piece of motion, at most"""


@dataclass(frozen=True)
class Plan(Checked):
    """Plan the motion that best tells apart what a trace's logs could not tell apart or could not show.

    OUT gets the motion; the folder of the same name without its ending gets report.html and report.md. Of the
    pieces of motion that keep the limits of the machine, those are chosen after which most of the open
    questions are expected to be answered rightly.
    """

    trace: Path
    """Folder of a finished trace of the arm, or of a machine that a machine.toml describes."""
    out: Path = Path("motion.parquet")
    """File for the motion. Of the arm: .parquet, which collect --motion takes. Of another machine: .csv or
    .parquet, with the columns and units of its logs."""
    rivals: tuple[str, ...] = ()
    """Effects to tell apart, two or more; without, what diagnosis.json names under next_motion."""
    minutes: Annotated[float, within(0.34, 60.0, "min")] = 3.0
    """Length of the motion, in whole pieces, one at least; of poses, in the time that they take in the logs,
    or a second each."""
    candidates: Annotated[int, within(2, 200)] = 18
    """Pieces of motion that are simulated, of which the best are chosen."""
    logs: tuple[Path, ...] = ()
    """The trace's logs, if they are no longer where they were."""
    seed: Seed = 0
    """Seed of the pieces of motion."""


@dataclass(frozen=True)
class Planned:
    """A motion and what it is expected to decide."""

    motion: motion.Motion
    questions: tuple[Question, ...]
    before: Array
    """Evidence of the logs, (R, R)"""
    after: Array
    """Evidence of the logs and the motion together, (R, R)"""
    kinds: tuple[str, ...]
    """What each piece of the motion is"""
    proposals: Proposals[Any]
    """Proposed motions, from which the motion's pieces were chosen"""
    each: Sequence[Array]
    """Evidence of each proposed motion, [(R, R)]"""


def plan(config: Plan) -> Planned:
    """Plan a motion, write it and its report, and print what it decides."""
    with Progress("the trace and its logs") as progress:
        trace = traced.read(config.trace, config.logs)
        progress.simulations = lambda: trace.case.clock.count
        motion.require_form(config.out, trace.rig)
        asked = questions(trace, config.rivals)
        rng = np.random.default_rng(config.seed)
        progress.step("motions, 1 of 4")
        proposals = proposed(trace, config.candidates, rng)
        progress.step("what the logs tell, 2 of 4")
        rows = plan_evidence.rows(trace, asked)
        before = plan_evidence.known(trace, rows)
        sure = tuple(_confirmed(each, before, trace) for each in rows.questions)
        rows = replace(rows, questions=sure)
        progress.step("what the motions tell, 3 of 4")
        each = plan_evidence.of_pieces(trace, rows, proposals.pieces)
        progress.step("the best pieces, 4 of 4")
        count = max(1, round(60 * config.minutes * trace.rate_hz) // proposals.targets.shape[1])
        order = plan_criterion.chosen(before, each, rows.questions, count)
    kinds = tuple(proposals.kinds[n] for n in order)
    about = {
        "rig": trace.rig,
        "arm": trace.diagnosis.get("arm", ""),
        "twin_sha256": file_hash(config.trace / "twin.json"),
        "decides": [str(each) for each in rows.questions],
        "pieces": kinds,
        "seed": config.seed,
        "provenance": provenance(),
    }
    targets = np.concatenate([proposals.targets[n] for n in order])
    names = tuple(each.name for each in proposals.columns)
    found = Planned(
        motion.Motion(targets, trace.rate_hz, about, names, proposals.time),
        rows.questions,
        before,
        before + np.sum([each[n] for n in order], axis=0),
        kinds,
        proposals,
        each,
    )
    _write(config, found)
    return found


def proposed(trace: Traced, count: int, rng: np.random.Generator) -> Proposals[Any]:
    """Up to `count` motions of the traced machine, simulated by its twin; raises a `SerpentError` where
    no motion keeps its limits.
    """
    machine: Any = trace.case.machine
    from serpent_twin.machines.model import proposing
    from serpent_twin.recording import arm_motions

    of = arm_motions if trace.rig == ARM else proposing
    return of.propose(machine, trace.fit.point, count, PIECE, trace.rate_hz, rng)


def questions(trace: Traced, rivals: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Effects, each with its rival or none: the rivals given, else what the trace left open, else every
    candidate.
    """
    known = [name for name in trace.case.candidates if name not in trace.case.unseen]
    if unknown := [name for name in rivals if name not in known]:
        raise SerpentError(
            f"--rivals {' '.join(unknown)}: no such effect of this machine. There are: {', '.join(known)}."
        )
    if rivals:
        if len(set(rivals)) != len(rivals) or len(rivals) < 2:
            raise SerpentError("--rivals needs the names of two or more different effects.")
        return [(one, other) for n, one in enumerate(rivals) for other in rivals[n + 1 :]]
    asked = [
        (each["effect"], each["rival"] or "")
        for each in trace.diagnosis.get("next_motion", [])
        if each["effect"] in known and (not each["rival"] or each["rival"] in known)
    ]
    if asked:
        alone = [(effect, "") for effect, rival in asked if rival]  # it must still show
        return list(dict.fromkeys([*asked, *alone]))
    print("This trace left nothing open; the motion is one that shows every candidate effect.")
    return [(name, "") for name in known if name not in trace.fit.point.effects]


def _confirmed(question: Question, known: Array, trace: Traced) -> Question:
    """A question with what the trace says of it: the chance of its answer, or that it is not named."""
    for each in trace.diagnosis.get("next_motion", []):
        chance = each.get("probability_of_chance")
        same = (each["effect"], each["rival"] or "") == (question.effect, question.rival)
        if same and chance is not None:
            return question.confirmed(known, chance)
    return question if question.effect in trace.fit.point.effects else question.hidden(known)


def _write(config: Plan, found: Planned) -> None:
    config.out.parent.mkdir(parents=True, exist_ok=True)
    motion.write(config.out, found.motion)
    table = plan_page.decides(found.questions, found.before, found.after)
    facts: dict[str, Any] = {"trace": str(config.trace), "seed": str(config.seed)}
    report = write(
        plan_page.page(found.motion, table, found.kinds, found.proposals, facts),
        config.out.with_suffix(""),
    )
    print(text_table(table))
    print(table.note)
    print(
        f"{config.out}: the motion, {len(found.motion.targets)} control steps. {report}: the report."
    )
