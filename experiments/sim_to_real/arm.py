"""Measure the error of each route on one arm, and how many of its windows each needs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.sim_to_real.twins import (
    CALIBRATED,
    CORRECTED,
    DROP,
    NOMINAL,
    STAGES,
    WINDOW,
    Size,
    Twins,
    after,
    bearing,
    joined,
    kept,
    simulated,
    trace_arm,
)
from serpent_twin import stored
from serpent_twin.estimators import Estimator, find
from serpent_twin.estimators.adapted import Adapted
from serpent_twin.numerals import counted
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import Windows
from serpent_twin.runs.files import write_json
from serpent_twin.sessions import read_folder
from serpent_twin.sim import twin_model
from serpent_twin.training.jitter import command_error
from serpent_twin.training.split import split
from serpent_twin.training.training_run import latency_ms

READOUTS = ("residual", "residual_mlp")
"""Compared on every route"""
HEADLINE = "residual_mlp"
"""The one that zero_shot_mm, few_shot_mm and all_real_mm are of"""
COUNTS = (100, 500, 2000)
ALL = "all"
SHARES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
FOLLOWED = {"payload": ("payload",), "payload and tilt": ("payload", "base_tilt")}
"""Numbers that weighing observers follow by loads alone, by name"""
LONGEST = 1000  # windows that choose the filter's scatter and how fast is followed

STEPS = 65
"""Progress steps of one arm"""

OnProgress = Callable[[str], None]


@dataclass(frozen=True)
class ArmWindows:
    """An arm's windows."""

    train: Windows
    validate: Windows
    test: Windows

    @property
    def all(self) -> Windows:
        """All that may be learned from."""
        return joined(self.train, self.validate)

    def few(self, count: str) -> Windows:
        """The first `count` of them."""
        return self.all if count == ALL else self.all.first(int(count))

    @property
    def counts(self) -> tuple[str, ...]:
        """How many windows are tried."""
        return (*(str(n) for n in COUNTS if n < len(self.all.x)), ALL)


@dataclass
class Study:
    """One arm's routes; all that is trained lies in `out` and is not trained again."""

    out: Path
    seed: int
    size: Size
    real: ArmWindows
    twins: Twins
    on_progress: OnProgress

    def rng(self, *name: str) -> np.random.Generator:
        """Random generator of one readout, the same in every run."""
        return np.random.default_rng([self.seed, *"/".join(name).encode()])

    def train(
        self, place: str, name: str, data: tuple[Windows, Windows], **settings: Any
    ) -> Estimator:
        """An estimator of that name trained on windows, kept under a place."""
        self.on_progress(f"{place}: {name}")
        if self.size.epochs and find(name).trained.takes("epochs"):
            settings["epochs"] = self.size.epochs
        return kept(
            self.out / "models" / place / name,
            lambda: find(name)(WINDOW, **settings),
            lambda trained: trained.fit(*data, self.rng(place, name)),
        )

    def adapt(self, place: str, base: Estimator, count: str) -> Estimator:
        """A trained estimator corrected by the arm's first windows."""
        windows = "all windows" if count == ALL else counted(int(count), "window")
        self.on_progress(f"{place}: {base.name}, {windows}")
        few = self.real.few(count)
        return kept(
            self.out / "models" / f"{place}_{count}" / base.name,
            lambda: Adapted.of(base),
            lambda trained: trained.fit(few, few, self.rng(place, base.name, count)),
        )

    def error_mm(self, estimator: Estimator) -> float:
        """Mean marker distance over the test sessions."""
        test = self.real.test
        told = [estimator.follow(each).marker for each in test.sessions]
        return score(np.concatenate(told), test.marker).mean_mm


def study_arm(
    folder: Path, out: Path, seed: int, size: Size, on_progress: OnProgress
) -> dict[str, Any]:
    """All routes on one arm; made once, then read from OUT/arm.json."""
    done = out / "arm.json"
    if done.exists():
        return stored.read_json(done)
    parts = split(read_folder(folder))
    out.mkdir(parents=True, exist_ok=True)
    on_progress("tracing")
    twins = trace_arm(folder, parts, out / "trace", seed, size)
    study = Study(out, seed, size, ArmWindows(*parts.windows(WINDOW, DROP)), twins, on_progress)
    found = _routes(study) | _observers(study) | _diagnosed(twins.diagnosis)
    found["test_sessions"] = parts.names()["test"]
    found["windows"] = {"train": len(study.real.all.x), "test": len(study.real.test.x)}
    write_json(done, found)
    return found


