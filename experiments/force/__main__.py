"""Measure how well forces on arms are felt by motor angles and loads alone: `python -m experiments.force`.

Arms are those of `bench_arm`, which shares no physics with the twin, and the twins those that traces of
their logs wrote.
"""

from functools import partial
from typing import Any

from experiments.force.trial import ForceStudy, run_arm
from experiments.result_page import publish, store
from experiments.result_rows import Results
from experiments.study_arms import traced_arms
from serpent_twin.command_line import cli
from serpent_twin.runs.provenance import file_hash
from serpent_twin.runs.run_lock import claimed

SETTINGS = "force_study.json"


def main(config: ForceStudy) -> None:  # noqa: D103 tyro would print it above the config's own
    arms = [arm for study in config.study for arm in traced_arms(study, config.arms)]
    hashes = [file_hash(study / "confusion.json") for study in config.study]
    settings = {"studies_sha256": hashes, "free_hours": config.free_hours}
    settings["readouts"] = list(config.readouts)
    with claimed(config.out, SETTINGS, settings):
        results = Results(config.out / "results.jsonl")
        results.complete(arms, partial(run_arm, config), _line, config.workers)
        if rows := results.scored:
            figures = {"rows": rows, "failed": results.failed, "settings": settings}
            publish(store(config.out / "results.json", "experiments.force", figures), config.page)


def _line(row: dict[str, Any]) -> str:
    found = row["random"]
    return (
        f"{row['id']:20} {found['rms_N']:.2f} N rms (least {found['least_N']:.2f}), "
        f"{row['false_contacts']} false contacts in {row['free_hours']:.1f} h"
    )


if __name__ == "__main__":
    cli.run(main)
