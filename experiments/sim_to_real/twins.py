"""Make the twins that readouts learn from, and their training sessions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin import machines, stored
from serpent_twin.estimators import Estimator, load
from serpent_twin.identification.run import Trace, trace_sessions
from serpent_twin.readouts.trainable import Trainable
from serpent_twin.readouts.windows import Windows, cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_folder
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel
from serpent_twin.training.jitter import jittered
from serpent_twin.training.split import Split

NOMINAL, CALIBRATED, CORRECTED, RANDOMISED = "nominal", "calibrated", "corrected", "randomised"
STAGES = (NOMINAL, CALIBRATED, CORRECTED, RANDOMISED)
WINDOW, DROP = 4, 100


@dataclass(frozen=True)
class Size:
    """How much is simulated and drawn."""

    sessions: int
    """Simulated of each twin, the last of which validates"""
    steps: int
    """Rows of each"""
    drawn: int
    """Twins drawn as the fit is uncertain"""
    epochs: int | None = None
    """Passes of networks; by default each one's own"""


FULL = Size(10, 1200, 12)
QUICK = Size(3, 400, 2, epochs=3)


@dataclass(frozen=True)
class Twins:
    """Twins of one arm, made before its test session is used."""

    corrected: TwinModel
    calibrated: TwinModel
    drawn: tuple[TwinModel, ...]
    diagnosis: Mapping[str, Any]
    """What diagnosis.json holds"""

    def of(self, stage: str) -> Sequence[TwinModel]:
        """The twins of a stage."""
        known = {CALIBRATED: (self.calibrated,), CORRECTED: (self.corrected,)}
        return {NOMINAL: (NOMINAL_TWIN,), RANDOMISED: self.drawn, **known}[stage]


def trace_arm(folder: Path, parts: Split, out: Path, seed: int, size: Size) -> Twins:
    """Trace an arm by its training sessions, its validation sessions judging: the test stays unseen."""
    config = Trace((folder,), out, judge="validation", seed=seed, twins=size.drawn)
    done = out / "diagnosis.json"
    if not done.exists():
        rig = machines.find(machines.ARM)
        trace_sessions(config, rig, rig.logs(parts.train), rig.logs(parts.validate))
    diagnosis = stored.read_json(done)
    drawn = sorted((out / "twins").glob("drawn_*.json"))[: size.drawn]
    return Twins(
        twin_model.read(out / "twin.json"),
        twin_model.read(out / "twins" / "calibrated.json"),
        tuple(twin_model.read(path) for path in drawn),
        diagnosis,
    )


def simulated(
    stage: str, twins: Twins, rate_hz: float, out: Path, seed: int, size: Size
) -> tuple[Windows, Windows]:
    """Windows of a stage's twins, for training and for validation; the twins' logs are kept in `out`."""
    designs = twins.of(stage)
    each = max(1, size.sessions // len(designs))
    parts = []
    for n, arm in enumerate(designs):
        folder = out / f"{stage}_{n:02d}" if len(designs) > 1 else out / stage
        path = None
        if stage != NOMINAL:
            path = out / f"{folder.name}.json"
            if not path.exists():
                twin_model.write(path, arm, {})
        collect(
            Collect(
                folder, sessions=each, steps=size.steps, rate_hz=rate_hz, seed=seed + n, twin=path
            )
        )
        parts += read_folder(folder)
    last = max(1, len(parts) // 8)
    return cut(parts[:-last], WINDOW, DROP), cut(parts[-last:], WINDOW, DROP)


def bearing(windows: Windows, servo_error: float, seed: int) -> Windows:
    """Simulated windows whose commands are off by as much as the arm's servos miss theirs [rad/s]."""
    return jittered(windows, servo_error, np.random.default_rng([seed, 3]))


def after(windows: Windows, count: int) -> Windows:
    """The windows that `Windows.first` leaves."""
    sessions, left = [], count
    for each in windows.sessions:
        if left < len(each):
            sessions.append(each.some(max(0, left), len(each)))
        left -= len(each)
    return replace(windows, sessions=tuple(sessions))


def joined(*parts: Windows) -> Windows:
    """Windows of several parts as one."""
    return replace(parts[0], sessions=tuple(each for part in parts for each in part.sessions))


def kept(
    folder: Path, make: Callable[[], Estimator], learn: Callable[[Trainable], None]
) -> Estimator:
    """An estimator trained now, or one that an earlier run left whole in its folder."""
    if (folder / "readout.json").exists():
        return load(folder)
    made = make()
    learn(made.trained)
    made.trained.save(folder)
    return made
