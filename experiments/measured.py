"""Does the loop find what the twins of real, measured machines lack?

Traces each machine's logs on splits that are fixed below, scores on runs that nothing was fitted to, and
sets beside them a plain regression on the same split and what others published.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from measured_metric import MAE, RMSE, Metric
from measured_named import judge
from measured_page import page, table
from measured_regression import regressions

from serpent_twin import cli, rigs
from serpent_twin.errors import SerpentError
from serpent_twin.files import write_whole
from serpent_twin.measured import Recording
from serpent_twin.provenance import provenance
from serpent_twin.report import text_table, write
from serpent_twin.trace import Trace
from serpent_twin.trace.run import trace_sessions

STAGES = ("nominal", "calibrated", "corrected")


@dataclass(frozen=True)
class Bench:
    """A machine's data, and how its twin is judged."""

    metric: Metric
    """Of its error"""
    splits: tuple[tuple[str, ...], ...]
    """Names of the files held out in each; the first is the one reported"""
    reference: float
    """What the authors published, in the metric"""
    sketch: float
    """What a small simulator or regression with the effects expected here reached"""
    origin: str
    """Where the original recordings are"""


BENCHES: Mapping[str, Bench] = {
    "xl330": Bench(
        MAE,
        (("kp200_*",), ("kp100_*",), ("kp800_*",)),
        1.77,
        2.45,
        "github.com/Rhoban/bam, branch xl330, commit af22604",
    ),
    "jaw": Bench(
        RMSE,
        (("tool_*_12.*", "tool_*_30.*", "tool_*_23.*"), ("tool_*_4?.*",)),
        0.37,
        0.44,
        "github.com/MRDLab/mis-tool-characterization, commit 03658b2",
    ),
}


@dataclass(frozen=True)
class Measured:
    """Close the loop on measured logs of real machines."""

    data: Path
    """Folder with one folder of logs for each machine, by its rig's name."""
    out: Path = Path("measured")
    """Folder for results; the same command goes on where it stopped."""
    held_out: str = ""
    """Files that judge in place of the splits, wherever they lie, such as 'new/kp400_*.parquet'. Effects are
    chosen by a split of the other runs, then fitted to all of these.
    """
    seed: int = 0
    """Of bootstrap and permutations."""


def main(config: Measured) -> None:  # noqa: D103 tyro would print it above the config's own
    config.out.mkdir(parents=True, exist_ok=True)
    found = {name: _bench(config, name, splits) for name, splits in _asked(config).items()}
    text = json.dumps({"rigs": found} | provenance(), indent=1)
    write_whole(config.out / "results.json", text + "\n")
    print(text_table(table(found)))
    report = page(found)
    print(f"{write(report, config.out)}: {report.lead}")


def _asked(config: Measured) -> dict[str, list[tuple[list[Recording], list[Recording]]]]:
    """Training and judging runs of each split of each machine whose data are there."""
    if config.held_out:
        return dict([_named(config)])
    asked, missing = {}, []
    for name, bench in BENCHES.items():
        if not any((config.data / name).glob("*.parquet")):
            missing.append(
                f"{config.data / name} holds no *.parquet ({bench.origin} has the originals)"
            )
            continue
        runs = rigs.find(name).read(config.data / name)
        asked[name] = [split(runs, patterns) for patterns in _fitting(runs, bench)]
    if missing:
        said = f"{'; '.join(missing)}. The README says how the logs are repacked."
        if not asked:
            raise SerpentError(said)
        print(said)
    return asked


def _fitting(runs: Sequence[Recording], bench: Bench) -> list[tuple[str, ...]]:
    """The bench's splits, as far as there are runs of these names; else every fourth run judges."""
    paths = [r.path for r in runs if r.path]
    known = [each for each in bench.splits if any(path.match(p) for path in paths for p in each)]
    return known or [tuple(path.name for path in paths[1::4])]


