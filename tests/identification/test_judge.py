"""Test how a trace judges: rivals, pairs, parameters that are not as built, bars, stand-ins and limits."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear_case import GUST, NOTHING, START, LinearCase, case, every

from serpent_twin.effects import Range
from serpent_twin.identification.acceptance import CandidateTrial, accepting
from serpent_twin.identification.bars import BEYOND, Bars
from serpent_twin.identification.build_diagnosis import _stands_in
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.fitting.uncertainty import drawn
from serpent_twin.identification.held_out import Errors
from serpent_twin.identification.moved import _expected, moved, too_far
from serpent_twin.identification.neglected import neglected
from serpent_twin.identification.rivals import Rival, cosine, pairs, rivals
from serpent_twin.identification.score_test import (
    BESIDE_OTHERS,
    WORTH_A_FIT,
    Score,
    scores,
)
from serpent_twin.identification.trials import Trials
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import Quantity
from serpent_twin.residual import MARKERS
from serpent_twin.residual.noise import expected_distance

RNG = np.random.default_rng(5)
ONE_SIDED, SIGNED = Range("1", 0.0, 10.0, 1.0), Range("1", -10.0, 10.0, 1.0)


def scored(name: str, beyond: np.ndarray, share: float = 0.0) -> Score:
    return Score(name, share, 1.0, np.ones(1), False, beyond, beyond, np.ones(1))


def candidate(name: str, allowed: Range = SIGNED) -> Candidate:
    return Candidate(name, {"size": allowed}, (np.ones(1),))


def of(*names: str) -> dict[str, Candidate]:
    return {name: candidate(name) for name in names}


def test_what_changes_the_residual_alike_is_a_rival():
    """Whatever their signs and sizes; the most alike first."""
    a, b, other = RNG.standard_normal((3, 500))
    found = {
        "a": scored("a", a),
        "twice": scored("twice", -2 * a),
        "near": scored("near", a + 0.5 * b),
        "other": scored("other", other),
    }
    assert cosine(found["a"], found["twice"]) == pytest.approx(1.0)
    alike = rivals("a", found, of(*found))
    assert list(alike) == ["twice", "near"]
    assert alike["near"] == pytest.approx(1 / np.sqrt(1.25), abs=0.05)
    friction = of(*found) | {name: candidate(name, ONE_SIDED) for name in ("a", "twice", "near")}
    assert list(rivals("a", found, friction)) == [
        "near"
    ]  # twice as much of it is less than nothing
    assert Rival("near", 0.9, 0.2, 0.001).told_apart
    assert not Rival("near", 0.9, 0.0, 0.4).told_apart
    assert not Rival("near", 0.9, None, None).told_apart


def test_an_effect_is_reported_from_the_last_round_that_accepted_it():
    """A law may be accepted, give way to another, and come back in its place."""
    rounds = [SimpleNamespace(accepted=each) for each in (("law",), ("other",), ("law",), ())]
    assert [accepting(rounds, name) for name in ("law", "other")] == [2, 1]


def test_two_effects_that_hide_each_other_are_tried_as_a_pair():
    """Opposite and nearly alike: each alone removes little of what both together make."""
    common, small = RNG.standard_normal((2, 900))
    a, b = common + 0.2 * small, -common + 0.2 * small
    residual = -(a + b) + 0.05 * RNG.standard_normal(900)
    both = [a, b, RNG.standard_normal(900)]
    total = residual @ residual
    found = [
        scored(name, each, (each @ residual) ** 2 / (each @ each) / total)
        for name, each in zip("abc", both, strict=True)
    ]
    (pair, *_) = pairs(found, residual, of("a", "b", "c"))
    assert pair.names == ("a", "b")
    assert pair.share > 0.9 and pair.alone < 0.2
    assert pair.size == pytest.approx((1.0, 1.0), abs=0.1)
    backwards = pairs(
        found, -residual, {name: candidate(name, ONE_SIDED) for name in ("a", "b", "c")}
    )
    assert all(each.names != ("a", "b") for each in backwards)  # no strength is negative


def test_what_the_free_parameters_take_up_does_not_count():
    """Against the regression of a change on the derivatives, with priors that hold nothing."""
    arm = case(0.0)
    base = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    known, slopes = Information.of(arm, base), base.jacobian.reshape(2, -1).astype(float)
    change = RNG.standard_normal(slopes.shape[1]) + 3 * slopes[0]
    taken = np.linalg.lstsq(slopes.T, change)[0]
    assert known.beyond(change) == pytest.approx(change - taken @ slopes, abs=1e-3)
    one = known.without(0).beyond(change)
    assert one == pytest.approx(
        change - (change @ slopes[1]) / (slopes[1] @ slopes[1]) * slopes[1], abs=1e-3
    )


def test_a_parameter_that_is_not_as_built_is_named_with_what_it_may_stand_for():
    """One declared parameter whose tolerance is exceeded, and a candidate that changes the same."""
    arm = case(0.0)
    alike = replace(arm, g=arm.X[..., 1])
    base = fit(alike, every(), START, free_parameters(alike, ()), 3, 99)
    found = scores(alike, every(), base, [alike.candidates[name] for name in (GUST, NOTHING)])

    def built(tolerance: float):
        quantities = [
            Quantity(d.name, "mm", 5.0, 1.0, (d.name,), 5.0, tolerance) for d in alike.declared
        ]
        kept = ("declared", "noise", "candidates", "channels", "machine", "widened")
        names = {n: getattr(alike, n) for n in kept}
        return moved(SimpleNamespace(quantities=quantities, **names), base, found)

    two, one = built(0.1)
    assert (two.name, one.name) == ("two", "one")
    assert two.value == pytest.approx(3.0, abs=0.05) and two.expected == 5.0
    assert two.widths == pytest.approx(-20, rel=0.05)
    assert list(two.stands_for) == [GUST] and two.stands_for[GUST] > 0.99
    assert one.stands_for == {}
    assert str(replace(two, value=3.0)).startswith("two is 3 mm where 5 is expected, ")
    assert built(0.7) == () and len(built(0.5)) == 1


def test_of_many_numbers_the_furthest_is_further_off_by_chance():
    """Chance puts one of 110 numbers as built off by more than 3.0 widths in a quarter of all cases."""
    off = np.abs(np.random.default_rng(0).standard_normal((4000, 110))).max(axis=1)
    assert too_far(1) == 3.0
    assert (off > 3.0).mean() > 0.2 and (off > too_far(110)).mean() < 0.005


def test_parts_that_are_built_alike_are_judged_by_their_median():
    kind = [Quantity(f"slack {n}", "mm", 0.5, 1.0, (str(n),), 9.0, 0.2, "slack") for n in range(5)]
    assert _expected(kind, np.array([0.5, 0.6, 0.4, 3.9, 0.5]), 3) == pytest.approx(0.5)


def test_the_bar_does_not_rise_with_what_looks_like_noise():
    """Jitter raises it as far as no pose explains it, and no further."""
    assert Bars(camera_noise=0.24, complete_twin=0.32, jitter=5.0).bar == 0.32
    assert Bars(camera_noise=0.40, complete_twin=0.32, jitter=5.0).bar == 0.40
    assert Bars(camera_noise=0.40, complete_twin=0.32, jitter=0.35).bar == 0.35
    assert Bars(0.24, 0.32, float("nan")).bar == 0.32
    assert Bars(0.24, 0.32, 5.0, 9.0).bar == 9.0 and Bars(0.24, 0.32, 0.3, 0.1).bar == 0.32
    assert Bars(0.24, 0.32, 5.0, 9.0).numbers("mm")["held"] == "before_change"
    told = Bars(0.40, 0.32, 5.0).numbers("mm")
    assert told["held"] == "jitter" and told["bar_mm"] == 0.40 and BEYOND == 2.0


@pytest.mark.parametrize(
    ("calibrated", "corrected", "stands_in"),
    [(6.4, 2.7, True), (6.4, 0.45, False), (1.3, 0.65, False), (8.0, 1.6, False)],
)
def test_effects_that_leave_much_are_stand_ins(calibrated, corrected, stands_in):
    """Several times what could be noise, unless nearly all of the error was explained."""
    error = {"calibrated": calibrated, "corrected": corrected}
    assert _stands_in(error, Bars(0.24, 0.3, 0.5)) == stands_in


def test_twins_that_logs_cannot_tell_apart_keep_a_strength_that_is_at_its_limit():
    arm = case(0.7)
    base = fit(
        arm, every(), START.having(GUST, np.array([9.0])), free_parameters(arm, [GUST]), 0, 99
    )
    base = replace(base, point=base.point.having(GUST, np.array([9.0])))
    rng = np.random.default_rng(1)
    free = {each.effects[GUST][0] for each in drawn(arm, base, every(), rng, 5)}
    known = replace(arm.candidates[GUST], ranges={"size": Range("1", 0, 10, 1, limit="all of it")})
    several = replace(arm, candidates={**arm.candidates, GUST: known})
    assert len(free) == 5
    assert {each.effects[GUST][0] for each in drawn(several, base, every(), rng, 5)} == {9.0}


@dataclass(frozen=True)
class BentCase(LinearCase):
    """Its residual bends along the first number."""

    bend: float = 0.0

    def residual(self, points, pieces, timestep=None):
        bent = [self.bend * self.X[pieces][..., 0] * p.declared[0] ** 2 for p in points]
        return super().residual(points, pieces, timestep) - self.weigh(np.array(bent))


@pytest.mark.parametrize("bend", [0.0, 30.0])
def test_twins_that_logs_cannot_tell_apart_fit_them_as_well(bend):
    """The covariance is too wide for a number that hardly shows at first, and bends the residual later."""
    flat = case(0.0)
    noise = flat.y - flat.X @ [1.0, -2.0]
    arm = BentCase(flat.X * [1e-3, 1.0], flat.g, flat.other, noise, bend=bend)
    base = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    several = drawn(arm, base, every(), np.random.default_rng(3), 40)
    left = arm.residual([base.point, *several], list(base.used))
    squares = (left**2).sum(axis=(1, 2)) / base.variance_inflation
    assert (squares[1:] - squares[0] < 9.3).all()  # chi squared, two degrees of freedom, 99 %
    apart = np.std([each.declared for each in several], axis=0) / base.error
    assert apart[1] == pytest.approx(1.0, abs=0.3) or bend
    assert 0.001 < apart[0] < 0.5 if bend else 0.7 < apart[0] < 1.3


def test_beside_a_strength_at_its_limit_others_are_tested_as_if_it_were_held():
    """It changes nothing of the residual, which once made the information singular."""
    arm = case(0.7)
    base = fit(
        arm, every(), START.having(GUST, np.array([10.0])), free_parameters(arm, [GUST]), 1, 99
    )
    slopes = base.jacobian.copy()
    slopes[-1] = 0.0
    change = RNG.standard_normal(base.residual.size)
    still = Information.of(arm, replace(base, jacobian=slopes))
    assert still.beyond(change) == pytest.approx(still.without(len(slopes) - 1).beyond(change))


@pytest.mark.parametrize(
    ("left", "complete", "least"),
    [(1.0, 0.0, BESIDE_OTHERS), (10.0, 7.0, WORTH_A_FIT), (10.0, 8.0, BESIDE_OTHERS)],
)
def test_beside_effects_that_left_little_a_candidate_must_remove_more(left, complete, least):
    """Errors leave little to explain below three times a noise of 1 mm, and where noise at the start of runs
    makes them.
    """
    arm = case(0.7)
    machine = SimpleNamespace(
        outputs=[SimpleNamespace(measure=replace(MARKERS, scale=1.0))],
        pose_noise=lambda _: 1.0 / float(expected_distance(1.0)),
    )
    noisy = SimpleNamespace(machine=machine)
    base = fit(arm, every(), START, free_parameters(arm, ()), 1, 99)
    found = replace(base, point=base.point.having(GUST, np.array([0.7])))
    notes = SimpleNamespace(numbers=lambda *_: np.array([complete]))
    trials = Trials(None, None, notes, print)
    errors = Errors(np.full((2, 5), left), np.full((2, 5), np.nan))
    assert trials._worth_a_fit(noisy, found, errors) == least
    assert trials._worth_a_fit(noisy, base, errors) == WORTH_A_FIT


def test_another_effect_must_explain_more_than_those_before_it_neglect():
    """A hundredth of a gust of 8, where noise of 0.5 is left."""
    arm = case(8.0)
    start = START.having(GUST, np.array([7.0]))
    found = fit(arm, every(), start, free_parameters(arm, [GUST]), 3, 99)
    share = neglected(arm, found)
    assert share == pytest.approx((0.01 * 8 / 0.5) ** 2, rel=0.1)
    trial = CandidateTrial(scored(NOTHING, np.ones(3)), found, None, 0.0, neglected=share)
    assert replace(trial, fits=0.4 * share).within_neglect  # removes 0.8 of it
    assert not replace(trial, fits=0.6 * share).within_neglect
    assert not replace(trial, neglected=0.0).within_neglect  # without any before it
