"""Measure how near arms keep to paths without a camera in the loop: `python -m experiments.follow`.

Arms are those of `bench_arm`, which shares no physics with the twin, each with an effect that nobody has
declared, and the twin that a trace of its logs wrote.
"""

from functools import partial
from typing import Any

import numpy as np

from experiments.follow.over_device import over_device
from experiments.follow.paths import PATHS
from experiments.follow.trial import FIRST, WAYS, FollowStudy, rms, run_arm
from experiments.result_page import publish, store
from experiments.result_rows import Results
from experiments.study_arms import traced_arms
from serpent_twin.command_line import cli
from serpent_twin.numerals import counted
from serpent_twin.runs.provenance import file_hash
from serpent_twin.runs.run_lock import claimed

SETTINGS = "follow_study.json"


def main(config: FollowStudy) -> None:  # noqa: D103 tyro would print it above the config's own
    arms = traced_arms(config.study, config.arms)
    settings = {"study_sha256": file_hash(config.study / "confusion.json")}
    with claimed(config.out, SETTINGS, settings):
        results = Results(config.out / "results.jsonl")
        results.complete(arms, partial(run_arm, config), _line, config.workers)
        rows = results.scored
        if not rows:
            return
        for path in PATHS:
            if count := len(rms(rows, path, WAYS[0])):
                told = ", ".join(f"{way} {np.median(rms(rows, path, way)):.1f}" for way in WAYS)
                print(f"{path}: {told} mm rms, median of {counted(count, 'arm')}")
        figures = {"rows": rows, "failed": results.failed, "settings": settings}
        if config.device:
            first = next(arm for arm in arms if arm.id == rows[0]["id"])
            figures["device"] = over_device(first, config.out / "device")
        publish(store(config.out / "results.json", "experiments.follow", figures), config.page)


def _line(row: dict[str, Any]) -> str:
    told = ", ".join(f"{way} {row['paths'][FIRST][way]['rms']:.1f}" for way in WAYS)
    return f"{row['id']:20} {FIRST}: {told} mm"


if __name__ == "__main__":
    cli.run(main)
