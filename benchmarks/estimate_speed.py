"""Measure what one estimate costs on one core, against the limits of a control loop.

Milliseconds from a reading to its estimate, as shares of the limits: 5 ms for the observer at 4 Hz, 1 ms for
readouts of windows and for the correction by markers. Medians over the rows of a simulated session; the
observer's peer is a bare MuJoCo model of the same arm that takes as many steps.
"""

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np

from benchmarks.rows import BenchmarkRows
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.effects.cable_friction import CableFriction
from serpent_twin.estimators import Estimator, Live, find
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.estimators.feeling import feeling
from serpent_twin.estimators.online import Online
from serpent_twin.readouts.windows import SessionWindows, Windows, cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_folder
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.stored import within

LIMIT_MS = {"observer": 5.0, "windows": 1.0, "markers": 1.0}
SOFT = TwinModel(replace(NOMINAL, strand_stiffness=4e3))
ROUGH = SOFT.with_effect(CableFriction(coefficient=0.1))
WINDOWED = ("linear", "residual", "residual_mlp", "mlp", "lstm", "ensemble")


@dataclass(frozen=True)
class EstimateSpeed(Checked):
    """Time estimates on one core."""

    rows: Annotated[int, within(200, 1_000_000)] = 400
    """Rows of the simulated session."""
    out: Path | None = None
    """JSON file for the rows."""


def main(config: EstimateSpeed) -> None:  # noqa: D103 tyro would print it above the config's own
    import torch

    torch.set_num_threads(1)
    rows = BenchmarkRows()
    with tempfile.TemporaryDirectory() as folder:
        logs = Path(folder)
        collect(Collect(logs, sessions=2, steps=config.rows, parameters=SOFT.parameters))
        train, test = (cut([each], 4, 100) for each in read_folder(logs))
        pushed = logs / "pushed"
        collect(
            Collect(pushed, sessions=1, steps=config.rows, parameters=SOFT.parameters, push="4")
        )
        touched = cut(read_folder(pushed), 4, 100).sessions[0]
    session = test.sessions[0]
    for name, arm in {"observer": SOFT, "observer, cable friction": ROUGH}.items():
        taken = _each(_observer(arm, train).live(), session)
        _add(rows, name, taken, LIMIT_MS["observer"])
        ratio = np.median(taken) / _bare_ms(arm, session)
        rows.add(f"{name}: to as many steps of a bare model", ratio)
    taken = _each(feeling(_observer(SOFT, train)).live(), touched)
    _add(rows, "observer with force, pushed half the time", taken, LIMIT_MS["observer"])
    for name in WINDOWED:
        _add(rows, name, _each(_fitted(name, train).live(), session), LIMIT_MS["windows"])
    _add(rows, "correction by markers", _corrections(train, session), LIMIT_MS["markers"])
    rows.write(config.out)


def _add(rows: BenchmarkRows, name: str, taken: np.ndarray, limit: float) -> None:
    rows.add(f"{name}: median", np.median(taken), "ms", f"{limit:g} ms")
    rows.add(f"{name}: 99 %", np.quantile(taken, 0.99), "ms")


def _observer(arm: TwinModel, train: Windows) -> Estimator:
    return _fitted("observer", train, {"twin": twin_model.to_dict(arm)})


def _fitted(name: str, train: Windows, settings: Mapping[str, object] | None = None) -> Estimator:
    """Trained so briefly that it only costs what it always costs."""
    quick = {"epochs": 1} if find(name).trained.takes("epochs") else {}
    made = find(name)(4, **quick, **(settings or {}))
    made.trained.fit(train, train, np.random.default_rng(0))
    return made


def _each(live: Live, session: SessionWindows) -> np.ndarray:
    return _timed(live.update, list(readings(session.log)))


def _corrections(train: Windows, session: SessionWindows) -> np.ndarray:
    """Times of the correction alone [ms]: what it takes on top of an estimator that costs nothing."""
    residual = _fitted("residual", train)
    alone, online = residual.live(), Online(residual.live())
    rows, seen = list(readings(session.log))[3:], session.marker
    plain = _timed(alone.update, rows)

    def both(k: int) -> None:
        online.update(rows[k])
        online.correct(seen[k % len(seen)])

    return np.maximum(_timed(both, list(range(len(rows)))) - plain, 0.0)


def _timed(do: Callable, items: list) -> np.ndarray:
    taken = np.empty(len(items))
    for k, item in enumerate(items):
        began = time.perf_counter()
        do(item)
        taken[k] = time.perf_counter() - began
    return taken[10:] * 1e3  # the first ones warm caches


def _bare_ms(arm: TwinModel, session: SessionWindows, rows: int = 100) -> float:
    """Median of a row's time steps, one after the other, with nothing wound [ms]."""
    model = arm.spec(motors=False).compile()
    model.opt.timestep = 0.01
    data = mujoco.MjData(model)
    steps = round(float(np.diff(session.time).mean()) / model.opt.timestep)

    def row(_: int) -> None:
        for _ in range(steps):
            mujoco.mj_step(model, data)

    return float(np.median(_timed(row, list(range(rows)))))


if __name__ == "__main__":
    cli.run(main)
