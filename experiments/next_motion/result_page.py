"""Write what a planned motion is worth as a page."""

from collections.abc import Mapping
from typing import Any

from experiments.next_motion.config import GROUPS
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
from experiments.next_motion.trial import BEFORE, PLANNED, RANDOM, STAGES
from experiments.result_page import PageContent
from serpent_twin.identification.figures import spaced
from serpent_twin.numerals import counted
from serpent_twin.reporting.report import Section, Table

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
    failures = [f"{name}: {why}" for name, why in results["failed"].items()]
    told = [Section("Arms that could not be traced", "\n\n".join(failures))] if failures else []
    return PageContent(
        "The next motion",
        command,
        data,
        (
            Section("", text, (_rates(rows),)),
            Section("By group", "", (_groups(rows),)),
            Section("Arms", "", (_arms(rows),)),
            *told,
        ),
    )


def _rates(rows: list[Row]) -> Table:
    head = ("", *(_HEAD[stage] for stage in STAGES))
    measures = {
        "named, and nothing else": right,
        "named, and every rival told apart": decided,
        "an effect named that is not there": wrong,
    }
    lines = tuple(
        (name, *(str(share(rows, lambda row, s=stage, m=of: m(row, s))) for stage in STAGES))
        for name, of in measures.items()
    )
    first, second, chance = ahead(rows, PLANNED, RANDOM)
    note = (
        f"In brackets, 95 % intervals. The planned motion alone had {first} right, the random targets alone "
        f"{second}; a split as uneven has the probability {chance:.2g} by chance (McNemar's exact test)."
    )
    return Table(head, lines, note)


def _groups(rows: list[Row]) -> Table:
    lines = []
    for group in GROUPS:
        some = [row for row in rows if row["name"] in group]
        lines.append((", ".join(map(spaced, group)), *(str(share_right(some, s)) for s in STAGES)))
    return Table(("effects", *(_HEAD[stage] for stage in STAGES)), tuple(lines))


def _arms(rows: list[Row]) -> Table:
    lines = tuple(
        (row["id"], f"{row['strength']:.3g}", *(spaced(answer(row["answers"][s])) for s in STAGES))
        for row in rows
    )
    return Table(("arm", "strength", *(_HEAD[stage] for stage in STAGES)), lines)
