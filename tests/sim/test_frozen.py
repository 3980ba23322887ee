"""Compare sessions of the simulated bus, and arms in prescribed motion, with recorded results.

After a change of physics that is meant, `PYTHONPATH=.:tests/shared python tests/sim/test_frozen.py`
records tests/sim/frozen/*.npz anew.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paths import DATA

from experiments.arm_catalogue import CATALOGUE
from serpent_twin.arm.control import random_targets
from serpent_twin.arm.deviations import EXACT
from serpent_twin.effects.cable_friction import CableFriction
from serpent_twin.emulator.cameras import SimulatedMocap
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.recording.loop import TargetSteering, record
from serpent_twin.sessions import FIELDS, read_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

FROZEN = Path(__file__).resolve().parent / "frozen"
TOLERANCE = 1e-9  # m, rad, rad/s and shares of the stall torque: machines differ in the last bits
STEPS, ROWS, EVERY = 12, 24, 6
WORN = tuple(
    CATALOGUE[name].variants()[0] for name in ("cable_friction", "gear_backlash", "payload")
)
BUILT = {
    "nominal": NOMINAL_TWIN,
    "worn": TwinModel(tolerances=replace(EXACT, winch_radius=(0.004,) * 10), effects=WORN),
}


def recorded(arm: TwinModel) -> dict[str, np.ndarray]:
    """A short session of the simulated bus, a column a field of the log."""
    loads, cameras, targets = map(np.random.default_rng, np.random.SeedSequence(7).spawn(3))
    noise, gain = arm.parameters, arm.parameters.controller_gain
    bus = SimulatedBus(Twin(arm), loads, noise.load_noise)
    mocap = SimulatedMocap(bus.twin, cameras, noise.marker_noise, 0.05)
    with bus:
        rows = list(record(bus, mocap, TargetSteering(random_targets(STEPS, targets), gain), 0.25))
    return {name: np.array([row[name] for row in rows]) for name in FIELDS}


def driven(arm: TwinModel) -> dict[str, np.ndarray]:
    """What an arm does that the first rows of the committed logs drive."""
    log = read_session(DATA / "arm_a" / "session_01.parquet")[:ROWS]
    motors = MotorTrajectory(log.time, log.motor_position, log.motor_velocity)[None]
    did = impose([arm], PrescribedMotion(motors, np.zeros((1, 9)), servo_lag=0.01))
    return {name: getattr(did, name)[0, 0, ::EVERY] for name in ("marker", "load", "joint_angle")}


def designs() -> dict[str, TwinModel]:
    """The nominal arm, and one with each effect of the catalogue."""
    one = {name: TwinModel(effects=kind.variants()[:1]) for name, kind in CATALOGUE.items()}
    return {"nominal": NOMINAL_TWIN, **one}


def frozen(name: str, entry: str) -> dict[str, np.ndarray]:
    """The arrays of one entry as they were recorded."""
    with np.load(FROZEN / f"{name}.npz") as stored:
        return {k.partition("/")[2]: stored[k] for k in stored.files if k.startswith(f"{entry}/")}


def assert_as_before(found: dict[str, np.ndarray], before: dict[str, np.ndarray]) -> None:
    assert before
    for name, values in before.items():
        assert_allclose(found[name], values, rtol=TOLERANCE, atol=TOLERANCE, err_msg=name)


@pytest.mark.parametrize("entry", BUILT)
def test_sessions_of_the_simulated_bus_are_as_before(entry):
    assert_as_before(recorded(BUILT[entry]), frozen("sessions", entry))


@pytest.mark.parametrize("entry", designs())
def test_arms_that_the_committed_logs_drive_move_as_before(entry):
    assert_as_before(driven(designs()[entry]), frozen("driven", entry))


def test_a_twin_that_was_written_before_is_read_as_it_was():
    """tests/sim/frozen/twin.json is of 0.1.0, before it carried a version; it is never written anew."""
    rubs, *others = WORN
    assert isinstance(rubs, CableFriction)
    rigid = replace(rubs, presliding=0.0)
    worn = replace(BUILT["worn"], effects=(rigid, *others))
    assert twin_model.read(FROZEN / "twin.json") == worn


if __name__ == "__main__":
    for file, made in (
        ("sessions", {name: recorded(arm) for name, arm in BUILT.items()}),
        ("driven", {name: driven(arm) for name, arm in designs().items()}),
    ):
        arrays = {f"{n}/{k}": v for n, columns in made.items() for k, v in columns.items()}
        np.savez_compressed(FROZEN / f"{file}.npz", **arrays)
