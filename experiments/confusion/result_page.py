"""Write how often the trace names an injected effect as a page."""

from collections.abc import Mapping
from typing import Any

from experiments.confusion.page import aims_table, arms_table, limits_table, strengths_table
from experiments.confusion.plan import KNOWN, PAIR
from experiments.confusion.score import limits
from experiments.result_page import PageContent
from serpent_twin.numerals import listed
from serpent_twin.reporting.report import Section

_SOURCE = {
    "twin": "arms that are the twin with other parameters, which flatters it",
    "bench": "arms of `bench_arm`, with a cable law, an integration and a servo model of their own",
}
_TEXT = """Effects were injected into arms whose other parameters and noises are drawn at random;
`trace` then ran on their logs, the last session of each arm held out. "right" means that all injected
effects were named and nothing else; of an effect outside the catalogue, that the right law was discovered at
its place, or that the error was called unexplained."""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    rows, settings = results["rows"], results["settings"]
    numbers = settings["sessions"]
    size = f"--sessions {' '.join(map(str, numbers))} --steps {settings['steps']}"
    seed = f" --seed {settings['seed']}" if settings["seed"] else ""
    asked = results["asked"]
    some = f" --only {' '.join(asked['only'])}" if asked["only"] else ""
    if results["not_run"] or results["failed"]:
        some += f" --trials {len(rows)}"
    command = f"python -m experiments.confusion --source {settings['source']} {size}{seed}"
    command += f" --rounds {asked['rounds']}{some}"
    data = f"{_SOURCE[settings['source']]}; {listed(numbers)} sessions × {settings['steps']:,} steps each"
    sections = [
        Section("", _TEXT, (arms_table(rows),)),
        Section("Rates", "", (aims_table(rows, results),)),
    ]
    if any(row["kind"] in (KNOWN, PAIR) for row in rows):
        sections.append(Section("Strengths", "", (strengths_table(rows),)))
    if found := limits(rows):
        sections.append(Section("Detection limits", "", (limits_table(found),)))
    if results["failed"]:
        told = (f"{name}: {why}" for name, why in results["failed"].items())
        sections.append(Section("Arms that could not be traced", "\n\n".join(told)))
    return PageContent("Injected effects", command, data, tuple(sections))
