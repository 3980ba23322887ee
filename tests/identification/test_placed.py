"""Test where a candidate is placed that may be at all of several places, or at one within."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from linear_case import GUST, NUMBERS, SEGMENTS, START, LinearCase, case, every

from serpent_twin.effects import Range
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.full_fit import best_of, full_fit, hypotheses
from serpent_twin.identification.score_test import placed, scores
from serpent_twin.machines.candidate import Candidate


@dataclass(frozen=True)
class PlacedCase(LinearCase):
    """One candidate that may be at one of four places, at two of them, or at all."""

    asked: list = field(default_factory=list)

    def residual(self, points, pieces, timestep=None):
        self.asked.append(len(points))
        return np.array([self._one(p)[pieces] for p in points])

    def _one(self, point):
        size, place = point.effects.get(GUST, [0.0, -1.0])
        return self.y - self.X @ point.declared - size * _at(self.g, place)


_WITHIN = {-1.0: (10.0, 11.0), 10.0: (0.0, 1.0), 11.0: (2.0, 3.0)}


def _at(four, place):
    """What the candidate does at a place, of what it does at four of them, (S, N, 4)."""
    which = {-1.0: slice(4), 10.0: slice(2), 11.0: slice(2, 4)}.get(place, [int(place)])
    return four[..., which].sum(axis=-1)


def _anywhere(size):
    """The candidate at all places, of a typical size."""
    known = {
        "size": Range("m", 0.0, 10.0, size),
        "place": Range("1", -1, 11, -1, fitted=False, within=lambda p: _WITHIN.get(p, ())),
    }
    return Candidate(GUST, known, (np.array([size, -1.0]),))


@pytest.mark.parametrize(
    ("place", "size", "last", "found_at"),
    [(2, 0.7, 1, 2), (10, 0.5, 1, 10), (-1, 0.3, 1, -1), (1, 0.0, 1, -1), (2, 0.7, 0.05, 11)],
)
def test_places_are_tried_within_the_best_one_so_far(place, size, last, found_at):
    """Where the fourth place shows a twentieth, the third and both look alike: the coarser one stands."""
    rng = np.random.default_rng(4)
    g, bare = rng.standard_normal((SEGMENTS, NUMBERS, 4)) * [1, 1, 1, last], case(0.0)
    candidate = _anywhere(1.0)
    arm = PlacedCase(
        bare.X, g, bare.other, bare.y + size * _at(g, place), candidates={GUST: candidate}
    )
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    arm.asked.clear()
    everywhere = {each.name: each for each in scores(arm, every(), base, [candidate])}
    (found,) = [*placed(arm, every(), base, everywhere), *everywhere.values()][:1]
    assert found.start[1] == found_at
    assert arm.asked == ([2] if not size else [2, 3] if place == -1 else [2, 3, 3])
    if size:
        assert found.start[0] == pytest.approx(size, rel=0.05) and found.share > 0.2


@dataclass(frozen=True)
class BentCase(PlacedCase):
    """A case whose candidate, at all places, does what bends with its size."""

    bend: float = 0.0

    def _one(self, point):
        size, place = point.effects.get(GUST, [0.0, -1.0])
        return super()._one(point) - (place == -1) * self.bend * size**2 * self.other


@pytest.mark.parametrize(("bend", "at"), [(0.0, -1), (1.0, 10)])
def test_a_place_within_is_fitted_that_first_order_cannot_tell_from_all(bend, at):
    """It shows next to nothing at two of four places, whether it is there or not."""
    rng = np.random.default_rng(4)
    g, bare = rng.standard_normal((SEGMENTS, NUMBERS, 4)) * [1, 1, 0.05, 0.05], case(0.0)
    candidate = _anywhere(0.05)
    y = bare.y + 0.7 * _at(g, at)
    arm = BentCase(bare.X, g, bare.other, y, candidates={GUST: candidate}, bend=bend)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    everywhere = {each.name: each for each in scores(arm, every(), base, [candidate])}
    (found,) = placed(arm, every(), base, everywhere)
    assert found.start[1] == -1 and found.within[1] == 10
    fitted = best_of([full_fit(arm, every(), base, one, print) for one in hypotheses(found)])
    assert fitted.point.effects[GUST] == pytest.approx([0.7, at], rel=0.02)
