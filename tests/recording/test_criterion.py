"""Test the distance between rivals on linear models, where it has a closed form."""

import numpy as np
import pytest
from scipy.special import ndtr

from serpent_twin.recording.plan_criterion import Question, chosen, gram, schur

N = 40


def model(seed=0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((2, N)), rng.standard_normal(N), rng.standard_normal(N)


def evidence(J, one, other, weight, prior):
    out = gram(np.array([*J, one, other]), weight)
    out[[0, 1], [0, 1]] += prior
    return out


def fitted_distance(J, one, other, weight, prior):
    """Distance by least squares on the rows themselves, with a row of data for each prior."""
    A = np.vstack([np.sqrt(weight) * np.array([*J, other]).T, np.diag([*np.sqrt(prior), 0.0])[:2]])
    b = np.r_[np.sqrt(weight) * one, 0.0, 0.0]
    rest = b - A @ np.linalg.lstsq(A, b, rcond=None)[0]
    return np.linalg.norm(rest)


def test_distance_is_that_of_the_best_fit_of_the_rival():
    J, one, other = model()
    prior = np.array([4.0, 0.1])
    asked = Question("a", "b", 2, ((0, 1, 3),))
    found = asked.distance(evidence(J, one, other, 0.3, prior))
    assert found == pytest.approx(fitted_distance(J, one, other, 0.3, prior), rel=1e-9)


def test_standard_error_is_that_of_the_normal_equations():
    J, one, _ = model(1)
    asked = Question("a", "", 2, ((0, 1),))
    full = gram(np.array([*J, one]), 0.7)
    assert asked.relative_error(full) == pytest.approx(np.sqrt(np.linalg.inv(full)[2, 2]))


def test_probability_is_how_often_the_better_fit_is_the_right_one():
    rng = np.random.default_rng(3)
    one, other = 0.2 * rng.standard_normal((2, N))
    difference = one - other
    asked = Question("a", "b", 0, ((),))
    noise = rng.standard_normal((20_000, N))
    right = ((one + noise - one) ** 2).sum(1) < ((one + noise - other) ** 2).sum(1)
    expected = asked.probability(gram(difference[None], 1.0))
    assert right.mean() == pytest.approx(expected, abs=0.012)
    assert expected == pytest.approx(ndtr(np.linalg.norm(difference) / 2))


def test_logs_add_up():
    J, one, other = model(4)
    rows = np.array([*J, one, other])
    halves = gram(rows[:, :15], 0.5) + gram(rows[:, 15:], 0.5)
    np.testing.assert_allclose(halves, gram(rows, 0.5))


def test_what_another_row_explains_is_nothing():
    J, one, _ = model(5)
    assert schur(gram(np.array([one, -3 * one]), 1.0), 0, [1]) == 0.0
    assert schur(gram(np.array([*J, one]), 1.0), 2, []) == pytest.approx(one @ one)


def test_pieces_are_chosen_for_the_questions_that_they_decide():
    questions = [Question("a", "", 0, ((),)), Question("b", "", 1, ((),))]
    for_a, for_b, little = np.diag([9.0, 0.0]), np.diag([0.0, 4.0]), np.diag([1.0, 1.0])
    assert chosen(np.diag([100.0, 1.0]), [for_a, for_b, little], questions, 2) == [1, 1]
    assert chosen(np.diag([1.0, 100.0]), [for_a, for_b, little], questions, 1) == [0]


def test_a_question_that_nothing_answers_takes_no_piece_from_the_others():
    """Though it is the worst off, and one piece changes it most in proportion."""
    questions = [Question("a", "", 0, ((),)), Question("hidden", "", 1, ((),))]
    for_a, for_hidden = np.diag([4.0, 1e-8]), np.diag([0.1, 1e-6])
    assert chosen(np.diag([1.0, 1e-8]), [for_hidden, for_a], questions, 3) == [1, 1, 1]


def test_a_distance_is_as_sure_as_held_out_logs_have_confirmed_it():
    """Twice the evidence is then √2 of what was seen, not of what a faultless twin would see."""
    asked = Question("a", "b", 0, ((),))
    known = np.array([[100.0]])
    seen = asked.confirmed(known, 0.1)
    assert seen.probability(known) == pytest.approx(0.9)
    assert seen.distance(2 * known) == pytest.approx(np.sqrt(2) * seen.distance(known))
    assert asked.confirmed(known, 1e-9).share < 1.0  # no more is believed than one in a million
    assert asked.confirmed(np.array([[0.01]]), 0.1).share == 1.0
    assert asked.confirmed(known, 0.7).share == asked.confirmed(known, 0.5).share > 0


def test_an_effect_not_named_is_as_strong_as_the_logs_hide():
    """Else a strength that shows beyond doubt asks for no motion, and the weakest effect for every piece."""
    known = np.diag([1e4, 1.0])
    asked = [
        Question("strong", "", 0, ((),)).hidden(known),
        Question("weak", "", 1, ((),)).hidden(known),
    ]
    assert asked[0].distance(known) == pytest.approx(2.0)
    assert asked[1].distance(known) == pytest.approx(1.0)
    for_strong, for_weak = np.diag([1e4, 0.0]), np.diag([0.0, 0.1])
    assert chosen(known, [for_weak, for_strong], asked, 1) == [1]


def test_rivals_that_are_not_named_are_told_apart_no_better_than_each_shows():
    J, one, other = model(6)
    known = gram(np.array([*J, one, other]), 1e4)
    asked = Question("a", "b", len(J), ((*range(len(J)), len(J) + 1),), tuple(range(len(J))))
    assert 0 < asked.hidden(known).distance(known) < 2.0 < asked.distance(known)
