"""Identifiability against the posterior of linear-Gaussian problems in closed form."""

import json
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear_case import GUST, NOTHING, START, LinearCase, case, every

from serpent_twin.identification import detection
from serpent_twin.identification.acceptance import MIN_GAIN
from serpent_twin.identification.detection import identifiability
from serpent_twin.identification.excitation import excitation
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.fitting.weak_directions import (
    NamedParameter,
    in_words,
    weakest_directions,
)
from serpent_twin.identification.score_test import scores
from serpent_twin.machines.machine import Declared, Output
from serpent_twin.residual import ANGLE, TORQUE, Comparison

PRIORS = (0.02, 3.0)


class Rows(list):
    """Segments of 100 rows and 3 channels, all measured."""

    @property
    def measured(self):
        return np.zeros((len(self), 100, 3))


@dataclass(frozen=True)
class Weighed(LinearCase):
    """A linear machine that says what its channels are, and moves two motors."""

    still: bool = False

    @property
    def machine(self):
        kinds = (ANGLE, ANGLE, TORQUE)
        return SimpleNamespace(outputs=[Output(m.one, m, 1e-9) for m in kinds])

    def take(self, pieces, which):
        return Rows(super().take(pieces, which))

    def noise_of(self, error):
        return np.sqrt(np.nanmean(error**2, axis=0))

    def compare(self, point, pieces):
        time = np.tile(0.1 * np.arange(100), (len(pieces), 1))
        angle = np.stack([np.sin(time), np.zeros_like(time) if self.still else np.cos(time)], -1)
        load = np.full((*time.shape, 2), 0.1)
        return Comparison(
            session=("a",) * len(pieces),
            time=time,
            load_measured=load,
            load_predicted=load,
            motor_angle=angle,
            motor_names=("left", "right"),
        )


def linear(strength=0.0, seed=0, **others):
    """A case whose parameters have priors of different widths, and share some of what they change."""
    made = case(strength, seed)
    X = made.X.copy()
    X[..., 1] += 0.8 * X[..., 0]
    y = made.y - made.X @ [1.0, -2.0] + X @ [0.01, -2.0]
    declared = tuple(Declared(n, "1", p, 0.1) for n, p in zip("ab", PRIORS, strict=True))
    g = made.g + 2.0 * X[..., 1]
    values = {"X": X, "g": g, "other": made.other, "y": y, "declared": declared}
    return Weighed(**(values | others))


def opened(of):
    return fit(of, every(), START, free_parameters(of, ()), 1, 99, steps=0)


def told(of):
    opening = opened(of)
    found = scores(of, every(), opening, list(of.candidates.values()))
    return identifiability(of, every(), opening, found, lambda _, make: make())


