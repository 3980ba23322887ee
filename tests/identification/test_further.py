"""Test which fits go on before they are compared."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_case import GUST, START, case, every

from serpent_twin.identification import trials as tried
from serpent_twin.identification.acceptance import CandidateTrial
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.held_out import Errors
from serpent_twin.machines.case import Stopwatch


@dataclass(frozen=True)
class Unjudged(tried.Trials):
    """Trials on logs of which a base leaves little or much."""

    leaves_little: bool = False

    def little(self, case, found, left):
        return self.leaves_little

    def judged(self, case, score, base, fitted, before, among):
        return CandidateTrial(score, fitted, None, 1.0)


@pytest.mark.parametrize(("law", "little", "goes_on"), [(1, 1, False), (1, 0, True), (0, 1, True)])
def test_a_fit_that_is_half_way_goes_on(tmp_path, monkeypatch, law, little, goes_on):
    """A fit of a composed law goes on only where much is left: elsewhere first order is right enough."""
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    monkeypatch.setattr(tried, "full_fit", lambda *a: replace(full_fit(*a), converged=False))
    notes = Checkpoints(tmp_path, Stopwatch())
    made = Unjudged(every(), every(), notes, lambda _: None, bool(little)).each(
        [GUST], arm, base, base, Errors(*np.ones((2, 4, 5))), "1_base", beside=0.8 * law
    )
    assert made[GUST].fit.converged == goes_on
    assert made[GUST].fit.point.effects[GUST][0] == pytest.approx(0.7, abs=0.1)


@dataclass(frozen=True)
class Blind(Unjudged):
    """Trials whose score tests show nothing."""

    def scores(self, stage, case, base, names):
        found = super().scores(stage, case, base, names)
        return {name: replace(each, share=0.0) for name, each in found.items()}


def test_what_another_outdid_is_fitted_whatever_the_score_test_says(tmp_path):
    """The fit starts from a tenth of the strength that the effect had alone."""
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    trials = Blind(every(), every(), Checkpoints(tmp_path, Stopwatch()), lambda _: None)
    before = Errors(*np.ones((2, 4, 5)))
    assert trials.each([GUST], arm, base, base, before, "2_base")[GUST].fit is None
    alone = {GUST: np.array([2.0])}
    made = trials.each([GUST], arm, base, base, before, "2_base", anyway=alone)[GUST]
    assert made.score.start == pytest.approx([0.2])
    assert made.fit.point.effects[GUST][0] == pytest.approx(0.7, abs=0.1)
    assert (tmp_path / f"fit_2_base_{GUST}_beside.npz").exists()
    assert not trials.each([], arm, base, base, before, "3_base", anyway=alone)


def test_costs_of_fits_that_weigh_the_same_data_otherwise_are_compared():
    arm = case(0.7)
    made = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    squares = float((made.residual.astype(float) ** 2).sum())
    other = made.cost_with(2 * made.variance_inflation)
    assert made.cost - other == pytest.approx(squares / made.variance_inflation / 2)
