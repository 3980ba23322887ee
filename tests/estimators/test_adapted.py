"""Test that a correction from few windows of another arm helps, and never harms."""

from dataclasses import fields, replace

import numpy as np
import pytest
from learning_sessions import QUIET, wandering
from scipy.stats import chi2

from serpent_twin.errors import SerpentError
from serpent_twin.estimators import Estimator, available, find, load
from serpent_twin.estimators.adapted import Adapted, Folds
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.estimators.observer import Observer
from serpent_twin.readouts.covariance import growth
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import Windows, cut


def make_windows(numbers: range, window: int = 4, **kwargs: float) -> Windows:
    return cut([wandering(n, **kwargs) for n in numbers], window, drop=10)  # type: ignore


@pytest.fixture(scope="module")
def base() -> Estimator:
    estimator = find("residual")()
    train, validate = make_windows(range(1, 5)), make_windows(range(5, 6))
    estimator.trained.fit(train, validate, np.random.default_rng(0), QUIET)
    return estimator


@pytest.fixture(scope="module")
def other() -> tuple[Windows, Windows]:
    """An arm whose joints give way by half more: sessions to adapt to, and one to judge by."""
    return (
        noisy(make_windows(range(11, 14), give=0.45, lost=0.05)),
        noisy(make_windows(range(14, 15), give=0.45)),
    )


@pytest.fixture(scope="module")
def watched() -> Adapted:
    """A correction of an observer, whose covariance changes with the pose."""
    observer = Observer()
    few = make_windows(range(1, 2), rows=120).first(100)
    observer.fit(few, few, np.random.default_rng(0), QUIET)
    return adapt(observer, few)


def noisy(windows: Windows, size: float = 2e-4) -> Windows:
    rng = np.random.default_rng(len(windows.x))
    return markers_moved(windows, rng.normal(0, size, windows.marker.shape))


def markers_moved(windows: Windows, by: np.ndarray) -> Windows:
    ends = np.cumsum([len(session) for session in windows.sessions])[:-1]
    parts = zip(windows.sessions, np.split(by, ends), strict=True)
    moved = tuple(replace(session, marker=session.marker + part) for session, part in parts)
    return Windows(windows.window, moved, windows.rate_hz)


def adapt(readout: Estimator, windows: Windows) -> Adapted:
    adapted = Adapted.of(readout)
    adapted.fit(windows, windows, np.random.default_rng(0), QUIET)
    return adapted


def error_mm(estimator: Estimator, windows: Windows) -> float:
    session = windows.sessions[0]
    return score(estimator.follow(session).marker, session.marker).mean_mm


def test_more_windows_of_the_arm_lessen_the_error(base, other):
    real, test = other
    before = error_mm(base, test)
    few, some_more, most = (error_mm(adapt(base, real.first(n)), test) for n in (100, 390, 1170))
    assert most < 0.65 * before
    assert most < some_more < 0.9 * before
    assert few < 1.05 * before


@pytest.mark.parametrize("first", [0, 100, 200, 290])
def test_a_hundred_windows_that_teach_nothing_do_no_harm(base, first):
    """The arm it was trained on, seen by noisy cameras: what is missed is noise."""
    same = noisy(make_windows(range(21, 23)), 2e-3)
    few = Windows(4, (same.sessions[0].some(first, first + 100),), same.rate_hz)
    test = Windows(4, same.sessions[1:])
    assert error_mm(adapt(base, few), test) < 1.03 * error_mm(base, test)


def test_an_error_that_drifts_past_all_features_is_at_most_an_offset(base, other):
    """A slow wave: neighbours tell it, so folds of windows drawn at random would be deceived."""
    session = other[0].sessions[0]
    wave = 5e-3 * np.sin(np.arange(len(session)) / 25)[:, None, None] * np.ones((9, 3))
    marker = base.follow(session).marker + wave
    real = Windows(4, (replace(session, marker=marker),), 4.0)
    adapted = adapt(base, real.first(160))
    far = real.sessions[0].some(160, 390)
    missed = score(adapted.follow(far).marker, far.marker).mean_mm
    assert missed < 1.5 * score(base.follow(far).marker, far.marker).mean_mm


def test_a_linear_residual_is_found(base, other):
    rng = np.random.default_rng(1)
    slope = rng.normal(0, 1e-2, (99, 27))
    real, test = (
        markers_moved(w, base.trained.predict(w.x) - w.marker + (w.x @ slope).reshape(-1, 9, 3))
        for w in map(whole, other)
    )
    assert error_mm(base, test) > 3
    assert error_mm(adapt(base, real), test) < 0.02


def whole(windows: Windows) -> Windows:
    """Windows with lost markers set to 0, so that all are seen."""
    filled = tuple(replace(s, marker=np.nan_to_num(s.marker)) for s in windows.sessions)
    return Windows(windows.window, filled, windows.rate_hz)


def test_what_folds_leave_agrees_with_least_squares_by_rows():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(60, 5)), rng.normal(size=(60, 3))
    y[[3, 17, 40]] = np.nan
    penalty = np.array([0.1, 0.1, 0.1, 0.1, 1e-9])
    left = Folds(x, y, count=5, gap=4).left((0.1, 1e-9))
    for first in range(0, 60, 12):
        learn = [k for k in range(60) if not first - 4 <= k < first + 16 and np.isfinite(y[k, 0])]
        rows = sum(not first - 4 <= k < first + 16 for k in range(60))
        with_prior = np.vstack([x[learn], np.diag(np.sqrt(penalty * rows))])
        weight, *_ = np.linalg.lstsq(
            with_prior, np.vstack([y[learn], np.zeros((5, 3))]), rcond=None
        )
        expected = y[first : first + 12] - x[first : first + 12] @ weight
        np.testing.assert_allclose(left[first : first + 12], expected, atol=1e-9)


