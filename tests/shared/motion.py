"""Move an arm for a test."""

import numpy as np

from serpent_twin.arm.geometry import motor_from_joint
from serpent_twin.sim.many_twins import PrescribedMotion
from serpent_twin.sim.motor_trajectory import MotorTrajectory


def wander(rows, dt=0.25, seed=0, pace=0.04, stretches=1):
    """Stretches in which all joints wander; the motors follow as stiff cables would."""
    q = np.cumsum(np.random.default_rng(seed).normal(0, pace, (stretches, rows, 9)), axis=1)
    m = np.concatenate([motor_from_joint(q), q.sum(-1, keepdims=True)], axis=-1)
    time = np.tile(dt * np.arange(rows), (stretches, 1))
    return PrescribedMotion(MotorTrajectory(time, m, np.gradient(m, dt, axis=1)), q[:, 0])


def sway(rows, dt=0.25, seed=0):
    """A stretch in which each joint swings by 0.25 rad with a period of its own, 5 … 15 s."""
    rng = np.random.default_rng(seed)
    time = dt * np.arange(rows)[:, None]
    pace, phase = 2 * np.pi / rng.uniform(5, 15, 9), rng.uniform(0, 2 * np.pi, 9)
    q = 0.25 * np.sin(pace * time + phase)[None]
    m = np.concatenate([motor_from_joint(q), q.sum(-1, keepdims=True)], axis=-1)
    return PrescribedMotion(MotorTrajectory(time.T, m, np.gradient(m, dt, axis=1)), q[:, 0])
