"""Test that what happened once before the held-out logs is judged by training segments left out."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_case import GUST, START, LinearCase, case, every

from serpent_twin.identification.acceptance import CHANCE, weakness
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.gained import gained, happens_once
from serpent_twin.identification.held_out import Errors, gain
from serpent_twin.identification.left_out import better_left_out, chance_of_selection
from serpent_twin.identification.score_test import scores

ONCE = "discovered@slack of tendon3: above runtime of machine"
OFTEN = "discovered@slack of tendon3: above time of session"


@dataclass(frozen=True)
class Law(LinearCase):
    """The linear machine, whose candidate is a law."""

    name: str = ONCE

    def residual(self, points, pieces, timestep=None):
        named = [
            replace(p, effects={GUST: p.effects[self.name]} if self.name in p.effects else {})
            for p in points
        ]
        return super().residual(named, pieces, timestep)


def law(name: str, strength: float) -> Law:
    made = case(strength)
    known = {name: replace(made.candidates[GUST], name=name)}
    return Law(made.X, made.g, made.other, made.y, made.declared, known, name=name)


def fits(arm: Law):
    base = fit(arm, every(), START, free_parameters(arm, ()), 3, 99)
    (score,) = scores(arm, every(), base, [arm.candidates[arm.name]])
    begun = START.having(arm.name, np.array([0.1]))
    return score, base, fit(arm, every(), begun, free_parameters(arm, [arm.name]), 3, 99)


def better_by(share: float) -> tuple[Errors, Errors]:
    """Held-out errors of two twins; the gain is hardly the same in two blocks."""
    rng, none = np.random.default_rng(2), np.full((4, 5), np.nan)
    before = np.ones((4, 5))
    return Errors(before, none), Errors(before - share + 0.01 * rng.standard_normal((4, 5)), none)


def test_what_happened_before_the_held_out_logs_is_accepted_by_segments_left_out():
    assert happens_once(ONCE) and happens_once(ONCE.replace("above", "within"))
    assert not happens_once(OFTEN) and not happens_once("backlash")
    arm = law(ONCE, 0.7)
    score, base, more = fits(arm)
    selected = chance_of_selection(arm, base, more, every(), 20, once=True)
    found = gained(arm, score, (base, more), better_by(0.01), selected)
    assert not weakness(found) and found.left_out and "left out" in str(found)
    together = gain(*better_by(0.01), selected).probability_of_chance
    assert found.probability_of_chance == min(selected, together) and selected < CHANCE
    assert found.relative == pytest.approx(1 - 0.5 / np.hypot(0.5, 0.7), abs=0.05)
    assert found.whole == pytest.approx(0.01, abs=0.01)  # what candidates are compared by
    assert found.marker == pytest.approx(0.01, abs=0.01)


@pytest.mark.parametrize(
    ("name", "strength", "on_held_out"), [(OFTEN, 0.7, 0.01), (ONCE, 0.0, 0.01), (ONCE, 0.7, -0.01)]
)
def test_no_other_law_is(name, strength, on_held_out):
    """Neither one that held-out logs can show, nor noise, nor what makes held-out logs worse."""
    arm = law(name, strength)
    score, base, more = fits(arm)
    selected = chance_of_selection(arm, base, more, every(), 20, once=happens_once(name))
    assert weakness(gained(arm, score, (base, more), better_by(on_held_out), selected))


def test_fits_to_other_segments_are_compared_on_those_of_both():
    arm = law(ONCE, 0.7)
    _, base, more = fits(arm)
    some = [7, 2, 5]
    fewer = replace(
        base, used=tuple(some), residual=base.residual[some], jacobian=base.jacobian[:, some]
    )
    assert better_left_out(arm, fewer, more).shape == (3, 5)
    same = better_left_out(arm, fewer, fewer)
    assert same == pytest.approx(np.zeros((3, 5)))


def test_what_acts_in_few_blocks_is_judged_by_these():
    """Many blocks that say nothing make the gain of few look like chance."""
    arm = law(ONCE, 0.7)
    acts = np.arange(len(every()))[:, None] < 2
    arm = replace(arm, g=arm.g * acts, y=arm.y - 0.7 * arm.g * ~acts)
    _, base, more = fits(arm)
    by_all, by_few = (
        chance_of_selection(arm, base, more, every(), 20, once=once) for once in (False, True)
    )
    assert by_few < CHANCE < by_all
