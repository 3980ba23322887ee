"""Write what a planned motion is worth as a page."""

from collections.abc import Callable, Mapping
from functools import partial
from operator import itemgetter
from typing import Any

from experiments.next_motion.score import (
    Row,
    ahead,
    answer,
    decided,
    right,
    share,
    share_right,
    wrong,
)
from experiments.next_motion.trial import BEFORE, GROUPS, PLANNED, RANDOM, STAGES
from experiments.result_page import PageContent, failures
from serpent_twin.identification.wording import spaced
from serpent_twin.numerals import counted
from serpent_twin.runs.report import Section, Table

_HEAD = {
    BEFORE: "one recording",
    RANDOM: "and one of random targets",
    PLANNED: "and one of the planned motion",
}


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    rows, settings = results["rows"], results["settings"]
    minutes = settings["minutes"]
    command = (
        f"python -m experiments.next_motion --minutes {minutes:g} --level {settings['level']:g}"
    )
    if settings["seed"]:
        command += f" --seed {settings['seed']}"
    data = (
        f"{counted(len(rows), 'arm')} of `bench_arm`, which shares no physics with the twin; a recording "
        f"is two sessions of {minutes:g} minutes"
    )
    text = (
        "Each arm has one effect that can be confused with others, at about "
        f"{settings['level']:g} times the strength that an arm of this size shows clearly. It was traced "
        "from one recording of random targets, then with a second recording: of random targets again, or of "
        "the motion that `serpent-twin plan` made of the first trace. The last session of each is "
        "held out. An effect counts as named if it is named and nothing else is."
    )
    return PageContent(
        "The next motion",
        command,
        data,
        (
            Section("", text, (_rates(rows),)),
            Section("By group", "", (_groups(rows),)),
            Section("Arms", "", (_arms(rows),)),
            *failures("Arms that could not be traced", results),
        ),
    )


def _by_stage(first: Mapping[str, Any], cell: Callable[[Any, str], str]) -> dict[str, Any]:
    """Columns: the first ones, then one for each stage."""
    return {**first, **{_HEAD[stage]: partial(cell, stage=stage) for stage in STAGES}}


def _rates(rows: list[Row]) -> Table:
    measures = {
        "named, and nothing else": right,
        "named, and every rival told apart": decided,
        "an effect named that is not there": wrong,
    }

    def cell(measure: tuple[str, Any], stage: str) -> str:
        return str(share(rows, lambda row: measure[1](row, stage)))

    first, second, chance = ahead(rows, PLANNED, RANDOM)
    note = (
        f"In brackets, 95 % intervals. The planned motion alone had {first} right, the random targets alone "
        f"{second}; a split as uneven has the probability {chance:.2g} by chance (McNemar's exact test)."
    )
    return Table.of(measures.items(), _by_stage({"": itemgetter(0)}, cell), note)


def _groups(rows: list[Row]) -> Table:
    def cell(group: tuple[str, ...], stage: str) -> str:
        return str(share_right([row for row in rows if row["name"] in group], stage))

    return Table.of(
        GROUPS, _by_stage({"effects": lambda group: ", ".join(map(spaced, group))}, cell)
    )


def _arms(rows: list[Row]) -> Table:
    def cell(row: Row, stage: str) -> str:
        return spaced(answer(row["answers"][stage]))

    return Table.of(rows, _by_stage({"arm": "{id}", "strength": "{strength:.3g}"}, cell))
