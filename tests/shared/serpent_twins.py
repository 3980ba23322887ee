"""The serpent arm by either engine: its own, and as model/machine.toml has it, in pieces of one log."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from serpent_twin.arm.mjcf import MODEL
from serpent_twin.machines.machine import Output
from serpent_twin.machines.model import open_machine, simulated
from serpent_twin.machines.model.coordinates import coordinates
from serpent_twin.machines.model.limits import logged_limits
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.sessions import read_folder
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import STANDING, servo_lag
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.tables.segments import Stretch

DATA, STEPS = Path("data/arm_a"), 125
STALL = 1.5
"""[N m]"""


def _machine(rig, logs):
    """The machine, its cameras' frame that of the arm's base."""
    outputs = tuple(
        Output(name, each.measure, 1e-3)
        for each in rig.described.about.measured
        for name in each.columns
    )
    frame = {"pivot": np.zeros(3), "shift": np.zeros(3)}
    described, limits = rig.described, logged_limits(rig.described, logs)
    return ModelMachine(described, outputs, {}, coordinates(described), limits, frame, steps=STEPS)


@dataclass(frozen=True)
class Serpent:
    """Pieces of a session, and twins with effects in them by either engine, (S, T, 37) in SI."""

    machine: ModelMachine
    pieces: object
    motion: PrescribedMotion
    past: tuple
    turns: np.ndarray
    """Which motors turn in which rows, of bool, (S, T, 10)"""

    def as_model(self, *there):
        """Response of one twin by the engine of all machines, (S, T, 37)."""
        return self.as_models(there)[0]

    def as_models(self, *several):
        """Responses of several twins side by side by the engine of all machines, (D, S, T, 37)."""
        none = np.zeros(len(self.machine.declared))
        points = [SimpleNamespace(declared=none, there=there) for there in several]
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(simulated, "effects_at", lambda at: getattr(at, "there", ()))
            return self.machine.respond(points, self.pieces)

    def by_itself(self, *there):
        """Response of one twin by the arm's own engine, (S, T, 37)."""
        return self.of_design(TwinModel(effects=there))

    def of_design(self, design):
        """A twin model by the arm's own engine."""
        remembers = any(each.remembers for each in design.effects)
        motion = replace(self.motion, past=self.past if remembers else None)
        period = float(np.median(self.pieces.period))
        did = impose([design], motion, period / STEPS)
        marker = np.asarray(did.marker)[0].reshape(*self.turns.shape[:2], 27)
        return np.concatenate([marker, STALL * np.asarray(did.load)[0]], axis=-1)


def serpent(starts, rows):
    """Some rows each of the first session of `data/arm_a`, from where they start."""
    rig = open_machine(MODEL / "machine.toml")
    logs = rig.read(DATA / "session_01.parquet")
    machine = _machine(rig, logs)
    parts = [Stretch(logs[0], at, at + rows, (at, at + rows)) for at in starts]
    pieces = machine.stacked(parts)
    session = read_folder(DATA)[0]
    time, angle, velocity = session.time, session.motor_position, session.motor_velocity
    first = np.searchsorted(time, pieces.time[:, 0])
    at, before = first[:, None] + np.arange(rows), first.max()
    before = np.maximum(first[:, None] - before + np.arange(before), 0)
    joints = [
        np.stack([logs[0].columns[f"{of} of joint{i}"] for i in range(1, 10)], 1)
        for of in ("angle", "rate")
    ]
    motion = PrescribedMotion(
        MotorTrajectory(time[at], angle[at], velocity[at]),
        *(of[first] for of in joints),
        servo_lag([(time, angle, velocity)]),
    )
    past = MotorTrajectory(time[before], angle[before], velocity[before]), joints[0][before]
    return Serpent(machine, pieces, motion, past, np.abs(velocity[at]) > 2 * STANDING)