def _routes(study: Study) -> dict[str, Any]:
    """Readouts of windows: trained on the arm, on its twins, and on twins and then on the arm."""
    real = study.real
    data = (real.train, real.validate)
    lstm = study.train("real", "lstm", data)
    own = {name: study.train("real", name, data) for name in READOUTS}
    zero: dict[str, dict[str, float]] = {name: {} for name in READOUTS}
    curves: dict[str, dict[str, dict[str, float]]] = {name: {} for name in READOUTS}
    cost = {"lstm": latency_ms(lstm, real.test)}
    stopped = {"lstm": lstm.trained.stopped_after, HEADLINE: own[HEADLINE].trained.stopped_after}
    servo = command_error(real.train)
    for stage in STAGES:
        study.on_progress(f"{stage}: simulating")
        logs = simulated(
            stage, study.twins, _rate(real), study.out / "logs", study.seed, study.size
        )
        sim = tuple(bearing(part, servo, study.seed + n) for n, part in enumerate(logs))
        for name in READOUTS:
            base = study.train(stage, name, (sim[0], sim[1]))
            if name == HEADLINE:
                stopped[name] = stopped[name] or base.trained.stopped_after
            zero[name][stage] = study.error_mm(base)
            curves[name][stage] = {"0": zero[name][stage]} | {
                n: study.error_mm(study.adapt(stage, base, n)) for n in real.counts
            }
            if stage == CORRECTED:
                cost[name] = latency_ms(base, real.test)
    for name in READOUTS:
        curves[name]["real alone"] = _from_scratch(study, name)
        curves[name]["real alone"][ALL] = study.error_mm(own[name])
    few = curves[HEADLINE][CORRECTED]
    return {
        "lstm_mm": study.error_mm(lstm),
        "zero_shot_mm": zero[HEADLINE],
        "few_shot_mm": {n: few[n] for n in real.counts},
        "all_real_mm": curves[HEADLINE]["real alone"][ALL],
        "readout": HEADLINE,
        "stopped_after_epochs": stopped,
        "curves_mm": curves,
        "servo_error_rad_s": servo,
        "latency_ms": cost,
    }


def _from_scratch(study: Study, name: str) -> dict[str, float]:
    """Trained on the arm's first windows alone, the last fifth of which is for early stopping."""
    errors = {}
    for count in study.real.counts[:-1]:
        few, learned = study.real.few(count), 4 * int(count) // 5
        readout = study.train(f"real_{count}", name, (few.first(learned), after(few, learned)))
        errors[count] = study.error_mm(readout)
    return errors


def _rate(real: ArmWindows) -> float:
    assert real.train.rate_hz is not None
    return real.train.rate_hz


def _observers(study: Study) -> dict[str, Any]:
    """The twin itself, of every stage; corrected by loads; and with what it misses learned."""
    real, found = study.real, dict[str, Any]()
    data = (real.train, real.validate)
    stages = {stage: study.twins.of(stage)[0] for stage in (NOMINAL, CALIBRATED, CORRECTED)}
    observers = {
        stage: study.train(f"observer_{stage}", "observer", data, twin=twin_model.to_dict(arm))
        for stage, arm in stages.items()
    }
    short = (real.train.first(LONGEST), real.validate.first(LONGEST))
    filtered = {
        stage: study.train(
            f"filtered_{stage}", "filtered_observer", short, twin=twin_model.to_dict(stages[stage])
        )
        for stage in (CALIBRATED, CORRECTED)
    }
    weighing = {
        what: study.train(
            f"weighing_{what}",
            "weighing_observer",
            short,
            twin=twin_model.to_dict(stages[CORRECTED]),
            unknown=unknown,
        )
        for what, unknown in FOLLOWED.items()
    }
    best = observers[CORRECTED]
    hybrid = {n: study.adapt("hybrid", best, n) for n in real.counts}
    beliefs = [best.follow(each) for each in real.test.sessions]
    found["coverage"] = {
        str(share): float(
            np.average(
                [
                    b.coverage(s.marker, share)
                    for b, s in zip(beliefs, real.test.sessions, strict=True)
                ],
                weights=[len(s) for s in real.test.sessions],
            )
        )
        for share in SHARES
    }
    told = np.concatenate([b.marker for b in beliefs])
    found["observer_tip_mm"] = score(told, real.test.marker).tip_mm
    found["observer_by_stage_mm"] = {n: study.error_mm(each) for n, each in observers.items()}
    found["observer_mm"] = found["observer_by_stage_mm"][CORRECTED]
    found["coverage_95"] = found["coverage"]["0.95"]
    found["filtered_mm"] = {n: study.error_mm(each) for n, each in filtered.items()}
    found["filter_scatter_rad"] = {
        n: float(f.trained.learned["scatter"]) for n, f in filtered.items()
    }
    found["weighing_mm"] = {n: study.error_mm(each) for n, each in weighing.items()}
    found["weighing_latency_ms"] = {n: latency_ms(r, real.test) for n, r in weighing.items()}
    found["hybrid_mm"] = {n: study.error_mm(each) for n, each in hybrid.items()}
    found["observer_latency_ms"] = latency_ms(best, real.test)
    return found


def _diagnosed(diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "effects": diagnosis["effects"],
        "unexplained": diagnosis["unexplained"],
        "trace_error_mm": diagnosis.get("error_mm"),
    }
