"""Write the pages of docs/results/, and reports of runs, from what the measuring commands stored.

A command that measures is a package with a module `result_page`; its function of that name lays out its
results. From this one layout come the page, with the results beside it as JSON, and the run's report. This
command writes pages again from the results beside them alone.
"""

import importlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from serpent_twin import stored
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed
from serpent_twin.runs import report
from serpent_twin.runs.files import json_text, write_json, write_whole
from serpent_twin.runs.provenance import provenance
from serpent_twin.runs.report import Figure, Section, as_png, sections_in_markdown

PAGES = Path(__file__).resolve().parents[1] / "docs" / "results"
_ORIGIN = ("measured_by", "date", "versions", "git_commit")


@dataclass(frozen=True)
class PageContent:
    """What a page says besides where its numbers come from."""

    title: str
    """The heading"""
    command: str
    """The command that measures all of it again, as it is typed"""
    data: str
    """What was measured"""
    sections: tuple[Section, ...]
    """Text, tables and figures"""
    lead: str = ""
    """What was found, in a sentence or two; on reports alone"""


@dataclass(frozen=True)
class ResultPage(Checked):
    """Write pages of results again, from the results stored beside them."""

    pages: tuple[Path, ...] = ()
    """Pages, such as docs/results/speed.md; without, all that have results beside them."""


def main(config: ResultPage) -> None:  # noqa: D103 tyro would print it above the config's own
    for page in config.pages or sorted(path.with_suffix(".md") for path in PAGES.glob("*.json")):
        if not results_of(page).exists():
            raise SerpentError(
                f"{results_of(page)} does not exist. The command that measures writes it, with --page {page}."
            )
        publish(stored.read_json(results_of(page)), page)
        print(page)


def results_of(page: Path) -> Path:
    """Where the results of a page lie."""
    return page.with_suffix(".json")


def store(path: Path, package: str, figures: Mapping[str, Any]) -> dict[str, Any]:
    """Write a package's results.json and return it; figures that it already has keep date and commit."""
    found = json.loads(json_text(figures))
    if path.exists():
        before = stored.read_json(path)
        if {name: each for name, each in before.items() if name not in _ORIGIN} == found:
            return before
    today = datetime.now(UTC).date().isoformat()
    results = found | {"measured_by": package, "date": today} | provenance()
    write_json(path, results)
    return results


def publish(results: Mapping[str, Any], page: Path | None) -> None:
    """Write the page of some results, its figures and, beside it, the results; nothing without a path."""
    if page is None:
        return
    page.parent.mkdir(parents=True, exist_ok=True)
    blocks = [block for section in _made(results).sections for block in section.blocks]
    for figure in (block for block in blocks if isinstance(block, Figure)):
        (page.parent / "figures").mkdir(exist_ok=True)
        write_whole(page.parent / "figures" / f"{figure.name}.png", as_png(figure.drawing))
    write_json(results_of(page), results)
    write_whole(page, markdown(results))


def write_report(results: Mapping[str, Any], out: Path, *more: Section) -> str:
    """Write the report of some results, with more sections; returns where it is, and its lead."""
    page = _made(results)
    made = report.Report(page.title, page.lead, (*page.sections, *more), _head(page, results))
    return f"{report.write(made, out)}: {page.lead}"


def markdown(results: Mapping[str, Any]) -> str:
    """The page of some results."""
    page = _made(results)
    head = _head(page, results) | {"command": f"`{page.command}`"}
    rows = "\n".join(f"| {name} | {text} |" for name, text in head.items())
    return (
        f"# {page.title}\n\n| | |\n| --- | --- |\n{rows}\n\n{sections_in_markdown(page.sections)}\n"
    )


def failures(title: str, results: Mapping[str, Any]) -> tuple[Section, ...]:
    """A section with a paragraph for each trial that failed; none where all succeeded."""
    told = [f"{name}: {why}" for name, why in results["failed"].items()]
    return (Section(title, "\n\n".join(told)),) if told else ()


def _head(page: PageContent, results: Mapping[str, Any]) -> dict[str, str]:
    """Where a page's numbers come from."""
    return {
        "command": page.command,
        "data": page.data,
        "measured": f"{results['date']}, commit {results['git_commit']}",
        "versions": report.versions_text(results),
    }


def left_on(page: Path | None) -> dict[str, Any]:
    """What an earlier run left beside a page, for the machines that are not measured again; or nothing."""
    if page is None or not results_of(page).exists():
        return {}
    return dict(stored.read_json(results_of(page)))


def traced_by_commit(found: Mapping[str, Mapping[str, Any]]) -> str:
    """The machines of some results, with the commits that traced them where these differ."""
    commits = list(dict.fromkeys(of.get("git_commit", "") for of in found.values()))
    if len(commits) == 1:
        return ", ".join(found)
    of_each = (
        (commit, listed(name for name, of in found.items() if of.get("git_commit", "") == commit))
        for commit in commits
    )
    return ", ".join(f"{names} traced by commit {commit}" for commit, names in of_each)


def _made(results: Mapping[str, Any]) -> PageContent:
    module = importlib.import_module(f"{results['measured_by']}.result_page")
    made: Callable[[Mapping[str, Any]], PageContent] = module.result_page
    return made(results)


if __name__ == "__main__":
    cli.run(main)
