"""Test that of an effect with several strengths only those are stated as found that logs determine."""

from dataclasses import dataclass, field
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from linear_case import SEGMENTS, START, LinearCase, case, every

from serpent_twin.effects import Range
from serpent_twin.identification.build_diagnosis import estimates
from serpent_twin.identification.components import without_undetermined
from serpent_twin.identification.estimates import ParameterEstimate
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.held_out import Errors
from serpent_twin.identification.score_test import scores
from serpent_twin.identification.trials import Trials
from serpent_twin.machines.candidate import Candidate

TILT = "tilt"
_RANGE = Range("rad", -10.0, 10.0, 1.0)


@dataclass(frozen=True)
class Tilted(LinearCase):
    """A linear machine with one effect of two components."""

    candidates: dict = field(
        default_factory=lambda: {
            TILT: Candidate(TILT, {"y": _RANGE, "z": _RANGE}, (np.array([1.0, 1.0]),))
        }
    )

    def residual(self, points, pieces, timestep=None):
        out = []
        for p in points:
            y, z = p.effects.get(TILT, (0.0, 0.0))
            out.append((self.y - self.X @ p.declared - self.g * y - self.other * z)[pieces])
        return self.weigh(np.array(out))


class Pieces(list):
    """Segments of three sessions."""

    session = tuple(f"session_{n // 4}" for n in range(SEGMENTS))


def tilted(y, z):
    """An arm that has both, its fit, and what is left without undetermined components."""
    plain = case(y)
    arm = Tilted(plain.X, plain.g, plain.other, plain.y + z * plain.other)
    base = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    (score,) = scores(arm, every(), base, [arm.candidates[TILT]])
    begun = START.having(TILT, np.array([0.1, 0.1]))
    found = fit(arm, Pieces(every()), begun, free_parameters(arm, [TILT]), 3, 99)
    made = []

    def errors(arm, point):
        squares = arm.residual([point], every())[0].reshape(SEGMENTS, 5, -1) ** 2
        return Errors(np.sqrt(squares.mean(axis=-1)), np.full((SEGMENTS, 5), np.nan))

    trials = SimpleNamespace(
        training=Pieces(every()),
        notes=SimpleNamespace(fit=lambda stage, make: made.append(stage) or make()),
        on_progress=lambda _: None,
        errors=errors,
    )
    trials.further = partial(Trials.further, trials)
    rounds = [SimpleNamespace(accepted=(TILT,), trials={TILT: SimpleNamespace(score=score)})]
    left, bounds = without_undetermined(trials, arm, found, rounds)
    assert len(made) == len(set(made))
    return arm, found, left, bounds


def test_both_components_stay_where_both_show():
    _, found, left, bounds = tilted(0.7, -0.4)
    assert left is found and not bounds


@pytest.mark.parametrize(("truth", "lost"), [((0.7, 0.02), 1), ((0.02, 0.7), 0)])
def test_a_component_that_gains_nothing_by_itself_is_not_stated_as_found(truth, lost):
    arm, found, left, bounds = tilted(*truth)
    assert list(bounds) == [(TILT, lost)] and left.free.effects == ((TILT, 1 - lost),)
    assert left.point.effects[TILT][lost] == 0.0
    assert left.point.effects[TILT][1 - lost] == pytest.approx(0.7, abs=0.1)
    assert bounds[TILT, lost] > abs(found.point.effects[TILT][lost])
    told = estimates(arm, left, TILT, bounds)
    weak, sure = (told["yz"[k]] for k in (lost, 1 - lost))
    assert sure.determined and not weak.determined
    assert weak.value == 0.0 and weak.low < truth[lost] < weak.high
    assert "not determined by these logs" in str(weak) and "[" in str(sure)
    assert vars(weak)["determined"] is False


def test_none_is_determined_where_each_can_stand_for_the_other():
    """They stay in the twin: something is there, and no logs say which."""
    arm, found, left, bounds = tilted(0.05, 0.0)
    assert left is found and set(bounds) == {(TILT, 0), (TILT, 1)}
    told = estimates(arm, left, TILT, bounds)
    assert not any(each.determined for each in told.values())
    assert told["y"].value == found.point.effects[TILT][0]


def test_an_interval_as_wide_as_the_range_says_nothing():
    arm, found, _, _ = tilted(0.7, -0.4)
    wide = Candidate(TILT, {"y": Range("rad", 0.69, 0.73, 0.7), "z": _RANGE}, (np.ones(2),))
    arm.candidates[TILT] = wide
    told = estimates(arm, found, TILT)
    assert not told["y"].determined and told["z"].determined


def test_values_that_were_given_are_no_open_question():
    assert str(ParameterEstimate(2.0, 2.0, 2.0, "1")) == "2 [given]"
