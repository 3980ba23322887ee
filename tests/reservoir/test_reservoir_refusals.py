"""Test which states and inputs the reservoir measures refuse, and their messages."""

import numpy as np
import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.reservoir import (
    basis,
    capacities,
    channel_consistency,
    check_inputs,
    contraction_rate,
    expand,
    memory,
    state_rank,
    taps,
)


def drawn(rows, inputs=1, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (rows, inputs))


def test_constant_states_are_refused():
    u = drawn(2000)
    with pytest.raises(SerpentError, match="All 3 channels are constant over 1990 rows"):
        capacities(np.ones((2000, 3)), u, 2, (10, 5))
    with pytest.raises(SerpentError, match="All 2 coordinates are constant"):
        expand(np.ones((2000, 2)), u, 2, (10, 5))


def test_states_that_are_not_finite_are_refused_by_place():
    u = drawn(2000)
    x = taps(u, 3)
    x[7, 2] = np.nan
    for measure in (lambda: capacities(x, u, 1, (5,)), lambda: basis(x), lambda: memory(x, u, 5)):
        with pytest.raises(SerpentError, match="nan at row 7, column 2"):
            measure()


def test_too_few_rows_are_refused_with_what_is_needed():
    u = drawn(1010)
    with pytest.raises(SerpentError, match=r"1000 rows and 60 .* below 0.22 .* use 2,\d\d\d rows"):
        capacities(np.random.default_rng(1).standard_normal((1010, 60)), u, 2, (10, 5))
    with pytest.raises(SerpentError, match="first 2000 are left out"):
        capacities(u, u, 1, (5,), washout=2000)
    with pytest.raises(SerpentError, match="1009 rows of states and 1010 rows of inputs"):
        capacities(u[1:], u, 1, (5,))
    with pytest.raises(
        SerpentError, match="2 series of 505 rows of states and 1010 rows of inputs"
    ):
        capacities(u.reshape(2, 505, 1), u, 1, (5,))


def test_inputs_that_depend_are_refused_by_name_and_delay():
    u = drawn(5000, inputs=3)
    held = np.repeat(u[:1000], 5, axis=0)
    with pytest.raises(SerpentError, match="is not independent of itself 1 row earlier"):
        capacities(u, held, 2, (10, 5))
    echo = np.roll(u[:, 0], 4)
    with pytest.raises(SerpentError, match="Input 1 is not independent of input 0 4 rows earlier"):
        memory(u, np.column_stack([u[:, 0], echo]), 10)
    sized = np.sign(u[:, 1]) * np.abs(u[:, 0])
    with pytest.raises(SerpentError, match="same row: its degree 2 and the other's degree 2"):
        capacities(u, np.column_stack([u[:, 0], sized]), 2, (3, 3))
    together = np.abs(u[:, 2]) * np.sign(u[:, 0] * u[:, 1])
    with pytest.raises(SerpentError, match=r"P1\(u0.*\) P1\(u1.*\) P1\(u2.*\) has mean"):
        capacities(u, np.column_stack([u[:, :2], together]), 3, (2, 2, 2))


def test_inputs_that_are_not_uniform_are_refused():
    u = drawn(5000, inputs=2)
    with pytest.raises(SerpentError, match="Input 1 is not uniform on"):
        check_inputs(np.column_stack([u[:, 0], u[:, 1] / 2]), 2, (5, 5))
    with pytest.raises(SerpentError, match=r"Input 1 is 1\.5 at row 9, outside"):
        check_inputs(np.where(np.arange(10_000).reshape(-1, 2) == 19, 1.5, u), 2, (5, 5))
    with pytest.raises(SerpentError, match="Input 0 is constant"):
        memory(u, np.ones((5000, 1)), 5)


def test_good_inputs_are_not_refused():
    for seed in range(20):
        check_inputs(drawn(3000, 2, seed), 4, (40, 20, 10, 5))


def test_what_cannot_be_searched_is_said():
    u = drawn(3000, inputs=10)
    with pytest.raises(SerpentError, match="at most 1,000,000 are searched: lower that delay"):
        capacities(u, u, 3, (20, 20, 20))
    with pytest.raises(SerpentError, match="one delay, 0 or more rows, for each degree"):
        capacities(u, u, 3, (20, 20))
    with pytest.raises(SerpentError, match="give at least two of rows × channels"):
        channel_consistency(u)
    with pytest.raises(SerpentError, match="20 streams for 10 channels are too few"):
        state_rank(u[:20], 0.01)
    with pytest.raises(SerpentError, match="above 10 for 0 rows"):
        contraction_rate(np.ones(100), 0.02, 10)
