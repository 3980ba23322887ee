"""The serpent arm as model/machine.toml has it, beside the arm's own engine."""

from pathlib import Path

import numpy as np
import pytest

from serpent_twin.arm.mjcf import MODEL
from serpent_twin.machines.machine import Output, ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.coordinates import coordinates
from serpent_twin.machines.model.limits import logged_limits
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.sessions import read_folder
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import STANDING, servo_lag
from serpent_twin.sim.twin_model import NOMINAL_TWIN

DATA, STEPS, SEGMENTS = Path("data/arm_a"), 125, 4


def machine(rig, logs):
    """The machine, its cameras' frame that of the arm's base."""
    outputs = tuple(
        Output(name, each.measure, 1e-3)
        for each in rig.described.about.measured
        for name in each.columns
    )
    frame = {"pivot": np.zeros(3), "shift": np.zeros(3)}
    limits = logged_limits(rig.described, logs)
    return ModelMachine(
        rig.described, {}, coordinates(rig.described), outputs, limits, frame, steps=STEPS
    )


@pytest.fixture(scope="module")
def both():
    """Segments of a log, and what the nominal twin does there by either engine, (S, T, 37) each."""
    rig = open_machine(MODEL / "machine.toml")
    of = machine(rig, logs := rig.read(DATA / "session_01.parquet"))
    pieces = of.pieces(logs).take(range(SEGMENTS))
    row = float(np.median(pieces.period))
    found = of.respond([ParameterVector.nominal(of.declared)], pieces)[0]
    session = read_folder(DATA)[0]
    at = [np.searchsorted(session.time, begun) for begun in pieces.time[:, 0]]
    rows = np.array([np.arange(first, first + pieces.time.shape[1]) for first in at])
    angle, velocity = session.motor_position, session.motor_velocity
    motion = PrescribedMotion(
        MotorTrajectory(session.time[rows], angle[rows], velocity[rows]),
        *(
            np.stack([pieces.column[f"{of} of joint{i}"][:, 0] for i in range(1, 10)], 1)
            for of in ("angle", "rate")
        ),
        servo_lag([(session.time, angle, velocity)]),
    )
    did = impose([NOMINAL_TWIN], motion, row / STEPS)
    marker = np.asarray(did.marker)[0].reshape(*rows.shape, 27)
    turns = np.abs(velocity[rows]) > 2 * STANDING
    return found, np.concatenate([marker, 1.5 * np.asarray(did.load)[0]], axis=-1), turns


def test_markers_agree(both):
    """Within 0.05 mm, in the mean over all markers and rows."""
    found, own, _ = both
    apart = np.linalg.norm((found - own)[..., :27].reshape(-1, 3), axis=1)
    assert apart.mean() < 5e-5


def test_loads_of_motors_that_turn_agree(both):
    """Within 0.1 % of the stall torque of 1.5 N m, in the mean over all motors and rows."""
    found, own, turns = both
    assert np.abs((found - own)[..., 27:])[turns].mean() < 1.5e-3
