"""Split a machine's runs into those that are fitted and those that judge."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from experiments.measured.benchmark import BENCHMARKS, Benchmark, rig_of
from serpent_twin.errors import SerpentError
from serpent_twin.machines.rig import is_named
from serpent_twin.numerals import counted
from serpent_twin.tables.log import Log
from serpent_twin.tables.repeated import refuse_repeated

Split = tuple[list[Log], list[Log]]
"""Runs to fit, and runs that judge"""


@dataclass(frozen=True)
class Asked:
    """Runs of one machine."""

    splits: list[Split]
    """Splits of the machine as it was; with --held-out, what judges may be otherwise"""
    changed: list[Log]
    """Runs after something may have been changed"""


def asked(data: Path, held_out: str = "") -> dict[str, Asked]:
    """What is to be fitted and judged, of each machine whose logs are there; or by the files named."""
    if held_out:
        return dict([_named(data, held_out)])
    found, missing = {}, []
    for name, bench in BENCHMARKS.items():
        form = bench.form
        if not any(file.match(bench.unchanged) for file in (data / name).glob(form)):
            named = bench.unchanged.removesuffix("*") + form
            missing.append(f"{data / name} holds no {named} ({bench.origin} has the originals)")
            continue
        same, changed = _runs(data, name)
        alone = [by_time(same[0])] if len(same) == 1 else None
        splits = alone or [split(same, each) for each in _patterns(same, bench)]
        found[name] = Asked(splits, changed)
    if missing:
        said = (
            f"{'; '.join(missing)}. docs/results/measured-logs.md says how the logs are repacked."
        )
        if not found:
            raise SerpentError(said)
        print(said)
    return found


def split(runs: Sequence[Log], patterns: Sequence[str]) -> Split:
    """Runs to fit, and runs that judge: those who have, or whose files have, a name of a pattern."""
    judging = [r for r in runs if any(is_named(r, p) for p in patterns)]
    training = [r for r in runs if r not in judging]
    if not judging or not training:
        raise SerpentError(
            f"of {counted(len(runs), 'run')}, {len(judging)} are named {' or '.join(patterns)}: "
            f"some must judge and "
            "some be fitted. Name those that judge: --held-out."
        )
    return training, judging


def judged_by(judging: Sequence[Log]) -> list[str]:
    """The files that judge; of files that hold several runs, what the runs' names have in common, if any."""
    first, last = min(r.name for r in judging), max(r.name for r in judging)
    same = takewhile(lambda pair: pair[0] == pair[1], zip(first, last, strict=False))
    common = "".join(one for one, _ in same).rstrip()
    files = list(dict.fromkeys(r.path.name for r in judging if r.path))
    alone = all(r.path and r.path.stem == r.name for r in judging)
    return files if files and (alone or not common) else [common + "*"]


def inner(training: Sequence[Log], bench: Benchmark) -> Split:
    """The split of training runs that chooses effects: the one in which most judge, or of one run."""
    if len(training) == 1:
        return by_time(training[0])
    parts = [split(training, each) for each in _patterns(training, bench)]
    return max(parts, key=lambda part: len(part[1]))


def by_time(run: Log, share: float = 0.6) -> Split:
    """The beginning of a run to fit, and its rest, which keeps its time, to judge."""
    rows = round(share * len(run))
    at = run.columns["time"][rows]

    def part(which: slice, label: str) -> Log:
        columns = {name: values[which] for name, values in run.columns.items()}
        return replace(run, columns=columns, label=label)

    return (
        [part(slice(rows), f"{run.name} before {at:.0f} s")],
        [part(slice(rows, None), f"{run.name} from {at:.0f} s")],
    )


def _runs(data: Path, name: str) -> Split:
    """A machine's runs as it was, and after something was changed."""
    runs: Sequence[Any] = rig_of(name, data).read(data / name)
    unchanged = BENCHMARKS[name].unchanged
    same = [r for r in runs if r.path.match(unchanged)]
    if not same:
        raise SerpentError(
            f"{data / name} holds no {unchanged}: files of that name are of the machine before anything "
            "was changed, which is fitted first. Name yours so."
        )
    return same, [r for r in runs if r not in same]


def _patterns(runs: Sequence[Log], bench: Benchmark) -> list[tuple[str, ...]]:
    """The bench's splits, as far as there are runs of these names; else every fourth run judges."""
    known = [each for each in bench.splits if any(is_named(r, p) for r in runs for p in each)]
    return known or [tuple(r.path.name for r in runs[1::4] if r.path)]


def _named(data: Path, held_out: str) -> tuple[str, Asked]:
    """The machine whose logs the named files are, with all its other runs as it was to fit."""
    pattern = Path(held_out)
    files = sorted(Path(pattern.anchor).glob(str(pattern.relative_to(pattern.anchor))))
    if not files:
        raise SerpentError(f"--held-out {held_out} names no file. Give a path with wildcards.")
    reasons = []
    for name, bench in BENCHMARKS.items():
        try:
            rig = rig_of(name, data)
            judging = [run for path in files for run in rig.read(path)]
        except SerpentError as error:
            reasons.append(str(error))
            continue
        named = {path.resolve() for path in files}
        training = [r for r in _runs(data, name)[0] if r.path and r.path.resolve() not in named]
        if not training:
            raise SerpentError(f"nothing is left to fit in {data / name}. Name fewer files.")
        refuse_repeated([*training, *judging])
        changed = judging if bench.unchanged != "*" else []
        return name, Asked([(training, judging)], changed)
    raise SerpentError(f"no rig reads {files[0]}: {' '.join(dict.fromkeys(reasons))}")
