"""Write the errors before and after the loop was closed as a page."""

from collections.abc import Mapping
from typing import Any

from experiments.close_the_loop.page import table, unexplained
from experiments.result_page import PageContent, traced_by_commit
from serpent_twin.numerals import counted
from serpent_twin.reporting.report import Section


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    arms, settings = results["arms"], results["settings"]
    command = "python -m experiments.close_the_loop --logs LOGS"
    command += f" --sessions {settings['sessions']} --out close_the_loop"
    data = "; ".join(
        f"{name}: {counted(len(files), 'session')}, judged by {', '.join(arms[name]['held_out'])}"
        for name, files in settings["input_sha256"].items()
    )
    if len({arm.get("git_commit") for arm in arms.values()}) > 1:
        data += f"; {traced_by_commit(arms)}"
    sections = [Section("", "", (table(arms),))]
    if left := unexplained(arms):
        sections.append(Section("What stays unexplained", left))
    return PageContent(
        f"Closing the loop on {counted(len(arms), 'arm')}", command, data, tuple(sections)
    )
