"""Measure the error of each route in conditions that no readout was trained for.

The arm is simulated here: it is a twin that the logs cannot distinguish from the corrected one, which the
observer uses. So an error of all twins is not in these figures; the logged arm's are elsewhere.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.arm.control import random_targets
from serpent_twin.arm.geometry import ARM
from serpent_twin.effects.base_tilt import BaseTilt
from serpent_twin.effects.payload import Payload
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import Belief, Estimator, Live
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.readouts.score import distances, score
from serpent_twin.readouts.windows import cut
from serpent_twin.recording.loop import TargetSteering, record
from serpent_twin.recording.simulated_arm import SimulatedArm, generators
from serpent_twin.sessions import Session
from serpent_twin.sessions.session import session_from_rows
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.sim.variation import Variation

ROWS = 1200
MORE_KG = 0.03


@dataclass(frozen=True)
class Condition:
    """One way in which a session differs from those trained on."""

    name: str
    rows: int = ROWS
    rate_hz: float = 4.0
    wider: float = 1.0
    """Times the published range of the targets"""
    more_kg: float = 0.0
    """Payload besides what the arm carries"""
    lost: tuple[int, int] = (0, 0)
    """Rows that no bus brings"""
    reboots: tuple[int, ...] = ()
    """Rows before which three motors trip and are rebooted, their joints loose for two seconds"""


def conditions(hour: int) -> tuple[Condition, ...]:
    """All that are tried; the long one takes `hour` rows."""
    return (
        Condition("as trained"),
        Condition("10 Hz", rate_hz=10.0),
        Condition("range × 1.3", wider=1.3),
        Condition(f"{MORE_KG * 1e3:.0f} g more payload", more_kg=MORE_KG),
        Condition("10 s without bus", lost=(ROWS // 3, ROWS // 3 + 40)),
        Condition("three motors rebooted, twice", reboots=(ROWS // 3, ROWS // 2)),
        Condition(f"{hour / 4 / 3600:.2g} h", rows=hour),
    )


def loaded(design: TwinModel, more_kg: float) -> TwinModel:
    """The arm with more in its gripper."""
    held = design.effect_of(Payload)
    return design.with_effect(replace(held, mass=held.mass + more_kg)) if more_kg else design


def _simulated_arm(arm: TwinModel, seed: list[int]) -> tuple[SimulatedArm, np.random.Generator]:
    """A simulated arm, and what draws its targets."""
    for_targets, for_loads, for_cameras, _ = generators(seed)
    return SimulatedArm.of(Twin(arm), arm.parameters, for_loads, for_cameras), for_targets


def session_of(arm: TwinModel, condition: Condition, seed: int) -> Session:
    """A session of a simulated arm."""
    simulated, for_targets = _simulated_arm(loaded(arm, condition.more_kg), [seed, 17])
    bus = simulated.bus
    wide = replace(ARM, target_range=condition.wider * ARM.target_range)
    targets = random_targets(
        condition.rows, for_targets, wide, hold=round(1.25 * condition.rate_hz)
    )
    parts = np.split(targets, condition.reboots)
    rows = list[dict[str, Any]]()
    with bus:
        for n, part in enumerate(parts):
            if n:
                bus.reboot([2, 3, 7])
                bus.wait(2.0)
            began = bus.time
            for row in record(
                bus, simulated.cameras, TargetSteering(part, simulated.gain), 1 / condition.rate_hz
            ):
                rows.append(row | {"time": began + row["time"]})
    whole = _session(rows, condition.rate_hz)
    kept = np.ones(len(whole), bool)
    kept[slice(*condition.lost)] = False
    return whole if kept.all() else _session([r for r, k in zip(rows, kept, strict=True) if k], 4.0)


def _session(rows: list[dict[str, Any]], rate_hz: float) -> Session:
    metadata = {"schema_version": 1, "backend": "sim", "arm": "simulated", "session": 1}
    return session_from_rows(rows, metadata | {"rate_hz": rate_hz})


def in_conditions(
    arm: TwinModel,
    estimators: Mapping[str, Estimator],
    seed: int,
    hour: int,
    on_progress: Callable[[str], None],
) -> dict[str, Any]:
    """Errors [mm] and coverage of each estimator in each condition, or why it refuses."""
    found: dict[str, Any] = {}
    for condition in conditions(hour):
        on_progress(f"condition: {condition.name}")
        windows = cut([session_of(arm, condition, seed)], 4, 100)
        test = windows.sessions[0]
        found[condition.name] = {}
        for name, estimator in estimators.items():
            try:
                estimator.require_rate(condition.rate_hz)
            except SerpentError:
                found[condition.name][name] = None
                continue
            belief = estimator.follow(test)
            parts = np.array_split(distances(belief.marker, test.marker).mean(axis=1) * 1e3, 6)
            found[condition.name][name] = {
                "mean_mm": score(belief.marker, test.marker).mean_mm,
                "coverage_95": belief.coverage(test.marker),
                "by_sixth_mm": [float(part.mean()) for part in parts],
            }
    return found


# An arm that changes while it moves


@dataclass(frozen=True)
class ArmChange:
    """What becomes of an arm while it moves."""

    more_kg: float = 0.0
    """Taken up by the gripper"""
    tilt: tuple[float, float] = (0.0, 0.0)
    """About the base's y and z [rad], in addition to what the arm has"""


