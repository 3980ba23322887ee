"""Push one bench arm, and score what is felt."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bench_arm.sensors import SessionSpec
from bench_arm.session import RATE, session, simulate
from experiments.force.bound import Bound, found_by_ideal
from experiments.force.learned import before, learned_errors
from experiments.result_rows import row_or_failure
from experiments.study_arms import StudyArm, observer_of
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.command_line.options import Checked
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.estimators.feeling import feeling
from serpent_twin.estimators.observer import STILL, Observer
from serpent_twin.live.contacts import Touch
from serpent_twin.runs.provenance import git_commit
from serpent_twin.sessions import Session
from serpent_twin.sim.pushes import Push, drawn
from serpent_twin.stored import many, within


@dataclass(frozen=True)
class ForceStudy(Checked):
    """Push traced bench arms, and measure how well their observers feel it."""

    study: Annotated[tuple[Path, ...], many(1, 100)]
    """Studies of experiments.confusion --source bench --keep, whose arms and twins are taken."""
    out: Path = Path("force_study")
    """Folder for results; the same command goes on where it stopped."""
    arms: Annotated[int, within(1, 1000)] = 4
    """Arms of each study at most, the first ones."""
    free_hours: Annotated[float, within(0.0, 1000.0, "h")] = 1.0
    """How long each arm moves with nothing touching it, for false contacts."""
    readouts: tuple[str, ...] = ("linear", "mlp", "lstm")
    """Readouts that learn forces from logs of the same arm, pushed in the same way."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Arms side by side."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/force.md."""


SUBSTEPS = 80
ROWS = 960
"""Rows of a session that is pushed"""
SESSIONS, PUSHES = 6, 8
"""Pushed at random: sessions, and pushes in each"""
STEP_N = 0.3
"""Size of the pushes for the contact's delay [N]"""
WEIGHT_KG = 0.05
SECOND = round(RATE)
_DROP = 20
"""First rows that are not scored"""
_READOUTS_DROP = 100
"""First rows that readouts do not estimate"""
_FREE_ROWS, _SIDE_BY_SIDE = 3600, 4
"""Rows of a session without a push, and how many run together"""


def run_arm(config: ForceStudy, arm: StudyArm) -> dict[str, Any]:
    """The row of an arm: what was felt of known pushes, of a weight, and of nothing."""
    return row_or_failure(arm, {"git_commit": git_commit()}, lambda: _felt(config, arm))


def _felt(config: ForceStudy, arm: StudyArm) -> dict[str, Any]:
    observer, seconds = observer_of(Observer, arm), ROWS / RATE
    rng = arm.trial.rng(arm.seed + 1)  # the arm itself is drawn by its seed
    random = [drawn(rng, PUSHES, seconds) for _ in range(SESSIONS)]
    steps = [_steps(rng, seconds) for _ in range(2)]
    logs = recorded(arm, [*random, *steps], ROWS, 100)
    runs = [Run(observer, log, arm) for log in logs]
    took = np.concatenate([run.took for run in runs])
    heavy = recorded(arm, [(), ()], ROWS, 200, WEIGHT_KG)
    free = round(config.free_hours * 3600 * RATE / _FREE_ROWS / _SIDE_BY_SIDE)
    alarms = sum(_false_contacts(observer, arm, n) for n in range(free))
    return {
        "random": _scores(runs[:SESSIONS]),
        "pushes": [each for run in runs[:SESSIONS] for each in run.pushes()],
        "steps": [each for run in runs[SESSIONS:] for each in run.pushes()],
        "weights": [Run(observer, log, arm).weight() for log in heavy],
        "free_hours": free * _SIDE_BY_SIDE * _FREE_ROWS / RATE / 3600,
        "false_contacts": alarms,
        "update_ms": {"median": float(np.median(took)), "p99": float(np.quantile(took, 0.99))},
        "learned": _alone(runs[SESSIONS - 1])
        | learned_errors(config.readouts, logs[:SESSIONS], rng),
    }


