"""Test that what a trace keeps of its fits outlives its stages."""

import shutil

import numpy as np
import pytest
from linear_case import GUST, START, case, every, scored

from serpent_twin.errors import SerpentError
from serpent_twin.identification import kept_fit
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.fitting.free_parameters import free_parameters, jacobian
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.run import _seen_from
from serpent_twin.machines.case import Stopwatch


@pytest.fixture
def folder(tmp_path):
    """A folder with the stages of a trace that accepted nothing, and tried one candidate."""
    arm, notes = case(0.7), Checkpoints(tmp_path / "stages", Stopwatch())
    base = notes.fit(
        "calibrated_3", lambda: fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    )
    notes.fit("fit_1_gust", lambda: full_fit(arm, every(), base, scored(arm, base), print))
    return tmp_path


def test_the_kept_fit_is_the_last_one_but_for_what_is_computed_again(folder):
    before, single = kept_fit.fits(folder, False)
    kept_fit.keep(folder, False)
    shutil.rmtree(folder / "stages")
    after, kept = kept_fit.fits(folder, False)
    np.testing.assert_array_equal(after.point.declared, before.point.declared)
    np.testing.assert_array_equal(after.noise, before.noise)
    assert (after.free, after.used) == (before.free, before.used)
    assert after.variance_inflation == before.variance_inflation
    assert not after.residual.size and not after.jacobian.size
    np.testing.assert_array_equal(kept[GUST].effects[GUST], single[GUST].effects[GUST])
    arm = case(0.7)
    again, slopes = jacobian(arm, after.point, after.free, arm.take(every(), after.used))
    np.testing.assert_allclose(again, before.residual, atol=1e-6)
    np.testing.assert_allclose(slopes, before.jacobian, rtol=1e-4, atol=1e-5)


def test_a_damaged_file_and_none_are_refused(folder):
    kept_fit.keep(folder, False)
    shutil.rmtree(folder / "stages")
    (folder / kept_fit.FILE).write_bytes(b"no archive")
    with pytest.raises(SerpentError, match=r"fit\.npz"):
        kept_fit.fits(folder, False)
    (folder / kept_fit.FILE).unlink()
    with pytest.raises(SerpentError, match="finished"):
        kept_fit.fits(folder, False)


def test_logs_are_named_from_the_results_within_the_working_folder_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out, logs = tmp_path / "data" / "trace", tmp_path / "logs"
    assert _seen_from(out.relative_to(tmp_path), logs.relative_to(tmp_path)) == "../../logs"
    assert _seen_from(out, tmp_path.parent / "elsewhere") == str(tmp_path.parent / "elsewhere")