@pytest.fixture(scope="module")
def exact():
    """The joint posterior of both parameters and one effect, by the normal equations."""
    of = linear()
    flat = np.column_stack([of.X.reshape(-1, 2), of.g.ravel(), of.other.ravel()])
    priors = np.array([*PRIORS, 10.0, 10.0])
    inflation = told(of).variance_inflation
    left = of.y.ravel()
    noise = np.ones(3)
    for _ in range(2):  # weights are chosen once, then the information is computed with them
        weights = np.tile(noise**-2, flat.shape[0] // 3)
        normal = (flat * weights[:, None]).T @ flat + np.diag(priors**-2)
        left = of.y.ravel() - flat @ np.linalg.solve(
            normal, (flat * weights[:, None]).T @ of.y.ravel()
        )
        noise = np.sqrt((left.reshape(-1, 3) ** 2).mean(axis=0))
    weights = np.tile(noise**-2, flat.shape[0] // 3) / inflation
    data = (flat * weights[:, None]).T @ flat
    return of, data, left.reshape(-1, 3)


@dataclass(frozen=True)
class Misled(Weighed):
    """A machine whose derivatives are off, as those along a motion that sticks and slips are."""

    off: float = 0.0

    def jacobian(self, point, pieces):
        found = super().jacobian(point, pieces)
        return found + self.off * np.random.default_rng(7).standard_normal(found.shape)


def test_a_limit_is_what_a_fit_takes_up_though_derivatives_say_less(monkeypatch):
    exact = linear()
    g = 3.0 * exact.X[..., 1] + 0.3 * exact.g
    exact, misled = linear(g=g), replace(Misled(**vars(exact)), g=g, off=0.5)
    right, found = (_limit(told(of), GUST) for of in (exact, misled))
    assert found == pytest.approx(right, rel=0.25)
    monkeypatch.setattr(detection, "_SURELY", np.inf)
    assert _limit(told(exact), GUST) == pytest.approx(right, rel=0.02)
    assert _limit(told(misled), GUST) < 0.6 * right


def _limit(of, name):
    return next(each.limit for each in of.effects if each.name == name)


def test_standard_deviations_and_variance_inflation_are_those_of_the_joint_posterior(exact):
    of, data, _ = exact
    information = data[:2, :2] + np.diag(np.array(PRIORS) ** -2.0)
    covariance = np.linalg.inv(information)
    for k, each in enumerate(told(of).parameters):
        assert each.name == "ab"[k]
        assert each.prior == pytest.approx(PRIORS[k])
        assert each.posterior == pytest.approx(np.sqrt(covariance[k, k]), rel=2e-3)
        expected = covariance[k, k] * information[k, k]
        assert each.variance_inflation == pytest.approx(expected, rel=2e-3)
        assert each.ratio == each.posterior / each.prior


def test_the_limit_of_detection_is_three_standard_errors_of_the_joint_posterior(exact):
    """The effect has no prior of its own; its share that is taken up is that of a weighted regression."""
    of, data, _ = exact
    for name, at in ((GUST, 2), (NOTHING, 3)):
        some = [0, 1, at]
        joint = data[np.ix_(some, some)] + np.diag([*np.array(PRIORS) ** -2.0, 0.0])
        (found,) = (each for each in told(of).effects if each.name == name)
        assert found.by_scatter == pytest.approx(3 * np.sqrt(np.linalg.inv(joint)[2, 2]), rel=2e-3)
        assert found.parameter == "size" and found.unit == "m" and found.typical == 1.0
    gust, nothing = (next(e for e in told(of).effects if e.name == n) for n in (GUST, NOTHING))
    assert gust.taken_up > 0.1 > nothing.taken_up >= 0


def test_what_is_correlated_most_is_named_with_the_correlation_of_the_joint_posterior(exact):
    of, data, _ = exact
    joint = np.linalg.inv(data[:3, :3] + np.diag([*np.array(PRIORS) ** -2.0, 0.0]))
    second = told(of).parameters[1]
    assert second.confounded_with == GUST
    assert second.correlation == pytest.approx(
        joint[1, 2] / np.sqrt(joint[1, 1] * joint[2, 2]), rel=5e-3
    )


def test_a_strength_at_the_gain_limit_betters_the_error_by_what_an_accepted_effect_must(exact):
    of, _, left = exact
    (found,) = (each for each in told(of).effects if each.name == NOTHING)
    change = found.by_gain * of.other.reshape(-1, 3)  # nothing of it is taken up, but for chance
    gains = []
    for which in ([0, 1], [2]):
        one, other = ((r[:, which] ** 2).sum() for r in (left, left + change))
        gains.append(1 - np.sqrt(one / (one + (change[:, which] ** 2).sum())))
        assert other == pytest.approx(one + (change[:, which] ** 2).sum(), rel=0.02)
    assert np.mean(gains) == pytest.approx(MIN_GAIN, rel=0.02)
    assert found.limit == max(found.by_gain, found.by_scatter)


def test_an_effect_that_is_a_parameter_cannot_be_told():
    of = linear()
    found = told(replace(of, other=of.X[..., 1]))
    (same,) = (each for each in found.effects if each.name == NOTHING)
    assert same.taken_up == pytest.approx(1.0, abs=1e-3)
    assert NOTHING in found.hidden and found.advice and found.sentence().endswith(found.advice)


def test_effects_that_change_the_same_are_confounded_both_ways():
    of = linear()
    found = told(replace(of, other=-of.g + 0.01 * of.other))
    for each in found.effects:
        ((name, cosine),) = each.confounded_with.items()
        assert name != each.name and cosine == pytest.approx(-1.0, abs=0.01)


def test_a_motor_that_never_turns_says_so():
    of = linear()
    assert not any(each.still for each in told(of).inputs)
    found = told(replace(of, still=True, other=of.X[..., 1]))
    assert [each.name for each in found.inputs if each.still] == ["right"]
    assert "Right never moves." in found.sentence() and found.advice.startswith("Move right")
    numbers = json.loads(json.dumps(found.numbers()["inputs"]))
    assert numbers[1] == {
        "name": "right",
        "range_rad": 0.0,
        "speed_rms_rad_per_s": 0.0,
        "moves": False,
    }


def test_the_advised_motion_is_the_one_that_the_effect_follows():
    of = linear()
    speed = np.repeat(np.abs(np.cos(0.1 * np.arange(100))), 3)  # the left motor's, in all channels
    X = of.X.copy()
    X[..., 1] = speed
    found = told(replace(of, X=X, other=X[..., 1]))
    assert found.advice == "To show nothing, move left faster."


def test_a_range_of_motion_is_as_logged():
    c = linear().compare(START, [0])
    left, right = excitation(c)
    assert left.range == pytest.approx(np.ptp(np.sin(c.time)))
    assert right.speed == pytest.approx(np.sqrt(np.mean(np.sin(c.time) ** 2)), rel=0.01)


def named(*names):
    return [NamedParameter(name, "mm") for name in names]


def test_the_weakest_direction_is_the_one_that_the_logs_leave():
    """Only the sum of two parameters is measured, with information h: their difference keeps its prior."""
    prior, along = np.diag([4.0, 9.0, 1.0]), np.array([1 / 2, 1 / 3, 0.0])
    h = 50.0
    data = h * np.outer(along, along) + np.diag([0, 0, 1e4])
    posterior = np.linalg.inv(np.linalg.inv(prior) + data)
    weakest, second, third = weakest_directions(named("a 1", "a 2", "b"), prior, posterior)
    assert {weakest.parameters} <= {"a 1 up and a 2 down", "a 2 up and a 1 down"}
    assert weakest.ratio == pytest.approx(1.0)
    assert weakest.prior == pytest.approx({"a 1": 2, "a 2": 3}[weakest.leading] / np.sqrt(2))
    assert second.parameters == "a 1, 2 together"
    assert second.ratio == pytest.approx(1 / np.sqrt(1 + 2 * h))
    assert third.parameters == "b" and third.ratio == pytest.approx(1 / np.sqrt(1 + 1e4))
    assert str(third) == "b: prior 1 mm, logs 0.01 mm"


def test_parameters_of_which_nothing_is_told_are_not_mixed_with_one_another():
    prior = np.diag(np.arange(1.0, 7.0) ** 2)
    found = weakest_directions(named(*"abcdef"), prior, prior)
    assert len({each.parameters for each in found}) == 5
    assert all(each.parameters in "abcdef" and each.ratio == pytest.approx(1.0) for each in found)


def test_names_that_differ_in_a_number_are_joined():
    assert in_words(["winch 3", "winch 1", "winch 2", "winch 9"]) == "winch 1–3, 9"
    assert in_words(["slack 2+", "slack 2−"]) == "slack 2+ and slack 2−"
    assert in_words(["a", "b 1", "c", "d"]) == "a, b 1 and 2 more"


def test_what_only_priors_tell_apart_has_the_errors_of_priors():
    """Two parameters that change one and the same, 100,000 times as much as noise: their sum is known,
    so that either is known as well as the other's prior and its own make it. In single precision the sums
    of squares would be off by more than the priors; the derivatives are by far less.
    """
    made = case(0.0, 0)
    same = 1e5 * np.stack([made.X[..., 0]] * 2, axis=-1)
    of = linear(X=same, y=made.y - made.X @ [1.0, -2.0])
    found = opened(of)
    alone = (1 / np.square(PRIORS)).sum() ** -0.5
    np.testing.assert_allclose(found.error, alone, rtol=1e-3)
