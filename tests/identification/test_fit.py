"""The fit against the normal equations, on a machine whose residual is linear."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from linear_case import GUST, NUMBERS, SEGMENTS, START, LinearCase, case, every, scored
from scipy.stats import t as student

from serpent_twin.identification.acceptance import CandidateTrial, why_not
from serpent_twin.identification.fitting.fitted import NORMAL_95
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import fit, telling
from serpent_twin.identification.fitting.objective import variance_inflation
from serpent_twin.identification.fitting.standard_errors import standard_errors, stated
from serpent_twin.identification.fitting.uncertainty import indistinguishable
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.held_out import Errors, blocks, chance, gain, together
from serpent_twin.identification.left_out import left_out
from serpent_twin.identification.score_test import scores, worth_fitting
from serpent_twin.machines.machine import Declared


@dataclass(frozen=True)
class Watched(LinearCase):
    """Notes in how many segments differences were asked for."""

    asked: list = field(default_factory=list)

    def jacobian(self, point, pieces):
        self.asked.append(len(pieces))
        return super().jacobian(point, pieces)


def test_a_linear_fit_solves_the_normal_equations():
    arm = case(0.0)
    found = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    flat = arm.X.reshape(-1, 2)
    exact = np.linalg.solve(
        flat.T @ flat / found.variance_inflation + np.eye(2) * 1e-6,
        flat.T @ arm.y.ravel() / found.variance_inflation,
    )
    assert found.converged
    np.testing.assert_allclose(found.point.declared, exact, rtol=1e-5)


def test_a_prior_pulls_towards_the_start():
    arm = case(0.0)
    tight = LinearCase(
        arm.X, arm.g, arm.other, arm.y, (Declared("one", "1", 1e-4, 0.1), arm.declared[1])
    )
    found = fit(tight, every(), START, free_parameters(tight, ()), 3, 99)
    assert abs(found.point.declared[0]) < 0.01
    assert found.point.declared[1] == pytest.approx(-2.0, abs=0.05)


def test_a_derivative_is_carried_over_to_other_weights_and_more_segments():
    arm = case(0.7)
    free = free_parameters(arm, ())
    before = fit(arm, every(), START, free, 2, 5)
    other = replace(arm, noise=np.array([0.5, 2.0, 1.0]))
    afresh = fit(other, every(), START, free, 3, 99)
    for more in (0, 2):
        watched = Watched(**vars(other), asked=[])
        carried = fit(watched, every(), before.point, free, more, 99, carried=before)
        assert set(before.used) < set(carried.used) == set(afresh.used)
        assert carried.point.declared == pytest.approx(afresh.point.declared, abs=1e-4)
        assert carried.jacobian == pytest.approx(afresh.jacobian, abs=1e-4)
        assert carried.error == pytest.approx(afresh.error, rel=1e-3)
        assert (SEGMENTS in watched.asked) == bool(more)  # else only on segments that it had not


def test_intervals_hold_as_often_as_they_say():
    inside = 0
    for seed in range(60):
        arm = case(0.7, seed)
        base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
        found = full_fit(arm, every(), base, scored(arm, base), print)
        _, low, high = found.interval(GUST, 0)
        inside += low <= 0.7 <= high
    assert 52 <= inside <= 60  # 57 expected, binomial 3 standard deviations below


def test_intervals_hold_where_few_segments_disagree():
    """Each segment is made with slightly different parameters. The first segment has the most information."""
    inside, arms = 0, 150
    for seed in range(arms):
        rng = np.random.default_rng([5, seed])
        arm = case(0.0, seed)
        X = arm.X * np.array([2.0, 1.0, 1.0, 1.0, 1.0] + [0.0] * (SEGMENTS - 5))[:, None, None]
        own = np.array([1.0, -2.0]) + 0.3 * rng.standard_normal((SEGMENTS, 2))
        noise = 0.5 * rng.standard_normal(arm.y.shape)
        arm = replace(arm, X=X, y=np.einsum("snk,sk->sn", X, own) + noise)
        found = fit(arm, every()[:5], START, free_parameters(arm, ()), 2, 99)
        off = np.abs(found.point.declared - [1.0, -2.0])
        inside += int((off < NORMAL_95 * found.error).sum())
    assert 0.91 * 2 * arms <= inside <= 0.985 * 2 * arms


@pytest.mark.parametrize("spread", [0.0, 0.3], ids=["exact", "lacking"])
def test_intervals_hold_where_all_segments_share_what_is_wrong(spread):
    """A third of the variance is shared; intervals of an exact twin are hardly wider for it."""
    inside, wide, arms = 0, [], 150
    for seed in range(arms):
        rng = np.random.default_rng([6, seed])
        arm = case(0.0, seed)
        shared = spread / np.sqrt(3) * rng.standard_normal(2)
        own = np.array([1.0, -2.0]) + shared + spread * rng.standard_normal((SEGMENTS, 2))
        y = np.einsum("snk,sk->sn", arm.X, own) + rng.standard_normal(arm.y.shape)
        arm = replace(arm, y=y)
        found = stated(arm, fit(arm, every(), START, free_parameters(arm, ()), 2, 99))
        off = np.abs(found.point.declared - [1.0, -2.0])
        inside += int((off < NORMAL_95 * found.error).sum())
        wide.append(found.error * np.sqrt(SEGMENTS * NUMBERS))
    assert 0.91 * 2 * arms <= inside <= 0.985 * 2 * arms
    if not spread:
        assert np.median(wide) < 1.3


def test_what_one_segment_alone_tells_does_not_widen_other_intervals():
    """Its derivative may be off there, as where a strand turns slack, and leave a pull."""
    rng = np.random.default_rng(8)
    jacobian, residual = rng.standard_normal((2, 3, NUMBERS)), rng.standard_normal((3, NUMBERS))
    jacobian[1, 1:] *= 1e-3
    jacobian[0, 0] += 0.3 * jacobian[1, 0]
    residual[0] += jacobian[1, 0]
    error, _ = standard_errors(jacobian, residual, 1.0, np.full(2, 1e-6))
    assert error[0] < 5 / np.sqrt(3 * NUMBERS)


def test_the_score_finds_what_is_there_and_how_strong():
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    found = scores(arm, every(), base, list(arm.candidates.values()))
    there, absent = found
    assert there.share > 0.3 > 0.01 > absent.share
    assert there.start[0] == pytest.approx(0.7, abs=0.05)
    assert worth_fitting(found, arm.candidates) == [GUST]


def test_what_hangs_together_weighs_as_less():
    rng = np.random.default_rng(3)
    white = rng.standard_normal((20, 400, 3))
    assert variance_inflation(white.reshape(20, -1), 3) == pytest.approx(1.0, abs=0.1)
    alike = np.repeat(white[..., :1], 3, axis=2)
    assert variance_inflation(alike.reshape(20, -1), 3) == pytest.approx(3.0, rel=0.05)
    rho, slow = 0.6, white.copy()
    for t in range(1, 400):
        slow[:, t] = rho * slow[:, t - 1] + np.sqrt(1 - rho**2) * white[:, t]
    exact = (1 + rho) / (1 - rho)  # of an autoregression of first order
    assert variance_inflation(slow.reshape(20, -1), 3) == pytest.approx(exact, rel=0.15)


def test_what_cannot_be_told_apart_is_named():
    arm = case(0.0)
    X = np.repeat(arm.X[..., :1], 2, axis=-1)
    twins = LinearCase(
        X, arm.g, arm.other, arm.y, tuple(Declared(n, "1", 1.0, 0.1) for n in ("a", "b"))
    )
    found = fit(twins, every(), START, free_parameters(twins, ()), 2, 99)
    assert any("a and b cannot be told apart" in told for told in indistinguishable(twins, found))


def test_a_gain_on_every_segment_is_beyond_chance_and_noise_is_not():
    rng = np.random.default_rng(1)
    before = Errors(1 + 0.1 * rng.standard_normal((7, 5)), np.full((7, 5), np.nan))
    better = gain(before, Errors(before.marker_by_block - 0.2, before.load_by_block))
    assert better.probability_of_chance < 1e-3
    assert better.marker == pytest.approx(0.2)
    noise = 0.05 * rng.standard_normal((7, 5))
    same = Errors(before.marker_by_block + noise - noise.mean(), before.load_by_block)
    assert gain(before, same).probability_of_chance > 0.05


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.6])
def test_false_alarms_at_one_per_cent_stay_at_one_per_cent(correlation):
    """Gains are zero in the mean and correlated from block to block, in few and in many segments."""
    rng, draws = np.random.default_rng(3), 3000
    for segments in (2, 4, 7, 13):
        noise = rng.standard_normal((draws, segments, 5))
        for k in range(1, 5):
            noise[..., k] *= np.sqrt(1 - correlation**2)
            noise[..., k] += correlation * noise[..., k - 1]
        alarms = sum(chance(each) < 0.01 for each in noise)
        assert alarms < (0.025 if segments == 2 else 0.015) * draws


def test_blocks_show_a_gain_that_few_segments_do_not():
    """Two sessions of three minutes: four segments that judge, a gain of a fifth that varies as much."""
    rng = np.random.default_rng(4)
    gains = 0.2 + 0.15 * rng.standard_normal((200, 4, 5))
    means = gains.mean(axis=2)
    by_segments = student.sf(2 * means.mean(axis=1) / means.std(axis=1, ddof=1), 3)
    assert np.mean([chance(each) < 0.0025 for each in gains]) > np.mean(by_segments < 0.0025)


def test_what_training_sessions_select_a_held_out_one_confirms():
    """Fisher's method; but a held-out session that shows nothing by itself is never outvoted."""
    assert together(0.004, 0.02) == pytest.approx(0.00008 * (1 - np.log(0.00008)), rel=1e-6)
    assert together(1e-12, 0.2) == 0.2
    assert together(1.0, 1e-4) < 0.01 < together(1.0, 0.04)