CHANGES = {
    "payload": (ArmChange(more_kg=MORE_KG), f"the gripper takes up {1e3 * MORE_KG:.0f} g"),
    "tilt": (ArmChange(tilt=(0.04, -0.03)), "the stand is knocked askew by 2.9°"),
}
"""Each with what happens, in words"""


def changing(arm: TwinModel, rows: int, at: int, change: ArmChange, seed: int) -> Session:
    """A session during which the arm changes, at a row."""
    before, after = _held(arm, ArmChange()), _held(arm, change)
    simulated, for_targets = _simulated_arm(before, [seed, 19])
    bus, logged, targets = simulated.bus, list[dict[str, Any]](), random_targets(rows, for_targets)
    with bus:
        models = [each.spec().compile() for each in (before, after)]
        variation = Variation(bus.twin.batch, models)
        steering = TargetSteering(targets, simulated.gain)
        for n, row in enumerate(record(bus, simulated.cameras, steering, 0.25)):
            logged.append(row)
            if n == at:
                variation.set(np.ones((1, 1)))
    return _session(logged, 4.0)


def _held(arm: TwinModel, change: ArmChange) -> TwinModel:
    """The arm after a change, built as it is before one: with a payload and a tilt, however small."""
    tilted = arm.effect_of(BaseTilt)
    about_y, about_z = (max(abs(x), 1e-9) * (np.sign(x) or 1) for x in change.tilt)
    lean = BaseTilt(tilted.about_y + about_y, tilted.about_z + about_z)
    return loaded(arm, change.more_kg + 1e-6).with_effect(lean)


def followed(live: Live, session: Session) -> Iterator[float]:
    """Error of each row [mm], before the row's own markers correct anything; NaN before the first."""
    for now, marker in zip(readings(session), session.marker, strict=True):
        belief: Belief | None = live.update(now)
        yield np.nan if belief is None else float(distances(belief.marker[0], marker).mean() * 1e3)
        live.correct(marker)


def recovery(error: np.ndarray, at: int, rate_hz: float = 4.0) -> dict[str, float | None]:
    """Mean errors before and after a change at a row, and how long until 10 s of rows are as good as 1.25 ×
    those before [s]; None if they never are.
    """
    width = round(10 * rate_hz)
    before = float(np.nanmean(error[at - 4 * width : at]))
    mean = np.convolve(error[at + 1 :], np.ones(width) / width, "valid")
    good = np.flatnonzero(mean <= 1.25 * before)
    return {
        "before_mm": before,
        "first_10_s_mm": float(mean[0]),
        "last_mm": float(np.nanmean(error[-4 * width :])),
        "recovered_s": float((good[0] + width) / rate_hz) if good.size else None,
    }
