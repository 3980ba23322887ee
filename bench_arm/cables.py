"""Compute the tension of each strand."""

from collections.abc import Iterable, Sequence

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS
from serpent_twin.arrays import Array

from .effects import Effects
from .parameters import BenchArm

LEAST_STIFFNESS = 0.1  # a strand that wears keeps at least this share
RADIUS = np.array(ARM.pulley_radius[:N_JOINTS])


class Strands:
    """Both strands of nine cables in each of R rows, (R, 2, 9): + strands, then − strands."""

    def __init__(self, arms: Sequence[BenchArm], effects: Sequence[Effects]) -> None:
        shape = (len(arms), 2, N_JOINTS)
        self.stiffness = np.array([a.strand_stiffness for a in arms]).reshape(shape)
        self.fresh_stiffness = self.stiffness
        self.slack = np.array([a.strand_slack for a in arms]).reshape(shape)
        self.damping = _rows(a.strand_damping for a in arms)
        self.affected = np.array([_affected(e) for e in effects])
        """Which strands creep, stiffen, wear and rub, (R, 2, 9)."""
        self.curvature = self.affected * _rows(e.cable_stiffening for e in effects)
        self.creep = self.affected * _rows(e.cable_creep for e in effects)
        self.creep_time = _rows(e.creep_time for e in effects)
        self.drift = self.affected * _rows(e.stiffness_drift / 3600 for e in effects)
        self.threshold = _rows(e.clamp_threshold for e in effects)
        one = np.eye(2 * N_JOINTS)[[e.clamp_strand for e in effects]].reshape(shape)
        self.slip_rate = one * _rows(e.clamp_slip for e in effects)
        self.crept, self.slipped = np.zeros(shape), np.zeros(shape)
        """Elongation that comes back, and that stays [m]."""
        self.rest = self.slack
        """Stretch of the loop from which each strand pulls now [m]."""

    def pull(self, loop: Array, rate: Array) -> tuple[Array, Array, Array, np.ndarray]:
        """Tensions [N], their slopes by stretch [N/m] and rate [N s/m], and which strands pull.

        `loop` (R, 9) is each loop's stretch [m], its `rate` in m/s; all results (R, 2, 9).
        """
        over = np.stack([loop, -loop], 1) - self.rest
        x = np.maximum(over, 0)
        bent = self.stiffness * x
        elastic = bent * (1 + self.curvature * x)
        tension = elastic + self.damping * np.stack([rate, -rate], 1)
        taut = (over > 0) & (tension > 0)
        slope = self.stiffness + 2 * self.curvature * bent
        return tension * taut, slope * taut, self.damping * taut, taut

    def age(self, tension: Array, h: float, clock: Array) -> None:
        """Creep, slip and wear for h [s] under tensions [N]; `clock` (R,) is the running time [s]."""
        if self.drift.any():
            left = np.maximum(1 - self.drift * clock[:, None, None], LEAST_STIFFNESS)
            self.stiffness = self.fresh_stiffness * left
        if self.creep.any():
            goal = self.creep * tension / self.stiffness
            self.crept += (goal - self.crept) * (h / (self.creep_time + h))
        if self.slip_rate.any():
            self.slipped += h * self.slip_rate * np.maximum(tension - self.threshold, 0)
        self.rest = self.slack + self.crept + self.slipped


def _affected(effects: Effects) -> np.ndarray:
    """Which strands an effect changes, (2, 9) of bool: + strands, then − strands."""
    cable = np.isin(np.arange(1, N_JOINTS + 1), effects.cable) | (effects.cable == 0)
    side = np.array([effects.side >= 0, effects.side <= 0])
    return side[:, None] & cable


def _rows(values: Iterable[float]) -> Array:
    """One value per row, (R, 1, 1)."""
    return np.array(list(values), float)[:, None, None]
