"""Measure how many windows of the arm a readout from simulation needs."""

import re
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import Estimator, load
from serpent_twin.estimators.adapted import Adapted, least_windows
from serpent_twin.numerals import counted
from serpent_twin.readouts.windows import Windows, cut
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sessions import read_folder
from serpent_twin.tables.repeated import refuse_repeated
from serpent_twin.training.split import Split, split
from serpent_twin.training.training_run import COST, judged, training_time

FOLDER, SETTINGS, SCORES = "adapted", "adapt.json", "scores.json"
NONE, ALL = "0", "all"
SAME_RATE = 1.05
_AGAIN = "Delete it, and the same command with --adapt makes it again."


@dataclass(frozen=True)
class Adaptation:
    """Logs of an arm: its first windows correct readouts trained elsewhere, its test sessions score them."""

    logs: Path
    """Folder with the arm's session logs"""
    sessions: Split
    """Its sessions; windows are taken from the training sessions, then from the validation sessions"""
    counts: tuple[str, ...]
    """Numbers of windows, or `all`; 0 is the readout as it was trained"""
    window: int
    """Rows in a window, H"""
    drop: int
    """First rows of each session that are left out"""

    @cached_property
    def learn(self) -> Windows:
        """All windows for training."""
        return cut([*self.sessions.train, *self.sessions.validate], self.window, self.drop)

    @cached_property
    def test(self) -> Windows:
        """The test windows."""
        return cut(self.sessions.test, self.window, self.drop)

    def settings(self) -> dict[str, Any]:
        """What two adaptations must share to lie in one folder."""
        inputs = {s.name: file_hash(s.path) for s in self.sessions.all() if s.path}
        return {"drop": self.drop, "sessions": self.sessions.names(), "input_sha256": inputs}

    def refuse(self, trained_on: Split) -> None:
        """Refuse in a sentence what cannot be done, before anything is trained."""
        rates = [{session.rate_hz for session in of.all()} for of in (trained_on, self.sessions)]
        if max(set.union(*rates)) > SAME_RATE * min(set.union(*rates)):
            told = [" and ".join(f"{rate:g}" for rate in sorted(of)) for of in rates]
            raise SerpentError(
                f"the logs to train on come at {told[0]} Hz, {self.logs} at {told[1]} Hz: a window would "
                "span another time. Collect with --rate-hz as the arm was logged."
            )
        refuse_repeated([*trained_on.all(), *self.sessions.all()])
        there, least = len(self.learn.x), least_windows(self.window)
        for count in map(int, set(self.counts) - {NONE, ALL}):
            if not least <= count <= there:
                raise SerpentError(
                    f"--adapt-windows {count}: {self.logs} has {counted(there, 'window')} to adapt "
                    f"to, and fewer than "
                    f"{least} are too few to learn from. Give 0, a number from {least} to {there}, or all."
                )


def read(
    logs: Path,
    windows: str,
    window: int,
    drop: int,
    validate: Sequence[str] = (),
    test: Sequence[str] = (),
) -> Adaptation:
    """The adaptation that the options request."""
    sessions = split(read_folder(logs), validate, test)
    return Adaptation(logs, sessions, parse_counts(windows), window, drop)


def parse_counts(text: str) -> tuple[str, ...]:
    """Numbers of windows out of `0,100,all`, in order; 0 is always among them."""
    if not re.fullmatch(r"(\d+|all)(,(\d+|all))*", text):
        raise SerpentError(f"--adapt-windows {text} is no list of numbers; write 0,100,500,all.")
    return _ordered({NONE, *(w if w == ALL else str(int(w)) for w in text.split(","))})


def _ordered(counts: set[str]) -> tuple[str, ...]:
    return tuple(sorted(counts, key=lambda count: np.inf if count == ALL else int(count)))


def adapt(plan: Adaptation, names: Sequence[str], out: Path) -> dict[str, Any]:
    """Adapt the readouts in out/models, keep them in out/adapted/N/NAME; returns all scores on the arm.

    Readouts that an interrupted or an earlier run adapted are kept, and scored with the rest.
    """
    folder = out / FOLDER
    with claimed(folder, SETTINGS, plan.settings()):
        found: dict[str, dict[str, Any]] = {}
        before = {path.name for path in folder.iterdir() if path.is_dir()}
        counts = _ordered({*plan.counts, *before})
        jobs = [(name, count) for name in names for count in counts]
        for name, count in tqdm(jobs, desc="adapting", unit="readout"):
            base = load(out / "models" / name, plan.window)
            found.setdefault(name, {})[count] = _scored(plan, base, count, folder / count / name)
        scores = {
            "logs": str(plan.logs),
            "test_sessions": plan.sessions.names()["test"],
            "windows": found,
            "provenance": plan.settings(),
        }
        write_json(folder / SCORES, scores)
        return scores


def earlier(out: Path) -> dict[str, Any] | None:
    """Readouts that an earlier run adapted in this folder: they stay in the report."""
    path = out / FOLDER / SCORES
    if not path.exists():
        return None
    found = stored.read_json(path, advice=_AGAIN)
    stored.take(found, _StoredScores, str(path), _AGAIN)
    return found


class _StoredScore(stored.OpenForm, frozen=True):
    """A readout's scores on the arm, as the report shows them."""

    mean_mm: float
    std_mm: float
    tip_mm: float
    latency_ms: float
    train_s: float
    real_windows: int


class _StoredScores(stored.Form, frozen=True):
    """What scores.json of an adaptation holds."""

    logs: str
    test_sessions: tuple[str, ...]
    windows: dict[str, dict[str, _StoredScore]]
    provenance: dict[str, Any]

    def __post_init__(self) -> None:
        counts = sorted({count for of in self.windows.values() for count in of})
        if odd := [count for count in counts if not re.fullmatch(r"\d{1,9}|all", count)]:
            raise SerpentError(f"windows has {stored.names(odd)}, which is no number of windows.")


def _scored(plan: Adaptation, base: Estimator, count: str, folder: Path) -> dict[str, Any]:
    """Scores of the readout, adapted to a number of windows of the arm."""
    estimator, windows, took = base, 0, 0.0
    if count != NONE:
        few = plan.learn if count == ALL else plan.learn.first(int(count))
        if not (folder / COST).exists():
            _train(base, few, plan.test, folder)
        estimator, windows = load(folder, plan.window), len(few.x)
        took = training_time(folder)
    result = judged(estimator, plan.test, took)
    cost = {"train_s": took, "latency_ms": result.latency_ms, "real_windows": windows}
    return asdict(result.scores) | result.certain | cost


def _train(base: Estimator, few: Windows, test: Windows, folder: Path) -> None:
    """Learn the correction and save it, the cost last: an interrupted one is done again."""
    adapted = Adapted.of(base)
    began = time.perf_counter()
    adapted.fit(few, few, np.random.default_rng(0))
    cost = {"train_s": time.perf_counter() - began}
    adapted.tested_on = (*base.trained.tested_on, *test.sources("test"))
    adapted.save(folder)
    write_json(folder / COST, cost, indent=None)
