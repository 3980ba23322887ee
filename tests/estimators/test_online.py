"""Test that measured markers correct an estimate exactly as a batch fit would."""

import itertools

import numpy as np
import pytest
from learning_sessions import QUIET, wandering

from serpent_twin.arm import geometry
from serpent_twin.estimators import Estimator, Live, find
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.bus_reading import BusReading, readings
from serpent_twin.estimators.online import FEATURES, Forgetting, Online, features
from serpent_twin.readouts.windows import SessionWindows, cut


class Fixed(Live):
    """An estimator that always says the same markers, or none for its first readings."""

    def __init__(self, silent: int = 0, covariance: float = 1e-6) -> None:
        self.marker = geometry.markers(np.zeros((1, 9)))
        self.covariance = np.tile(covariance * np.eye(3), (1, 9, 1, 1))
        self.silent = silent

    def update(self, now: BusReading) -> Belief | None:
        self.silent -= 1
        return None if self.silent >= 0 else Belief(self.marker, self.covariance)


def session(number: int = 1, rows: int = 400, give: float = 0.3) -> SessionWindows:
    return cut([wandering(number, rows, give)], 4, drop=3).sessions[0]


def watch(online: Online, of: SessionWindows, until: int | None = None) -> Belief:
    """What it says of each row before it is shown the markers; they are lost from row `until` on."""
    told, first = [], len(of.log.time) - len(of)
    for k, now in enumerate(readings(of.log)):
        belief = online.update(now)
        if belief is None or k < first:
            continue
        told.append(belief)
        lost = until is not None and k - first >= until
        online.correct(np.full((9, 3), np.nan) if lost else of.marker[k - first])
    return Belief(
        *(np.concatenate([getattr(b, n) for b in told]) for n in ("marker", "covariance"))
    )


def off_mm(belief: Belief, marker: np.ndarray) -> np.ndarray:
    return 1e3 * np.nanmean(np.linalg.norm(belief.marker - marker, axis=-1), axis=1)


@pytest.fixture(scope="module")
def base() -> Estimator:
    estimator = find("residual")()
    learn, steer = (cut([wandering(n) for n in of], 4, 10) for of in ((1, 2, 3, 4), (5,)))
    estimator.trained.fit(learn, steer, np.random.default_rng(0), QUIET)
    return estimator


def test_weights_are_those_of_the_batch_problem():
    """Least squares by orthogonal factors on weighted rows, the ridge as rows below them."""
    rng, of, forgetting = (
        np.random.default_rng(0),
        session(rows=300),
        Forgetting(weights_s=20.0, ridge=0.3),
    )
    seen = rng.random((300, 9)) < 0.8
    seen[100:150] = False
    live = Fixed()
    online = Online(live, forgetting)
    rows, before = [], live.marker[0]
    for k, now in enumerate(readings(of.log)):
        online.update(now)
        marker = geometry.markers(0.3 * np.sin(k / 7 + np.arange(9)))
        marker[~seen[k]] = np.nan
        online.correct(marker)
        rows.append((features(now, live.marker[0], np.zeros((9, 3))), marker - before))
    x = np.stack([row for row, _ in rows])
    for marker in range(9):
        own = np.flatnonzero(seen[:, marker])
        age = np.arange(len(own))[::-1]  # forgetting counts the time watched
        weight = np.sqrt(np.exp(-0.25 * age / 20.0))[:, None]
        y = np.stack([rows[k][1][marker] for k in own])
        left = np.vstack([weight * x[own], np.sqrt(0.3) * np.eye(FEATURES)])
        right = np.vstack([weight * y, np.zeros((FEATURES, 3))])
        expected, *_ = np.linalg.lstsq(left, right, rcond=None)
        np.testing.assert_allclose(online.weight[marker], expected, rtol=0, atol=1e-8)


def test_without_markers_it_is_the_estimator_as_it_is(base):
    of = session(9)
    belief, own = watch(Online(base.live()), of, until=0), base.follow(of)
    np.testing.assert_allclose(belief.marker, own.marker, rtol=0, atol=1e-15)
    np.testing.assert_allclose(belief.covariance, own.covariance, rtol=1e-12)


