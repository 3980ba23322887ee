"""Test that what shows in one sensor alone is judged by that sensor."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from serpent_twin.effects import Range
from serpent_twin.identification.acceptance import weakness
from serpent_twin.identification.gained import gained
from serpent_twin.identification.held_out import Gain, errors
from serpent_twin.identification.score_test import Score
from serpent_twin.machines.candidate import Candidate
from serpent_twin.residual import MARKERS, Comparison
from serpent_twin.residual.measure import LOADS


def test_a_law_at_a_sensor_is_judged_by_that_sensor():
    """A third of what one marker of nine shows is a small gain of them all; of a law elsewhere, all count."""
    S, T, M, N = 5, 40, 9, 2
    rng = np.random.default_rng(3)
    true = rng.standard_normal((S, T, M, 3))
    off = rng.standard_normal((S, T, M, 3))
    better = off.copy()
    better[:, :, 4] *= 0.67
    known = {"time": np.tile(np.arange(T), (S, 1)), "marker_measured": true}
    loads = {f"load_{of}": rng.standard_normal((S, T, N)) for of in ("measured", "predicted")}
    before, after = (
        errors(Comparison(("s",) * S, marker_predicted=true - e, **known, **loads))
        for e in (off, better)
    )
    assert before.of_markers.shape == (S, 5, M) and before.of_loads.shape == (S, 5, N)
    assert before.of_markers.mean(axis=-1) == pytest.approx(before.marker_by_block)
    change = np.zeros((S, T, 3 * M + N))
    change[..., 12:15] = 1.0
    # A segment starts from the pose that all markers show, so at first the others are a little off, too.
    started = change.copy()
    started[:, :4, : 3 * M] += 0.1
    none, one = np.zeros(0, np.float32), np.ones(1)
    score = Score("law", 0.0, 1.0, one, False, none, none, one)
    size = {"size": Range("1", -10.0, 10.0, 1.0)}
    law = Candidate("law", size, (one,), composed={"name": "discovered"})
    outputs = [SimpleNamespace(measure=m) for m in (*[MARKERS] * 3 * M, *[LOADS] * N)]
    machine = SimpleNamespace(outputs=outputs)
    own, begun, elsewhere = (
        gained(
            SimpleNamespace(channels=3 * M + N, machine=machine, candidates={"law": law}),
            replace(score, change=each.ravel()),
            (None, None),
            (before, after),
        )
        for each in (change, started, np.ones_like(change))
    )
    assert own.relative == begun.relative == pytest.approx(0.33)
    assert own.whole == pytest.approx(elsewhere.relative) and elsewhere.relative < 0.03
    assert elsewhere.whole == elsewhere.relative


def test_more_is_asked_of_a_law_in_one_sensor():
    """There are many sensors and many laws: one of them often gains a little by chance."""
    rng = np.random.default_rng(1)
    better = Gain(0.06 + 0.001 * rng.standard_normal((4, 5)), np.zeros(4), 0.0, 0.0, 1e-4)
    assert not weakness(better)
    assert "not worth" in weakness(replace(better, of_one_sensor=True))
    assert not weakness(replace(better, by_block=2 * better.by_block, of_one_sensor=True))
