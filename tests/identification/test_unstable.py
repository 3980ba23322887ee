"""Test that unstable simulations are tried with smaller steps, and named where none is stable."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_case import GUST, SEGMENTS, START, LinearCase, case, every
from made_diagnosis import diagnosis
from numpy.testing import assert_allclose

from serpent_twin.errors import SerpentError
from serpent_twin.identification.acceptance import CandidateTrial, Round, Selection
from serpent_twin.identification.build_diagnosis import _verdict
from serpent_twin.identification.cautions import unstable_fits
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.diagnosis import UNSTABLE, Tried
from serpent_twin.identification.fitting.free_parameters import free_parameters, jacobian, unstable
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.held_out import Errors, gave_up
from serpent_twin.identification.score_test import scores
from serpent_twin.identification.trials import Trials
from serpent_twin.machines.case import Stopwatch


@dataclass(frozen=True)
class Fragile(LinearCase):
    """A linear machine whose simulation gives up beyond a value of `one`, and beyond a strength of a gust."""

    one: float = np.inf
    gust: float = np.inf

    def residual(self, points, pieces, timestep=None):
        out = super().residual(points, pieces, timestep)
        for n, p in enumerate(points):
            if p.declared[0] > self.one or p.effects.get(GUST, [0.0])[0] > self.gust:
                out[n] = np.nan
        return out


def fragile(strength=0.7, **beyond):
    """A case with a gust of that strength."""
    return Fragile(
        **{name: getattr(case(strength), name) for name in ("X", "g", "other", "y")}, **beyond
    )


def base_of(arm):
    return fit(arm, every(), START, free_parameters(arm, ()), 2, 99)


def score(arm, base):
    (found,) = scores(arm, every(), base, [arm.candidates[GUST]])
    return found


@pytest.mark.parametrize("beyond", [0.02, 0.002])
def test_a_column_is_found_from_a_smaller_step(beyond):
    """The step of `one` is 0.1: a tenth of it, or a hundredth, is stable."""
    arm, free = fragile(one=beyond), free_parameters(fragile(), ())
    steady = jacobian(fragile(), START, free, every())[1]
    found = jacobian(arm, START, free, every())[1]
    assert_allclose(found, steady, rtol=1e-3, atol=1e-3)
    assert unstable(arm, START, free, every(), found) == []


def test_a_column_that_no_step_gives_is_named_and_held():
    arm, free = fragile(one=0.0), free_parameters(fragile(), ())
    found = fit(arm, every(), START, free, 3, 99)
    assert found.point.declared[0] == 0.0 and found.point.declared[1] == pytest.approx(-2, abs=0.1)
    assert unstable(arm, found.point, free, every(), found.jacobian) == ["one"]
    (told,) = unstable_fits(arm, Selection(arm, found, found, found, ()), every())
    assert told.startswith(
        "The twin's simulation became unstable at every step of one that was tried"
    )


def test_a_start_that_is_unstable_is_an_error():
    arm = fragile(one=-1.0)
    with pytest.raises(SerpentError, match="unstable where a fit was to begin"):
        base_of(arm)


@pytest.mark.parametrize("far", [1e30, np.nan])
def test_a_fit_takes_the_usual_steps_where_longer_ones_explode(far):
    """Errors of long steps in one segment would hide what a step of the fit changes."""

    @dataclass(frozen=True)
    class Exploding(LinearCase):
        def residual(self, points, pieces, timestep=None):
            out = super().residual(points, pieces)
            out[:, 0] += far if timestep else 0.0
            return out

    arm = Exploding(**case(0.0).__dict__)
    found = fit(arm, every(), START, free_parameters(arm, []), 2, SEGMENTS)
    assert_allclose(found.point.declared, [1.0, -2.0], atol=0.05)


def test_a_fit_takes_the_usual_steps_where_longer_ones_say_something_else_each_time():
    """Long steps vary as where joints stick and slip: that would hide what the last steps gain."""
    rng = np.random.default_rng(1)

    @dataclass(frozen=True)
    class Jittering(LinearCase):
        def residual(self, points, pieces, timestep=None):
            out = super().residual(points, pieces)
            return out + (0.3 * rng.standard_normal(out.shape) if timestep else 0.0)

    steady = case(0.0)
    arm = Jittering(**steady.__dict__)
    found = fit(arm, every(), START, free_parameters(arm, []), 2, SEGMENTS)
    best, *_ = np.linalg.lstsq(steady.X.reshape(-1, 2), steady.y.ravel(), rcond=None)
    assert_allclose(found.point.declared, best, atol=2e-3)


def test_a_score_test_retries_with_a_weaker_effect():
    """Its typical strength, 1, gives up, a tenth does not: the same answer, in proportion."""
    arm, sound = fragile(gust=0.5), fragile()
    found, other = (score(a, base_of(a)) for a in (arm, sound))
    assert not found.unstable
    assert found.share == pytest.approx(other.share, rel=1e-3)
    assert found.excitation == pytest.approx(other.excitation, rel=1e-3)
    assert found.start[0] == pytest.approx(other.start[0], rel=1e-3)


def test_a_full_fit_begins_where_it_is_stable():
    arm = fragile(gust=0.1)
    base = base_of(arm)
    fitted = full_fit(arm, every(), base, score(arm, base), print)
    assert 0 < fitted.point.effects[GUST][0] <= 0.1


def test_a_fit_that_can_begin_nowhere_is_none_and_ends_nothing(tmp_path):
    sound = fragile()
    found, base = score(sound, base_of(sound)), base_of(sound)
    trials = Trials(every(), every(), Checkpoints(tmp_path, Stopwatch()), print)
    begun = [
        trials.stable(f"gust_{n}", lambda a=arm: full_fit(a, every(), base, found, print))
        for n, arm in enumerate((fragile(gust=-1.0), sound))
    ]
    assert begun[0] is None and begun[1] is not None


def test_an_effect_that_no_strength_of_is_stable_is_said_to_be_untested(tmp_path):
    """The verdict says with a reason that the effect is untested, as do the cautions, also when read back."""
    arm = fragile(gust=0.0)
    base = base_of(arm)
    notes = Checkpoints(tmp_path, Stopwatch())
    for _ in range(2):
        (found,) = notes.scores("gust", lambda: [score(arm, base)])
        assert found.unstable and found.share == found.excitation == 0
    none = Errors(*np.ones((2, SEGMENTS, 5)))
    one = Round(base, none, {GUST: CandidateTrial(found, None, None, 1.0)}, ())
    selection = Selection(arm, base, base, base, (one,))
    verdict, why = _verdict(GUST, one, selection, arm)
    assert verdict == UNSTABLE and "unstable" in why
    (told,) = unstable_fits(arm, selection, every())
    assert told.startswith("gust was not tested: the simulation of a twin with it became unstable")


def test_logs_of_which_every_candidate_is_unstable_show_nothing():
    tried = Tried(GUST, 1.0, UNSTABLE, 0.0, None, "it gave up")
    assert replace(diagnosis(), candidates=(tried,)).blind


def test_a_twin_that_gives_up_on_held_out_logs_is_no_gain():
    known = Errors(np.ones((4, 5)), np.full((4, 5), np.nan))
    lost = Errors(*np.full((2, 4, 5), np.nan))
    assert gave_up(known, lost)
    assert not gave_up(known, known) and not gave_up(lost, lost)