def split(
    runs: Sequence[Recording], patterns: Sequence[str]
) -> tuple[list[Recording], list[Recording]]:
    """Runs to fit, and runs that judge: those whose files match a pattern."""
    judging = [r for r in runs if r.path and any(r.path.match(p) for p in patterns)]
    training = [r for r in runs if r not in judging]
    if not judging or not training:
        raise SerpentError(
            f"of {len(runs)} runs, {len(judging)} are named {' or '.join(patterns)}: some must judge and "
            "some be fitted. Name those that judge: --held-out."
        )
    return training, judging


def _named(config: Measured) -> tuple[str, list[tuple[list[Recording], list[Recording]]]]:
    """The machine whose logs the named files are, with all its other runs to fit."""
    pattern = Path(config.held_out)
    files = sorted(Path(pattern.anchor).glob(str(pattern.relative_to(pattern.anchor))))
    if not files:
        raise SerpentError(
            f"--held-out {config.held_out} names no file. Give a path with wildcards."
        )
    reasons = []
    for name in BENCHES:
        try:
            judging = rigs.find(name).read_files(files)
        except SerpentError as error:
            reasons.append(str(error))
            continue
        named = {path.resolve() for path in files}
        runs = rigs.find(name).read(config.data / name)
        training = [r for r in runs if r.path and r.path.resolve() not in named]
        if not training:
            raise SerpentError(f"nothing is left to fit in {config.data / name}. Name fewer files.")
        return name, [(training, judging)]
    raise SerpentError(f"no rig reads {files[0]}: {' '.join(dict.fromkeys(reasons))}")


def _bench(
    config: Measured, name: str, splits: Sequence[tuple[list[Recording], list[Recording]]]
) -> dict[str, Any]:
    """What results.json says of a machine: its first split, then every split and their spread."""
    bench = BENCHES[name]
    scored = [_split(config, name, *each) for each in splits]
    corrected = [each["corrected"] for each in scored]
    return {
        "metric": bench.metric.name,
        **scored[0],
        "reference": bench.reference,
        "sketch": bench.sketch,
        "spread": [min(corrected), max(corrected)],
        "splits": scored,
    }


def _split(
    config: Measured, name: str, training: list[Recording], judging: list[Recording]
) -> dict[str, Any]:
    """One split's entry in results.json."""
    files = [str(r.path.name) for r in judging if r.path]
    bench, out = BENCHES[name], config.out / name / "_".join(sorted(r.name for r in judging))[:80]
    chosen_by = (training, judging)
    if config.held_out:
        inner = [split(training, each) for each in _fitting(training, bench)]
        chosen_by = max(inner, key=lambda parts: len(parts[1]))
    asked = Trace(config.data / name, out, rig=name, seed=config.seed, judge=", ".join(files))
    found, numbers = trace_sessions(asked, rigs.find(name), *chosen_by)
    compared, effects = found.comparisons, numbers["effects"]
    if config.held_out:
        judged = judge(name, out / "twin.json", training, judging)
        compared = judged.comparisons
        effects = [
            {"name": n, "parameters": {p: vars(e) for p, e in each.items()}}
            for n, each in judged.effects.items()
        ]
    return {
        **{stage: bench.metric.of(compared[stage]) for stage in STAGES},
        "effects": [each["name"] for each in effects],
        "found": [str_of(each) for each in effects],
        "rejected": [t.name for t in found.candidates if t.verdict != "accepted"],
        "regression": regressions(name, training, judging, bench.metric),
        "unexplained": found.unexplained.depends_on,
        "held_out": files,
        "seconds": numbers["seconds"],
        "report": str((out / "report.html").relative_to(config.out)),
    }


def str_of(effect: Mapping[str, Any]) -> str:
    """An effect with its numbers and intervals."""
    told = ", ".join(
        f"{n} {e['value']:.3g} [{e['low']:.3g} … {e['high']:.3g}] {e['unit']}"
        for n, e in effect["parameters"].items()
    )
    return f"{effect['name'].replace('_', ' ')} ({told})"


if __name__ == "__main__":
    cli.run(main)