def test_a_session_left_out_is_predicted_as_by_a_fit_to_the_others():
    """One Gauss-Newton step from the fit to all, against the exact fit of a linear problem."""
    arm = case(0.0)
    found = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    of = ["one" if n < 2 else "two" for n in range(len(found.used))]
    told = left_out(arm, found, of, arm.noise)
    some = [n for n, name in enumerate(of) if name == "two"]
    known = Information.of(arm, found)
    slopes = found.jacobian[:, some].astype(float).reshape(len(found.free), -1)
    matrix = known.weight * slopes @ slopes.T + np.diag(known.prior)
    zero = found.residual - np.tensordot(found.point.declared, found.jacobian, 1)
    exact = -np.linalg.solve(matrix, known.weight * slopes @ zero[some].ravel())
    residual = zero + np.tensordot(exact, found.jacobian, 1)
    assert told[:2] == pytest.approx(blocks(residual[:2, :, None] ** 2), rel=1e-3)


@pytest.mark.parametrize(
    ("step", "said"), [(0.049, "4.9 % worse"), (-0.049, "4.9 % better"), (1e-6, "0.0 % better")]
)
def test_a_loss_is_told_as_a_loss(step, said):
    """Also where a candidate of a round is not accepted for other reasons."""
    arm, before = case(0.7), Errors(np.ones((7, 5)), np.full((7, 5), np.nan))
    lost = gain(before, Errors(before.marker_by_block + step, before.load_by_block))
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    found = scored(arm, base)
    fitted = full_fit(arm, every(), base, found, print)
    ends = replace(fitted, point=fitted.point.having(GUST, np.array([10.0])))
    for made in (fitted, ends):
        why = why_not(GUST, CandidateTrial(found, made, lost, 1.0), arm.candidates[GUST])
        assert why.startswith(f"{said} on held-out logs") or (step < -0.04 and not why)
        assert "-" not in why.replace("held-out", "") and "−" not in why


def test_segments_are_chosen_that_leave_as_much_as_all_do():
    """A limit that is reached in two of sixty segments is in those that are fitted."""
    chosen = list(range(3, 60, 6))
    assert telling(np.ones(60), chosen) == tuple(chosen)
    seldom = np.ones(60)
    seldom[[20, 41]] = 400.0, 300.0
    found = telling(seldom, chosen)
    assert {20, 41} <= {*found} or seldom[list(found)].mean() >= seldom.mean()
    assert 20 in found and len(found) == len(chosen) and 21 not in found  # the next one gave way
