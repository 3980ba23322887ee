"""A law that explains alone what a named effect and another law do."""

import hanging_models
import numpy as np
import pytest
from hanging_models import lever
from linear_case import GUST, NOTHING, SEGMENTS, START, case, every

from serpent_twin.identification import Trace, composing, refitting, steps, trace
from serpent_twin.identification.acceptance import CandidateTrial, Round
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.composing import ComposingTracer
from serpent_twin.identification.detection import opening_fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.held_out import Errors
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Stopwatch


def test_after_many_laws_no_other_is_sought_and_the_trace_says_so():
    arm = case(0.7)
    found = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    rounds = [Round(found, Errors(*np.ones((2, SEGMENTS, 5))), {}, (GUST,))]
    tracer = ComposingTracer(arm, every(), every(), None, print, 0)
    assert not tracer._enough() and not tracer.cautions
    tracer._laws = composing._ENOUGH
    assert tracer._replaced(found, rounds, 1) is None  # nothing is tried in its place
    (told,) = tracer.cautions
    assert told.startswith("No other law was sought after 16 had been fitted")


@pytest.mark.parametrize(
    ("little", "opened", "calibrated_with"),
    [(True, False, []), (False, False, [1]), (False, True, [])],
)
def test_where_an_effect_leaves_much_it_is_calibrated_with_it(
    monkeypatch, little, opened, calibrated_with
):
    """A calibration without an effect may have gone astray; where little is left, it has not, nor where the
    effect was fitted from where nothing was calibrated.
    """
    arm = case(0.7)
    found = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    tracer = ComposingTracer(arm, every(), every(), None, print, 0)
    again = []
    monkeypatch.setattr(tracer, "_little_left", lambda _: little)
    monkeypatch.setattr(tracer, "_calibrated_with", lambda fit, n: again.append(n) or fit)
    trial = CandidateTrial(None, found, None, 0.0, opened=opened)
    rounds = [Round(found, Errors(*np.ones((2, SEGMENTS, 5))), {GUST: trial}, (GUST,))]
    assert tracer._settled(found, rounds) is found
    assert again == calibrated_with


@pytest.mark.slow
def test_a_law_takes_the_place_of_a_named_effect_that_is_a_part_of_it(tmp_path, monkeypatch):
    """A weight that acts beyond an angle is a payload, and a law that takes it away before the angle."""

    def weight(q):
        return -3.0 * lever(q, 2)[1] * 0.5 * (1 + np.tanh((q[0] - 0.01) / 0.003))

    chosen = steps.best_trial

    def named_first(trials, candidates):
        return "payload@end_3" if set(trials) == {"payload@end_3"} else chosen(trials, candidates)

    monkeypatch.setattr(steps, "best_trial", named_first)
    monkeypatch.setattr(steps, "weakness_of_fit", lambda *_: "")
    path = hanging_models.machine(tmp_path / "chain")
    path.write_text('candidates = ["payload@end_3"]\n' + path.read_text())
    for n in range(3):
        hanging_models.log(tmp_path / "logs" / f"poses_{n}.csv", n, weight)
    found = trace(Trace((tmp_path / "logs",), tmp_path / "trace", machine=path))
    (law,) = found["effects"]
    assert (law["name"], law["place"]["name"], law["law"]) == ("discovered", "link_3", "above")
    assert law["parameters"]["size_z"]["value"] == pytest.approx(-3.0, rel=0.1)
    assert any("instead" in each.name for each in (tmp_path / "trace" / "stages").iterdir())


@pytest.mark.parametrize("strength", [0.0, 0.7])
def test_an_effect_that_the_last_fit_brings_to_nothing_is_left_out(strength, tmp_path):
    arm = case(strength)
    notes = Checkpoints(tmp_path, Stopwatch())
    tracer = ComposingTracer(arm, every(), every(), notes, print, 0)
    begun = START.having(GUST, [0.3])
    found = fit(arm, every(), begun, free_parameters(arm, (GUST,)), 2, 99)
    kept = tracer._without_idle(found)
    assert set(kept.point.effects) == ({GUST} if strength else set())
    assert len(kept.free) == 2 + bool(strength) == len(kept.error)


@pytest.mark.parametrize(("explains", "taken"), [(0.0, True), (1e3, False)])
def test_a_named_effect_that_explains_as_much_takes_the_place_of_a_law(
    explains, taken, monkeypatch
):
    """A payload that a calibration absorbed leaves a law at a place, which the payload then replaces."""
    arm, law = case(0.7), "discovered@force of tip: linear joint_angle of hinge"
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    named = fit(arm, every(), START.having(GUST, [0.3]), free_parameters(arm, (GUST,)), 2, 99)
    tracer = ComposingTracer(arm, every(), every(), None, print, 0)
    tracer._at_opening = (arm, opening_fit(arm, every()), [])
    sought = []

    def from_opening(trials, names, opening, base, before, stage):
        sought.append((names, opening))
        return {GUST: CandidateTrial(None, named, None, 0.0, fits=0.5, opened=True)}

    monkeypatch.setattr(refitting, "from_opening", from_opening)
    monkeypatch.setattr(refitting, "best_trial", lambda trials, candidates: GUST)
    monkeypatch.setattr(tracer, "_stands", lambda rounds: rounds[-1].trials[GUST].fit)
    errors = Errors(*np.ones((2, SEGMENTS, 5)))
    rounds = [
        Round(base, errors, {law: CandidateTrial(None, base, None, 0.0, fits=explains)}, (law,))
    ]
    assert tracer._by_name(base, rounds) is (named if taken else None)
    assert [each.accepted for each in rounds] == ([(), (GUST,)] if taken else [(law,), ()])
    assert [each.undone for each in rounds] == ([GUST, ""] if taken else ["", spaced(law)])
    assert sought == [([GUST, NOTHING], tracer._at_opening[:2])]
    assert tracer._by_name(base, rounds) is None  # it is sought once
    assert len(sought) == 1
