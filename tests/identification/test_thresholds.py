"""A fitted law's thresholds are sought anew: a fit cannot move one where no row lies near it."""

from dataclasses import dataclass

import numpy as np
import pytest
from made_residual import C, M, Made, S

from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery import better_thresholds
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters
from serpent_twin.machines.machine import ParameterVector

STEP = "slack of cable1_plus: above runtime of machine"
WINDOW = "joint_torque of joint1: within joint_angle of joint1"
WAVE = "joint_torque of joint1: periodic motor_angle of motor1"


@dataclass(frozen=True)
class MadeCase:
    """A case whose twin adds a composed law to first order."""

    made: Made

    def __getattr__(self, name):
        return getattr(self.made.case, name)

    def take(self, pieces, used):
        return pieces

    def places(self, point, some):
        return self.made

    def residual(self, points, some):
        out = np.array([self.made.fit.residual] * len(points))
        for row, point in zip(out, points, strict=True):
            for name, values in point.effects.items():
                law = parse(name.split("@")[1])
                shown = next(r for r in self.made.responses if r.place == law.place).change[0]
                x = self.made.readings[law.reading, law.where]
                follows = SHAPES[law.shape].form(x, *values[4:6])[..., None]
                row -= (values[0] * follows * shown).reshape(S, -1)
        return out


def fitted(made, at, values):
    """A fit that has a law with these numbers, and its size free."""
    name, case = f"discovered@{at}", MadeCase(made)
    point = ParameterVector(np.zeros(M)).having(name, np.array(values, float))
    own = np.random.default_rng(1).standard_normal((1, *made.fit.residual.shape))
    return (
        name,
        case,
        Fit(
            point,
            FreeParameters(tuple(range(M)), ((name, 0),)),
            cost=0.0,
            variance_inflation=1.0,
            error=np.ones(M + 1),
            correlation=np.eye(M + 1),
            converged=True,
            jacobian=np.concatenate([made.fit.jacobian, own.astype(np.float32)]),
            residual=case.residual([point], None)[0],
            used=tuple(range(S)),
            noise=np.ones(C),
        ),
    )


def test_a_threshold_far_from_where_it_should_be_is_found():
    made = Made(Discovered(0.5, at=STEP, first=93.0))
    name, case, fit = fitted(made, STEP, [0.5, 0, 0, 0, 60.0, 0, 0, 0])
    values = better_thresholds(case, made.pieces, fit, name).effects[name]
    assert values[4] == pytest.approx(93.0, abs=3.0)
    assert values[0] == pytest.approx(0.5, rel=0.2)


def test_either_end_of_a_window_is_moved():
    made = Made(Discovered(0.6, at=WINDOW, first=-0.3, second=0.7))
    name, case, fit = fitted(made, WINDOW, [0.6, 0, 0, 0, -0.3, 1.1, -2, 2])
    values = better_thresholds(case, made.pieces, fit, name).effects[name]
    assert values[4] + values[5] == pytest.approx(0.4, abs=0.05)


def test_thresholds_that_are_right_and_laws_without_any_stay():
    made = Made(Discovered(0.5, at=STEP, first=93.0))
    name, case, fit = fitted(made, STEP, [0.5, 0, 0, 0, 93.0, 0, 0, 0])
    assert better_thresholds(case, made.pieces, fit, name) is None
    name, case, fit = fitted(made, WAVE, [0.1, 0, 0, 0, 3.0, 0.5, 0, 0])
    assert better_thresholds(case, made.pieces, fit, name) is None