class Run:
    """What an observer felt along one session of an arm."""

    def __init__(self, observer: Observer, log: Session, arm: StudyArm) -> None:
        self.link, self.force = before(log)
        self._twin = observer.arm
        live = feeling(observer).live(arm.runtime)
        bound = Bound(arm.built()[0].load_noise)
        self.felt, self.known, took, least = [], [], [], []
        last = 0
        for now, link, force in zip(readings(log), self.link, self.force, strict=True):
            began = time.perf_counter()
            live.update(now)
            took.append(1e3 * (time.perf_counter() - began))
            self.felt.append(live.force())
            if link and link != last:
                bound.begin()
            last = link
            turns = (np.abs(now.velocity) > STILL) & (np.arange(N_MOTORS) < N_MOTORS - 1)
            slope = (
                live.arms.pushed(link, force).slope[link - 1][turns] if link else np.zeros((0, 3))
            )
            least.append(bound.row(slope, force, 1 / RATE) if link else 0.0)
            self.known.append((bound.told, bound.pull, bound.worth))
        self.took, self.least = np.array(took), np.array(least)
        self.off = np.array([each.force for each in self.felt]) - self.force
        self.stated = np.array([each.spread**2 for each in self.felt])
        self.touched = np.array([each.touched for each in self.felt])

    def pushes(self) -> list[dict[str, Any]]:
        """Place and size of each push, after how many seconds it was found, and on which link."""
        begins = np.flatnonzero(np.diff(self.link, prepend=0) * (self.link > 0))
        return [self._push(int(n)) for n in begins]

    def _push(self, begin: int) -> dict[str, Any]:
        rest = np.flatnonzero(self.link[begin:] != self.link[begin])
        rows = slice(begin, begin + int(rest[0]) if rest.size else len(self.link))
        found = np.flatnonzero(self.touched[rows])
        felt = [each for each in self.felt[rows] if each.touched]
        links = np.sum([each.links for each in felt], axis=0) if felt else None
        told, pull, worth = self.known[min(begin + SECOND, rows.stop) - 1]
        return {
            "link": int(self.link[begin]),
            "most_N": float(np.linalg.norm(self.force[rows], axis=1).max()),
            "seconds": float(rows.stop - begin) / RATE,
            "felt_before": bool(self.touched[begin - 1]),
            "found_after_s": (int(found[0]) + 1) / RATE if found.size else None,
            "told_link": int(np.argmax(links)) + 1 if links is not None else None,
            "worth_after_1s": worth,
            "possible_in_1s": found_by_ideal(told, pull, SECOND, 1 / RATE),
            "rms_N": _root(self.square[rows]),
            "least_rms_N": _root(self.least[rows]),
        }

    @property
    def square(self) -> Array:
        """Square of the force's error [N²], (T,)."""
        return (self.off**2).sum(axis=1)

    def weight(self) -> dict[str, Any]:
        """What is felt of a weight that the arm carries all the time, all contacts taken together."""
        each = Touch(self._twin.gravity)
        for n, felt in enumerate(self.felt[_DROP:]):
            if felt.touched:
                each.time.append(n / RATE)
                each.felt.append(felt)
        if not each.felt:
            return {"felt_share": 0.0, "weight_kg": None, "link": None, "mean_N": None}
        found = each.found()
        return {
            "felt_share": len(each.felt) / len(self.felt[_DROP:]),
            "weight_kg": found["weight_kg"],
            "link": found["link"],
            "mean_N": found["mean_force_N"],
        }


def recorded(
    arm: StudyArm,
    pushes: Sequence[tuple[Push, ...]],
    rows: int,
    first: int,
    weight: float = 0.0,
) -> list[Session]:
    """Sessions of the arm with what pushes it in each; numbers from `first` on draw targets and noise."""
    made, effects = arm.built()
    effects = replace(effects, payload=effects.payload + weight) if weight else effects
    specs = [
        SessionSpec(made, effects, first + n, arm.seed, pushes=each)
        for n, each in enumerate(pushes)
    ]
    clock = np.full(len(specs), arm.runtime)
    several = simulate(specs, rows, SUBSTEPS, clock=clock)
    return [session(each, arm.id, n) for n, each in enumerate(several, first)]


def _steps(rng: np.random.Generator, seconds: float) -> tuple[Push, ...]:
    """Steps of `STEP_N` at random links in random directions, ten seconds long, ten apart."""
    several = []
    for begin in np.arange(10.0, seconds - 10.0, 20.0):
        direction = rng.standard_normal(3)
        x, y, z = map(float, STEP_N * direction / np.linalg.norm(direction))
        link = int(rng.integers(1, N_JOINTS + 1)) if rng.random() < 0.5 else N_JOINTS
        several.append(Push(link, (x, y, z), float(begin), float(begin + 10.0)))
    return tuple(several)


def _false_contacts(observer: Observer, arm: StudyArm, part: int) -> int:
    """How often contact is reported in a part of the time in which nothing touches the arm."""
    found = 0
    first = 1000 + part * _SIDE_BY_SIDE
    for log in recorded(arm, [()] * _SIDE_BY_SIDE, _FREE_ROWS, first):
        live = feeling(observer).live(arm.runtime)
        touched = []
        for now in readings(log):
            live.update(now)
            touched.append(live.force().touched)
        found += int((np.diff(touched, prepend=False) & np.array(touched)).sum())
    return found


def _scores(runs: Sequence[Run]) -> dict[str, float]:
    """Errors over all rows after the first few [N rms]: felt, stated, and least."""
    parts = [
        np.concatenate([values[_DROP:] for values in of])
        for of in zip(*((r.link, r.square, r.stated, r.least) for r in runs), strict=True)
    ]
    link, square, stated, least = parts
    size = np.concatenate([(run.force[_DROP:] ** 2).sum(axis=1) for run in runs])
    pushed = link > 0
    return {
        "pushed_N": _root(size[pushed]),
        "rms_N": _root(square[pushed]),
        "stated_N": _root(stated[pushed]),
        "least_N": _root(least[pushed]),
        "rms_free_N": _root(square[~pushed]),
        "stated_free_N": _root(stated[~pushed]),
    }


def _alone(run: Run) -> dict[str, dict[str, float]]:
    """What the observer's error is on the log on which readouts are tested, and that of no estimate."""
    rows = slice(_READOUTS_DROP, None)
    pushed, size = run.link[rows] > 0, (run.force[rows] ** 2).sum(axis=1)
    square = run.square[rows]
    return {
        "none": {"pushed": _root(size[pushed]), "free": 0.0},
        "observer": {"pushed": _root(square[pushed]), "free": _root(square[~pushed])},
    }


def _root(square: Array) -> float:
    return float(np.sqrt(square.mean()))
