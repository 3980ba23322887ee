"""A machine whose residual is linear, for fits."""

from dataclasses import dataclass, field

import numpy as np

from serpent_twin.effects import Range
from serpent_twin.identification.score_test import scores
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Stopwatch
from serpent_twin.machines.machine import Declared, ParameterVector, Quantity

SEGMENTS, NUMBERS = 12, 300
GUST, NOTHING = "gust", "nothing"


@dataclass(frozen=True)
class LinearCase:
    """y − X a − b g: two declared parameters, one candidate that is there and one that is not."""

    X: np.ndarray
    g: np.ndarray
    other: np.ndarray
    y: np.ndarray
    told = None
    declared: tuple = (
        Declared("one", "1", 1e3, 0.1),
        Declared("two", "1", 1e3, 0.1),
    )
    candidates: dict = field(
        default_factory=lambda: {
            name: Candidate(name, {"size": Range("m", 0.0, 10.0, 1.0)}, (np.array([1.0]),))
            for name in (GUST, NOTHING)
        }
    )
    unseen: dict = field(default_factory=dict)
    not_sought: tuple = ()
    clock: Stopwatch = field(default_factory=Stopwatch)
    channels: int = 3
    segments: tuple = (99, 99)
    weak_rounds: int = 0
    differentiates: bool = False
    steps_of_derivative: int = 10
    adds_up: bool = False
    noise: np.ndarray = field(default_factory=lambda: np.ones(3))
    widened: dict = field(default_factory=dict)

    @property
    def machine(self):
        return self

    @property
    def quantities(self):
        return [Quantity(d.name, d.unit, 0.0, 1.0, (d.name,)) for d in self.declared]

    def take(self, pieces, which):
        return [pieces[k] for k in which]

    def coarse_step(self, points):
        return 0.5

    def residual(self, points, pieces, timestep=None):
        """Longer time steps move all numbers alike."""
        out = []
        for p in points:
            r = self.y - self.X @ p.declared
            r = r - self.g * p.effects.get(GUST, [0.0])[0]
            out.append((r - self.other * p.effects.get(NOTHING, [0.0])[0])[pieces])
        return self.weigh(np.array(out) + (timestep or 0.0))

    def weigh(self, rows):
        return rows / np.tile(self.noise, NUMBERS // self.channels)

    def jacobian(self, point, pieces):
        known = self.weigh(-self.X[pieces][None, ..., 1])
        return np.concatenate([np.full_like(known, np.nan), known])


def case(strength: float, seed: int = 0) -> LinearCase:
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((SEGMENTS, NUMBERS, 2))
    g, other = rng.standard_normal((2, SEGMENTS, NUMBERS))
    noise = 0.5 * rng.standard_normal((SEGMENTS, NUMBERS))
    return LinearCase(X, g, other, X @ [1.0, -2.0] + strength * g + noise)


def every() -> list[int]:
    return list(range(SEGMENTS))


START = ParameterVector(np.zeros(2))


def scored(arm, base):
    """The score test of the candidate that is there."""
    (found,) = scores(arm, every(), base, [arm.candidates[GUST]])
    return found
