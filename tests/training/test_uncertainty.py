"""Test the coverage of intervals, and the false-positive rate of differences between readouts."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom, ttest_1samp

from serpent_twin.training.uncertainty import (
    SESSIONS,
    Steps,
    differences,
    holm,
    steps_of,
    uncertainty,
)

ROUNDS = 300


def autoregression(rows: int, rho: float, rng: np.random.Generator) -> np.ndarray:
    """Autoregressive process of first order, variance 1."""
    white = rng.standard_normal(rows + 500)
    return lfilter([1], [1, -rho], white)[500:] * np.sqrt(1 - rho**2)  # pyright: ignore


def errors(lengths, rho: float, rng: np.random.Generator, common: np.ndarray) -> np.ndarray:
    """Errors of nine markers, mean 5; a part is correlated in time, a part is `common` to several errors."""
    own = np.concatenate([autoregression(rows, rho, rng) for rows in lengths])
    drawn = 5 + (common + own)[:, None] + 0.5 * rng.standard_normal((sum(lengths), 9))
    drawn[:, 2] += 0.3
    drawn[:, 6] -= 0.3
    return drawn


def bounds(share: float) -> tuple[float, float]:
    """Counts that are exceeded once in a thousand times."""
    return binom.ppf(5e-4, ROUNDS, share), binom.ppf(1 - 5e-4, ROUNDS, share)


@pytest.mark.parametrize(
    ("lengths", "rho"), [((2000,), 0.0), ((2000,), 0.9), ((900,), 0.8), ((700,) * 3, 0.9), ((200,) * 9, 0.9)]
)  # fmt: skip
def test_intervals_hold_the_mean_and_tests_err_as_often_as_they_say(lengths, rho):
    rng = np.random.default_rng(0)
    held, wrong = 0, 0
    for _ in range(ROUNDS):
        common = np.concatenate([autoregression(rows, rho, rng) for rows in lengths])
        one, two = (errors(lengths, rho, rng, common) for _ in range(2))
        one[rng.random(one.shape) < 0.02] = np.nan
        two[np.isnan(one)] = np.nan
        first, second = steps_of(one, lengths), steps_of(two, lengths)
        low, high = uncertainty(first).interval or (np.nan, np.nan)
        held += low <= 5.0 <= high
        wrong += uncertainty(first.less(second)).probability < 0.05
    # A block cuts off a few per cent of the correlation: 94 % is what is expected of a long one.
    assert bounds(0.94)[0] <= held <= bounds(0.95)[1]
    assert bounds(0.05)[0] <= wrong <= bounds(0.06)[1]


def test_a_difference_that_is_there_is_found_though_both_errors_vary_more():
    rng = np.random.default_rng(1)
    common = autoregression(2000, 0.95, rng)
    one, two = (steps_of(errors((2000,), 0.0, rng, 5 * common), (2000,)) for _ in "ab")
    worse = Steps(two.total + 0.3 * two.count, two.count, two.lengths)
    found = differences({"one": one, "worse": worse}, "one")["worse"]
    low, high = uncertainty(one).interval or (0, 0)
    assert high - low > 1.0  # of each alone, they could not be told apart
    assert found.beyond_chance and found.by.mean == pytest.approx(0.3, abs=0.1)
    assert found.by.interval and found.by.interval[0] < 0.3 < found.by.interval[1]


def test_the_correlation_time_is_that_of_the_process():
    rng = np.random.default_rng(2)
    for rho in (0.0, 0.5, 0.9):
        walk = autoregression(50_000, rho, rng)
        found = steps_of(np.repeat(5 + walk[:, None], 9, axis=1), (50_000,)).correlation_steps
        assert found == pytest.approx((1 + rho) / (1 - rho), rel=0.15)


def test_of_many_sessions_whole_ones_are_drawn():
    rng = np.random.default_rng(3)
    lengths = (150,) * SESSIONS
    offset = np.repeat(rng.normal(0, 1, SESSIONS), 150)  # what differs from session to session
    error = 5 + offset[:, None] + 0.1 * rng.standard_normal((150 * SESSIONS, 9))
    found = uncertainty(steps_of(error, lengths))
    assert (found.block, found.freedom) == (0, SESSIONS - 1)
    exact = ttest_1samp(error.reshape(SESSIONS, -1).mean(axis=1), 0).confidence_interval(0.95)
    assert found.interval == pytest.approx((exact.low, exact.high), rel=0.05)


def test_of_too_few_rows_nothing_is_said():
    slow = 5 + np.cumsum(np.random.default_rng(4).standard_normal(200))
    found = uncertainty(steps_of(np.repeat(slow[:, None], 9, axis=1), (200,)))
    assert found.interval is None and found.probability == 1.0
    same = steps_of(np.full((200, 9), 5.0), (200,))
    assert uncertainty(same.less(same)).probability == 1.0
    assert uncertainty(same).interval == pytest.approx((5.0, 5.0))
    assert uncertainty(steps_of(np.full((1, 9), 5.0), (1,))).interval is None


def test_the_mean_is_over_all_markers_that_were_seen():
    error = np.random.default_rng(5).uniform(0, 9, (60, 9))
    error[::3, 4:] = np.nan
    error[7] = np.nan
    assert steps_of(error, (20, 40)).mean == pytest.approx(np.nanmean(error))


def test_several_comparisons_are_reckoned_with():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5]) == [0.5] and holm([]) == []
    assert holm([0.9, 0.001, 0.9]) == pytest.approx([1.0, 0.003, 1.0])
