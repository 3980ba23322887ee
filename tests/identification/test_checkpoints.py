"""Test that finished stages of a trace are kept and read back."""

import numpy as np
import pytest
from linear_case import GUST, START, case, every, scored

from serpent_twin.errors import SerpentError
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.machines.case import Stopwatch


def test_a_stage_that_was_finished_is_read_back(tmp_path):
    arm, asked = case(0.7), []
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)

    def make():
        asked.append(1)
        return full_fit(arm, every(), base, scored(arm, base), print)

    own, notes = (Checkpoints(tmp_path / "stages", Stopwatch()) for _ in range(2))
    first = own.fit("gust", make)
    own.fit("gust", make)
    assert own.seconds == 0  # this run's own clock has it
    again = notes.fit("gust", make)
    took = notes.seconds
    notes.fit("gust", make)
    assert notes.seconds == took > 0
    assert len(asked) == 1
    np.testing.assert_array_equal(first.jacobian, again.jacobian)
    assert first.point.effects[GUST] == again.point.effects[GUST]
    assert (first.free, first.used, first.cost) == (again.free, again.used, again.cost)


def test_numbers_of_a_stage_are_read_back_and_others_refused(tmp_path):
    made = np.array([0.5, 0.0, 0.25])  # no limit by gain
    Checkpoints(tmp_path, Stopwatch()).numbers("limits_gust", 3, made.copy)
    again = Checkpoints(tmp_path, Stopwatch())
    np.testing.assert_array_equal(again.numbers("limits_gust", 3, made.tolist), made)
    with pytest.raises(SerpentError, match=r"limits_gust.npz.*numbers.*Delete it"):
        again.numbers("limits_gust", 4, made.copy)


def test_a_stage_is_kept_whatever_its_places_are_called(tmp_path):
    """MuJoCo's names may hold a slash, and be as long as one likes."""
    names = [
        "limits_payload@left/wrist",
        "limits_payload@left_wrist",
        "fit_" + 60 * "länge/",
        "fit_",
    ]
    for _ in range(2):
        notes = Checkpoints(tmp_path, Stopwatch())
        for n, name in enumerate(names):
            assert notes.numbers(name, 1, lambda n=n: np.array([float(n)]))[0] == n
    assert len(list(tmp_path.iterdir())) == len(names)