def test_an_arm_that_changed_is_found_again(base):
    before, changed = session(9, 600), session(10, 1200, give=0.5)
    online = Online(base.live())
    same = off_mm(watch(online, before), before.marker)[200:].mean()
    after = off_mm(watch(online, changed), changed.marker)
    without = off_mm(base.follow(changed), changed.marker)
    assert same < 1.1 * off_mm(base.follow(before), before.marker)[200:].mean()
    assert after[120:400].mean() < 0.7 * without[120:400].mean()  # half a minute later
    assert after[400:].mean() < 0.6 * without[400:].mean()


def test_what_was_learned_is_held_while_cameras_are_blind(base):
    changed = session(10, 1200, give=0.5)
    online = Online(base.live())
    belief = watch(online, changed, until=800)
    held = online.weight.copy()
    without = off_mm(base.follow(changed), changed.marker)
    assert off_mm(belief, changed.marker)[800:].mean() < 0.65 * without[800:].mean()
    watch(online, session(11), until=0)
    np.testing.assert_array_equal(online.weight, held)


def test_it_says_how_sure_it_is(base):
    changed = session(10, 1600, give=0.5)
    noisy = changed.marker + np.random.default_rng(0).normal(0, 5e-4, changed.marker.shape)
    own = base.follow(changed).coverage(noisy)
    online, told = Online(base.live()), []
    for k, now in enumerate(readings(changed.log)):
        belief = online.update(now)
        if belief is not None:
            told.append(belief)
            online.correct(noisy[k - 3])
    belief = Belief(
        *(np.concatenate([getattr(b, n) for b in told]) for n in ("marker", "covariance"))
    )
    late = Belief(belief.marker[200:], belief.covariance[200:])
    assert own < 0.8
    assert 0.9 < late.coverage(noisy[200:]) < 0.99


def test_standing_still_for_long_does_not_wind_up():
    online, rng = Online(Fixed()), np.random.default_rng(0)
    of = session(1, 300)
    moving = list(readings(of.log))
    for now in moving:
        online.update(now)
        online.correct(geometry.markers(np.zeros(9)) + rng.normal(0, 1e-3, (9, 3)))
    largest = np.abs(online.weight).max()
    for k in range(3000):  # twelve times the memory
        online.update(BusReading(moving[-1].time + 0.25 * (k + 1), *still(moving[-1])))
        online.correct(geometry.markers(np.zeros(9)) + rng.normal(0, 1e-3, (9, 3)))
    assert np.isfinite(online.weight).all()
    assert np.abs(online.weight).max() < largest
    now = moving[0]
    belief = online.update(BusReading(1e5, *still(now)))
    assert belief is not None
    assert np.abs(belief.marker - Fixed().marker).max() < 2e-3


def still(now: BusReading) -> tuple[np.ndarray, ...]:
    return now.position, np.zeros(10), now.load, np.zeros(10)


def test_nothing_is_learned_before_the_first_estimate_nor_twice():
    of, online = session(), Online(Fixed(silent=3))
    rows = readings(of.log)
    measured = geometry.markers(np.full(9, 0.05))
    online.correct(measured)
    for now in itertools.islice(rows, 3):
        assert online.update(now) is None
        online.correct(measured)
    assert not online.weight.any()
    assert online.update(next(rows)) is not None
    online.correct(measured)
    once = online.weight.copy()
    assert once.any()
    online.correct(measured)
    np.testing.assert_array_equal(online.weight, once)


def test_an_unknown_covariance_is_unknown_until_markers_tell_it():
    of, online = session(), Online(Fixed(covariance=np.nan))
    beliefs = []
    for k, now in enumerate(itertools.islice(readings(of.log), 50)):
        beliefs.append(online.update(now))
        online.correct(of.marker[max(0, k - 3)])
    assert np.isnan(beliefs[0].covariance).all()
    assert np.isfinite(beliefs[-1].covariance).all()
