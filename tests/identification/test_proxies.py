"""Test that effects which stood for others go, and with them what gained only beside them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear_case import GUST, NOTHING, START, case, every

from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.held_out import Errors, gain
from serpent_twin.identification.proxies import needless, without_proxies
from serpent_twin.identification.score_test import scores


def errors(arm, point) -> Errors:
    """Root mean squares of a residual's blocks."""
    squares = arm.residual([point], every())[0].reshape(len(every()), 5, -1) ** 2
    return Errors(np.sqrt(squares.mean(axis=-1)), np.full(squares.shape[:2], np.nan))


def left_of(strength, measured=errors):
    """Which of two effects stay of an arm that has one of them, in such a strength, or none."""
    arm = case(strength)
    base = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    names = [NOTHING, GUST]
    score = {s.name: s for s in scores(arm, every(), base, [arm.candidates[n] for n in names])}
    begun = START.having(NOTHING, np.array([0.1])).having(GUST, np.array([0.1]))
    both = fit(arm, every(), begun, free_parameters(arm, names), 3, 99)
    trials = SimpleNamespace(
        training=every(),
        stable=lambda stage, make: make(),
        on_progress=print,
        errors=measured,
    )
    rounds = [
        SimpleNamespace(accepted=(n,), trials={n: SimpleNamespace(score=score[n])}, together=False)
        for n in names
    ]
    return list(without_proxies(trials, arm, both, rounds).point.effects)


@pytest.mark.parametrize(("strength", "left"), [(0.7, [GUST]), (0.0, [])])
def test_what_gains_nothing_beside_the_others_goes(strength, left):
    """The last one too, once another has gone."""
    assert left_of(strength) == left


def test_an_effect_without_which_the_simulation_is_unstable_stays():
    def unstable_alone(arm, point):
        found = errors(arm, point)
        if len(point.effects) == 2:
            return found
        return replace(found, marker_by_block=np.full_like(found.marker_by_block, np.nan))

    assert left_of(0.0, unstable_alone) == [NOTHING, GUST]


@pytest.mark.parametrize(
    ("far_off", "chance", "goes"),
    [
        ((8.0, 0.4, 6.0, 0.5, 0.3), (0.01, 0.2), False),
        ((9.0, 0.3, 0.3, 0.3, 0.3), (0.2, 1.0), True),
    ],
    ids=["off in several parts", "off in one part alone"],
)
def test_a_large_gain_needs_few_blocks_to_show_it(far_off, chance, goes):
    """A twin without the effect is far off, now more and now less."""
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    (score,) = scores(arm, every(), base, [arm.candidates[GUST]])
    none = np.full((1, 5), np.nan)
    without, beside = (Errors(np.array([x]), none) for x in (far_off, [0.35] * 5))
    found = gain(without, beside)
    assert found.relative > 0.3 and chance[0] < found.probability_of_chance < chance[1]
    more = replace(base, point=base.point.having(GUST, np.array([0.7])))
    trials = SimpleNamespace(errors=lambda case, point: beside if point.effects else without)
    assert needless(trials, arm, score, base, more) is goes
