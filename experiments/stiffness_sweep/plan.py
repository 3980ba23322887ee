"""SweepPlan which arms the stiffness sweep measures, and how."""

from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.arrays import Array
from serpent_twin.reservoir.grid_point import GridPoint, Measuring
from serpent_twin.reservoir.pose import PUBLISHED_RATE
from serpent_twin.sim.twin_model import TwinModel

SPEED = 0.28
"""Rate [Hz] times amplitude [rad], as the servos' speed lets joints go"""

LOAD_NOISE = 0.004
"""Noise of a load reading, as a share of the stall torque: what traces leave of the logged arms' loads. The
nominal twin's 0.015 stands for more than the sensors.
"""

GRID, RATES, AMPLITUDES, CROSSED = "grid", "rates", "amplitudes", "rates × amplitudes"
RATIO, WEIGHTLESS, RIGID = "damping ratio held", "without gravity", "rigid cables"
NOISES = "load noise"


@dataclass(frozen=True)
class Weightless(GridPoint):
    """An arm without weight."""

    @property
    def design(self) -> TwinModel:
        """The arm."""
        return TwinModel(self.parameters, arm=replace(ARM, gravity=(0.0, 0.0, 0.0)))

    def described(self) -> dict[str, Any]:
        """Values of the point by names that carry units."""
        return super().described() | {"gravity_m_per_s2": 0.0}


@dataclass(frozen=True)
class SweepPlan:
    """Values to measure at; everything besides the grid at the grid's second slack."""

    stiffness: tuple[float, ...]
    """Stiffness of each strand [N/m], ascending"""
    slack: tuple[float, ...]
    """Slack of each strand [m], ascending"""
    rate: float
    """Rate of the grid's commands [Hz]"""
    seeds: tuple[int, ...]
    """Seeds of the grid and of the weightless arms; the rest has the first"""
    rates: tuple[float, ...]
    """Rates of commands [Hz], the grid's among them; each with as wide targets as the servos' speed allows"""
    amplitudes: tuple[float, ...]
    """Amplitudes of joint targets [rad], the grid's among them; at the grid's rate"""
    weightless: tuple[float, ...]
    """Stiffness of arms without weight [N/m]"""
    noises: tuple[float, ...]
    """Noises of load readings, as shares of the stall torque, at the middle stiffness"""
    steps: int
    """Command periods of each point"""
    log_rows: int | None
    """First rows of each log that are used; all without"""
    measuring: Measuring
    networks: tuple[str, ...]
    """Readouts that are trained on the grid's first seed alone, for they take long"""
    slow: tuple[str, ...] = ()
    """Readouts that are trained on it at the grid's second slack alone"""

    def point(self, stiffness: float | None, **others: Any) -> GridPoint:
        """One point as the grid has it but for what is given."""
        usual = {
            "slack": self.slack[1],
            "damping": NOMINAL.joint_damping,
            "rate": self.rate,
            "amplitude": SPEED / self.rate,
            "seed": self.seeds[0],
            "steps": self.steps,
            "load_noise": LOAD_NOISE,
        }
        return GridPoint(stiffness, **(usual | others))

    def points(self) -> dict[str, list[GridPoint]]:
        """All points by what they are for; some serve twice."""
        K, middle = self.stiffness, self.stiffness[len(self.stiffness) // 2]
        return {
            GRID: [
                self.point(k, slack=x, seed=s) for x in self.slack for k in K for s in self.seeds
            ],
            RATES: [self.point(k, rate=f, amplitude=SPEED / f) for f in self.rates for k in K],
            AMPLITUDES: [self.point(k, amplitude=a) for a in self.amplitudes for k in K[::2]],
            CROSSED: [
                self.point(middle, rate=f, amplitude=a)
                for f in self.rates
                for a in self.amplitudes
                if f * a <= SPEED * (1 + 1e-9)
            ],
            RATIO: [self.point(k, damping=damping_at(k)) for k in K[::2]],
            WEIGHTLESS: [
                Weightless(**vars(self.point(k, seed=s)))
                for k in self.weightless
                for s in self.seeds
            ],
            NOISES: [self.point(middle, load_noise=noise) for noise in self.noises],
            RIGID: [self.point(None, slack=0.0, damping=0.0, seed=s) for s in self.seeds],
        }


POSED = GRID, RATIO, NOISES
"""What is measured with pose errors; other commands do not change these, as sessions have their own"""


def full(rate: float, slow: tuple[str, ...] = ()) -> SweepPlan:
    """The whole sweep at a rate [Hz]: 8 × 4 × 3 points, and some 50 others."""
    stiffness = tuple(float(f"{k:.3g}") for k in np.geomspace(600, 1.9e5, 8))
    return SweepPlan(
        stiffness=stiffness,
        slack=(0.0, 3e-4, 1e-3, 3e-3),
        rate=rate,
        seeds=(0, 1, 2),
        rates=(rate / 1.6, rate, 1.6 * rate),
        amplitudes=tuple(SPEED / rate / part for part in (4, 2, 1)),
        weightless=stiffness[1::3],
        noises=(0.001, LOAD_NOISE, NOMINAL.load_noise),
        steps=20_000,
        log_rows=None,
        measuring=Measuring(session_rate=PUBLISHED_RATE),
        networks=("mlp", "ensemble"),
        slow=slow,
    )


def quick() -> SweepPlan:
    """A minute's worth: shows that everything works, and little else."""
    stiffness = (2e3, 1.2e4, 8e4)
    few = Measuring(
        delays=(4, 2, 0), memory_delay=8, taps=2, stretches=10, washout=10, repeated=40, stream=4,
        coarsest=1.0, sessions=3, session_steps=200,
        session_rate=PUBLISHED_RATE, epochs=2,
    )  # fmt: skip
    return SweepPlan(
        stiffness=stiffness,
        slack=(0.0, 1e-3),
        rate=PUBLISHED_RATE,
        seeds=(0,),
        rates=(PUBLISHED_RATE,),
        amplitudes=(SPEED / PUBLISHED_RATE / 2, SPEED / PUBLISHED_RATE),
        weightless=stiffness[1:2],
        noises=(LOAD_NOISE, NOMINAL.load_noise),
        steps=400,
        log_rows=300,
        measuring=few,
        networks=("mlp",),
    )


def damping_at(stiffness: float) -> float:
    """Damping of each hinge [N m s/rad] at which the cables' modes keep the nominal damping ratio.

    c / (2 √(k I)) is the same.
    """
    return float(f"{NOMINAL.joint_damping * np.sqrt(stiffness / NOMINAL.strand_stiffness):.4g}")


def natural_period(stiffness: float) -> float:
    """Longest period [s] of the hanging arm's small swings on strands [N/m] without slack or friction."""
    parameters = replace(NOMINAL, strand_stiffness=stiffness, strand_slack=0.0)
    model = TwinModel(parameters).spec(motors=False).compile()
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    columns = [_torque(model, data, j) for j in range(model.nv)]
    eigenvalues = np.linalg.eigvals(np.linalg.solve(mass, -np.stack(columns, axis=1)))
    return float(2 * np.pi / np.sqrt(eigenvalues.real.min()))


def _torque(model: mujoco.MjModel, data: mujoco.MjData, joint: int, step: float = 1e-4) -> Array:
    """Derivative of the generalised forces by one coordinate, (nv,)."""
    force = []
    for angle in (step, -step):
        data.qpos[:] = data.qvel[:] = 0.0
        data.qpos[joint] = angle
        mujoco.mj_forward(model, data)
        force.append(data.qfrc_smooth.copy())
    return (force[0] - force[1]) / (2 * step)
