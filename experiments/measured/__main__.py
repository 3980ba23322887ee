"""Measure whether the loop finds what the twins of real, measured machines lack.

Traces each machine's logs on splits that are fixed beforehand, scores on runs that nothing was fitted to, and
sets beside them a plain regression on the same split and what others published. Where something was changed
about a machine, traces what.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.measured.benchmark import BENCHMARKS, rig_of
from experiments.measured.changed import changed
from experiments.measured.named import judge
from experiments.measured.regression import regressions
from experiments.measured.result_page import (
    effect_told,
    errors_table,
    lacked_table,
    pictures,
    rejected,
)
from experiments.measured.split import Asked, asked, inner, judged_by
from experiments.result_page import left_on, publish, store, write_report
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.identification import Trace
from serpent_twin.identification.run import trace_sessions
from serpent_twin.runs.provenance import git_commit
from serpent_twin.runs.report import text_table
from serpent_twin.tables.log import Log

STAGES = ("nominal", "calibrated", "corrected")


@dataclass(frozen=True)
class Measured(Checked):
    """Close the loop on measured logs of real machines."""

    data: Path
    """Folder with one folder of logs for each machine, by its rig's name."""
    out: Path = Path("measured")
    """Folder for results; the same command goes on where it stopped."""
    held_out: str = ""
    """Files that judge in place of the splits, wherever they lie, such as 'new/kp400_*.parquet'. Effects are
    chosen by a split of the other runs, then fitted to all of these. If files of this machine may be of it
    after a change, each is also searched for what was changed.
    """
    seed: Seed = 0
    """Seed of bootstrap and permutations."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/measured-machines.md; machines that are not
    among the data stay there as an earlier run left them."""


def main(config: Measured) -> None:  # noqa: D103 tyro would print it above the config's own
    config.out.mkdir(parents=True, exist_ok=True)
    several = asked(config.data, config.held_out)
    found = {name: _bench(config, name, each) for name, each in several.items()}
    settings = {"held_out": config.held_out, "seed": config.seed}
    figures = {"rigs": found, "settings": settings}
    results = store(config.out / "results.json", "experiments.measured", figures)
    for table in (errors_table(found), lacked_table(found)):
        print(f"{text_table(table)}\n")
    print(write_report(results, config.out, *pictures(found)))
    publish(results | {"rigs": _beside_earlier(config, found)}, config.page)


def _beside_earlier(config: Measured, found: dict[str, Any]) -> dict[str, Any]:
    """The machines measured now, and on the page of the usual splits those that an earlier run left there."""
    if config.held_out:
        return found
    every = left_on(config.page).get("rigs", {}) | found
    return {name: every[name] for name in BENCHMARKS if name in every}


def _bench(config: Measured, name: str, runs: Asked) -> dict[str, Any]:
    """A machine's entry in results.json: its first split, then every split, their spread, and changes."""
    bench = BENCHMARKS[name]
    scored = [_split(config, name, *each) for each in runs.splits]
    corrected = [each["corrected"] for each in scored]
    training, judging = runs.splits[0]
    twin = _folder(config, name, judging) / "twin.json"
    unchanged = training if config.held_out else [*training, *judging]
    return {
        "metric": bench.metric.name,
        **scored[0],
        "reference": bench.reference,
        "reference_by": bench.reference_by,
        "sketch": bench.sketch,
        "spread": [min(corrected), max(corrected)],
        "splits": scored,
        "git_commit": git_commit(),
        "changed": changed(
            rig_of(name, config.data), twin, unchanged, runs.changed, config.out, config.seed
        ),
    }


def _split(config: Measured, name: str, training: list[Log], judging: list[Log]) -> dict[str, Any]:
    """One split's entry in results.json."""
    files, rig = judged_by(judging), rig_of(name, config.data)
    bench, out = BENCHMARKS[name], _folder(config, name, judging)
    chosen_by = inner(training, bench) if config.held_out else (training, judging)
    wanted = Trace((config.data / name,), out, rig=name, seed=config.seed, judge=", ".join(files))
    found, numbers = trace_sessions(wanted, rig, *chosen_by)
    compared, effects = found.comparisons, numbers["effects"]
    if config.held_out:
        judged = judge(rig, out / "twin.json", training, judging)
        compared = judged.comparisons
        effects = [
            {"name": n, "parameters": {p: vars(e) for p, e in each.items()}}
            for n, each in judged.effects.items()
        ]
    return {
        **{stage: bench.metric.of(compared[stage]) for stage in STAGES},
        "effects": [each["name"] for each in effects],
        "found": [effect_told(each) for each in effects],
        "stand_ins": [effect_told(each) for each in numbers["stand_ins"]],
        "rejected": rejected(found),
        "regression": regressions(name, training, judging, bench.metric),
        "unexplained": found.unexplained.depends_on,
        "held_out": files,
        "seconds": numbers["seconds"],
        "report": str((out / "report.html").relative_to(config.out)),
    }


def _folder(config: Measured, name: str, judging: Sequence[Log]) -> Path:
    """Where a split's trace leaves its results."""
    names = [each.removesuffix(".parquet").removesuffix("*") for each in judged_by(judging)]
    return config.out / name / "_".join(sorted(names))[:80]


if __name__ == "__main__":
    cli.run(main)