def test_it_says_how_sure_it_is(base, other):
    real, test = other
    for windows in (real.first(100), real):
        adapted, session = adapt(base, windows), test.sessions[0]
        belief = adapted.follow(session)
        assert 0.88 < belief.coverage(session.marker) < 0.995
        np.testing.assert_allclose(belief.covariance[5], adapted.covariance, rtol=1e-4, atol=1e-12)


def test_the_growth_of_a_covariance_from_few_errors_holds_the_next_one():
    rng, n = np.random.default_rng(0), 12
    seen, following = rng.normal(size=(20000, n, 3)), rng.normal(size=(20000, 3))
    found = np.einsum("anj,ank->ajk", seen, seen) / n
    far = np.einsum("aj,ajk,ak->a", following, np.linalg.inv(found), following)
    assert (far <= growth(n) * chi2.ppf(0.95, 3)).mean() == pytest.approx(0.95, abs=0.01)
    assert growth(1e6) == pytest.approx(1, abs=1e-3)


def test_a_covariance_that_changes_keeps_its_shape(watched):
    session = make_windows(range(1, 2), rows=120).first(100).sessions[0]
    before, after = watched.corrects.follow(session), watched.follow(session)
    assert np.ptp(before.spread, axis=0).max() > 1e-5
    inner = np.linalg.inv(np.linalg.cholesky(before.covariance))
    factor = inner @ after.covariance @ np.swapaxes(inner, -1, -2)  # one for all rows
    np.testing.assert_allclose(
        factor, np.broadcast_to(factor[0], factor.shape), rtol=1e-3, atol=1e-6
    )
    assert 0.9 < after.coverage(session.marker)


@pytest.mark.parametrize("which", ["window", "observer", "twice"])
def test_saved_and_loaded_it_is_the_same(which, base, other, watched, tmp_path):
    once = adapt(base, other[0].first(100))
    kinds = {"window": lambda: once, "observer": lambda: watched}
    adapted = kinds.get(which, lambda: adapt(once, other[0]))()
    adapted.save(tmp_path)
    again, session = load(tmp_path, window=4), other[1].sessions[0].some(0, 50)
    same(again.follow(session), adapted.follow(session), 0.0)
    assert again.trained.rate_hz == adapted.rate_hz == 4.0
    np.testing.assert_array_equal(again.trained.covariance, adapted.covariance)
    assert isinstance(again, Adapted) and again.corrects.trained.rate_hz == 4.0


@pytest.mark.parametrize("which", ["window", "observer"])
def test_row_by_row_it_says_what_it_says_of_a_session(which, base, other, watched):
    adapted = watched if which == "observer" else adapt(base, other[0].first(100))
    session = other[1].sessions[0].some(0, 60)
    live = adapted.live()
    told = [live.update(now) for now in readings(session.log)]
    assert told[:3] == [None, None, None]
    beliefs = [belief for belief in told[-len(session) :] if belief]
    marker, covariance = (
        np.concatenate([getattr(belief, name) for belief in beliefs])
        for name in ("marker", "covariance")
    )
    same(Belief(marker, covariance), adapted.follow(session), 1e-12)


def same(one: Belief, two: Belief, atol: float) -> None:
    np.testing.assert_allclose(one.marker, two.marker, rtol=0, atol=atol)
    np.testing.assert_allclose(one.covariance, two.covariance, rtol=1e-9, atol=atol)


def test_a_window_of_one_row_will_do(other):
    real, test = make_windows(range(1, 3), window=1), make_windows(range(3, 4), window=1)
    stiff = find("analytical")(1)
    assert error_mm(adapt(stiff, real), test) < 0.5 * error_mm(stiff, test)


def test_what_cannot_be_adapted_is_refused(base, other):
    real = other[0]
    with pytest.raises(
        SerpentError, match="39 windows are too few to adapt a readout: give at least 40"
    ):
        adapt(base, real.first(39))
    with pytest.raises(SerpentError, match="show no marker"):
        adapt(base, markers_moved(real, np.full(real.marker.shape, np.nan)))
    with pytest.raises(SerpentError, match="trained on rows at 4 Hz, these come at 20 Hz"):
        adapt(base, replace(real, rate_hz=20.0))
    with pytest.raises(SerpentError, match="has not been fitted"):
        adapt(find("residual")(), real)


def test_a_marker_never_seen_stays_where_the_base_puts_it(base, other):
    lost = np.zeros(other[0].marker.shape)
    lost[:, 2] = np.nan
    session = other[1].sessions[0]
    moved = adapt(base, markers_moved(other[0], lost)).follow(session).marker
    np.testing.assert_array_equal(moved[:, 2], base.follow(session).marker[:, 2])


def test_it_is_not_trained_by_name():
    assert "adapted" not in available()
    assert all(kind.trained.window == 4 for kind in available().values())
    assert [f.name for f in fields(Adapted) if f.kw_only] == ["base", "settings"]
    with pytest.raises(SerpentError, match="no readout 'adapted'"):
        find("adapted")
