"""Freeze what the package answers: record the answers of some commands, or check that they are the same.

A case is a trace of an arm, of a measured machine or of a public model, or a session of the simulated bus.
Names, places and verdicts must be equal, strengths within 0.2 standard errors, held-out errors within 2 %.
"""

import json
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.frozen_cases import ROOT, FrozenCase, find, run
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.runs.files import write_whole

GOLDEN = ROOT / "benchmarks" / "frozen.json"
MAX_SHIFT = 0.2  # of a strength, in standard errors
MAX_ERROR_CHANGE = 0.02
LOG_DIGITS = 1e-6
"""Relative tolerance of a session log's numbers: another machine may compute other last bits"""
ROUNDING = 1e-5
"""Relative rounding of the numbers in the file"""


@dataclass(frozen=True)
class Frozen(Checked):
    """Compare the package's answers with recorded ones."""

    only: tuple[str, ...] = ()
    """Names of cases; without, all that the file holds, or to record: all that it does not hold."""
    tree: Path = ROOT
    """Checkout whose code answers."""
    golden: Path = GOLDEN
    """File of the answers."""
    shared: Path = ROOT.parent / "shared"
    """Folder of logs that are no part of the project; cases without their logs are left out."""
    made: Path = Path(tempfile.gettempdir()) / "frozen_logs"
    """Folder for the logs that are made."""

    def answer(self, case: FrozenCase) -> dict[str, Any]:
        """What the checkout answers now."""
        return run(case, *(path.resolve() for path in (self.tree, self.shared, self.made)))


def record_command(config: Frozen) -> None:
    """Record answers, each as soon as it is there; a run that was interrupted goes on."""
    answers = _read(config.golden)
    cases = [case for case in find(config.only) if config.only or case.name not in answers]
    for case in _there(cases, config.shared, answers):
        answers[case.name] = config.answer(case)
        _write(config.golden, answers)
        print(f"{case.name}: recorded, {answers[case.name]['processor_s']} s", flush=True)


def check_command(config: Frozen) -> None:
    """Run cases again and compare; the status is 1 on a difference."""
    answers, cases, same = _read(config.golden), find(config.only), True
    if missing := [case.name for case in cases if config.only and case.name not in answers]:
        raise SerpentError(f"{config.golden} holds no {', '.join(missing)}. Record it first.")
    for case in _there([c for c in cases if c.name in answers], config.shared, answers):
        before = answers[case.name]
        try:
            after = config.answer(case)
        except SerpentError as error:
            same, said = False, str(error)
        else:
            changed = differences(before, after)
            same = same and not changed
            took = f"{after['processor_s']} s of processor time, {before['processor_s']} s before"
            said = f"{'; '.join(changed) or 'the same'} ({took})"
        print(f"{case.name}: {said}", flush=True)
    if not same:
        sys.exit(1)


def differences(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Sentences on what is not the same in two answers."""
    return [f"{what}: {now}, was {was}" for what, was, now in _unlike(before, after)]


def _unlike(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """What differs, before and after. Composed laws that were rejected are left out: their order, and thus
    which are listed, hangs on last digits.
    """
    if "columns" in before:
        yield from _unlike_columns(before["columns"], after["columns"])
        return
    for key in ("unexplained", "moved"):
        if before[key] != after[key]:
            yield key, before[key], after[key]
    for name in sorted({*before["verdicts"], *after["verdicts"]}):
        was, now = (of["verdicts"].get(name, "no candidate") for of in (before, after))
        if was != now:
            yield name, was, now
    for key in ("effects", "stand_ins"):
        if sorted(before[key]) != sorted(after[key]):
            yield key, " + ".join(before[key]) or "none", " + ".join(after[key]) or "none"
        for name in before[key].keys() & after[key].keys():
            yield from _unlike_strengths(name, before[key][name], after[key][name])
    for key, was in before["errors"].items():
        for stage, value in was.items():
            now = after["errors"].get(key, {}).get(stage)
            if not _near(value, now, MAX_ERROR_CHANGE * abs(value or 0.0)):
                yield f"{stage} {key}", value, now


def _unlike_strengths(
    name: str, before: Mapping[str, Any], after: Mapping[str, Any]
) -> Iterator[tuple[str, Any, Any]]:
    for parameter in sorted({*before, *after}):
        was, error = before.get(parameter, (None, 0.0))
        now, _ = after.get(parameter, (None, 0.0))
        allowed = max(MAX_SHIFT * (error or 0.0), ROUNDING * abs(was or 0.0))
        if not _near(was, now, allowed):
            yield f"{parameter} of {name} (± {error:.3g})", was, now


def _unlike_columns(
    before: Mapping[str, Any], after: Mapping[str, Any]
) -> Iterator[tuple[str, Any, Any]]:
    for name in sorted({*before, *after}):
        was, now = before.get(name), after.get(name)
        if was is None or now is None:
            yield f"column {name}", was and "there", now and "there"
            continue
        allowed = LOG_DIGITS * (abs(was[0]) + was[1]) + LOG_DIGITS**2
        if not all(_near(a, b, allowed) for a, b in zip(was, now, strict=True)):
            yield f"mean, deviation and last of {name}", was, now


def _near(was: float | None, now: float | None, allowed: float) -> bool:
    """Whether two numbers are the same; one that does not exist is only the same as another such."""
    if was is None or now is None:
        return was is now
    return was == now or abs(now - was) <= allowed or (was != was and now != now)


def _there(
    cases: list[FrozenCase], shared: Path, answers: Mapping[str, Any]
) -> Iterator[FrozenCase]:
    """Yield cases whose logs are there, after a line on each of the others and one on how long it takes."""
    missing = {case.name: case.missing(shared) for case in cases}
    for name, folder in missing.items():
        if folder:
            print(f"{name}: left out, there is no {folder}")
    there = [case for case in cases if not missing[case.name]]
    known = [answers[case.name]["processor_s"] for case in there if case.name in answers]
    unknown = f", and {len(there) - len(known)} not yet timed" if len(known) < len(there) else ""
    minutes = f"{sum(known) / 60:.1f} minutes of processor time"
    print(f"{counted(len(known), 'case')}: {minutes}{unknown}", flush=True)
    yield from there


def _read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _write(path: Path, answers: Mapping[str, Any]) -> None:
    """One line for each case."""
    lines = (
        f"{json.dumps(name)}: {json.dumps(of, ensure_ascii=False)}" for name, of in answers.items()
    )
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    write_whole(path, text)


if __name__ == "__main__":
    cli.run({"record": record_command, "check": check_command})
