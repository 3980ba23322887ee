"""Test the readouts' contract, and that they find known relations."""

from dataclasses import fields, replace

import numpy as np
import pytest
from learning_sessions import QUIET, make_session, make_windows

from serpent_twin.arm import geometry
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import WindowEstimator
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.readouts import Readout, available, find, load
from serpent_twin.readouts import windows as win
from serpent_twin.readouts.decoder import joint_angles
from serpent_twin.readouts.linear import ridge_weights, with_one
from serpent_twin.readouts.scale import scale_of, spread_of
from serpent_twin.readouts.score import score

WINDOWED = [
    name for name in available() if "observer" not in name
]  # it follows sessions: test_observer.py
LEARNING = [name for name in WINDOWED if name != "analytical"]


def small(name: str) -> Readout:
    """The readout with a network so small that it trains in a second."""
    wanted = {"width": 48, "layers": 2, "epochs": 4 if name == "ensemble" else 30}
    known = {field.name for field in fields(find(name))}
    return find(name)(**{key: value for key, value in wanted.items() if key in known})


@pytest.fixture(scope="module")
def data() -> tuple[win.Windows, win.Windows, win.Windows]:
    return (
        make_windows(range(1, 7), lost=0.02),
        make_windows(range(7, 8)),
        make_windows(range(8, 9)),
    )


@pytest.fixture(scope="module")
def fitted(data) -> dict[str, Readout]:
    readouts = {name: small(name) for name in WINDOWED}
    for readout in readouts.values():
        readout.fit(data[0], data[1], np.random.default_rng(0), QUIET)
    return readouts


def error_mm(readout: Readout, windows: win.Windows) -> float:
    session = windows.sessions[0]
    return score(readout.predict(session.x, session.start), session.marker).mean_mm


@pytest.mark.parametrize("name", WINDOWED)
def test_estimates_are_finite_markers_row_by_row(name, data, fitted):
    session = data[2].sessions[0]
    together = fitted[name].predict(session.x, session.start)
    assert together.shape == (len(session.x), 9, 3)
    assert np.isfinite(together).all()
    one = fitted[name].predict(session.x[7:8], session.start)
    np.testing.assert_allclose(one[0], together[7], atol=2e-6)


@pytest.mark.parametrize("name", LEARNING)
def test_every_readout_learns_most_of_what_the_loads_do(name, data, fitted):
    stiff = error_mm(fitted["analytical"], data[2])
    # A network this small and without the kinematics learns the pose itself only coarsely.
    spread = 1e3 * np.linalg.norm(data[2].marker - data[2].marker.mean(axis=0), axis=-1).mean()
    bound = (
        0.5 * stiff if name in ("residual", "residual_mlp", "decoder", "ensemble") else 0.6 * spread
    )
    assert error_mm(fitted[name], data[2]) < bound


@pytest.mark.parametrize("name", LEARNING)
def test_the_same_seed_gives_the_same_readout(name, data, fitted):
    again = small(name)
    again.fit(data[0], data[1], np.random.default_rng(0), QUIET)
    for key, value in again.learned.items():
        np.testing.assert_array_equal(value, fitted[name].learned[key])


@pytest.mark.parametrize("name", WINDOWED)
def test_windows_of_another_length_are_refused(name, data, fitted, tmp_path):
    other = make_windows(range(1, 2), window=3)
    with pytest.raises(SerpentError, match=r"windows of 4 rows, 99 numbers.*\(390, 72\)"):
        fitted[name].predict(other.x, other.sessions[0].start)
    fitted[name].save(tmp_path)
    with pytest.raises(SerpentError, match="was trained for windows of 4 rows, asked for were 3"):
        load(tmp_path, window=3)


@pytest.mark.parametrize("name", [name for name in LEARNING if name != "ensemble"])
def test_nothing_of_validation_and_test_leaks_into_the_scales(name, data, fitted):
    loud = replace(data[1].sessions[0], x=100 * data[1].x, marker=100 * data[1].marker)
    again = small(name)
    again.fit(data[0], win.Windows(4, (loud,)), np.random.default_rng(0), QUIET)
    for key in [key for key in again.learned if key.endswith(("_middle", "_half"))]:
        if (name, key[0]) != ("residual_mlp", "y"):  # validation chooses its ridge, rightly
            np.testing.assert_array_equal(again.learned[key], fitted[name].learned[key])


def test_an_unknown_readout_is_answered_with_those_that_exist():
    with pytest.raises(SerpentError, match=r"'lstn'; there are analytical, linear.*mean lstm\?"):
        find("lstn")


def test_stiff_cables_make_the_analytical_pose_exact():
    stiff = make_windows(range(1, 2), give=0.0)
    assert error_mm(find("analytical")(), stiff) < 1e-6


def test_the_analytical_pose_needs_no_zero_when_it_has_first_markers():
    session = make_session(1, give=0.0)
    offset = session.motor_position + np.cumsum(np.linspace(-0.15, 0.15, 10))
    moved = win.cut([session.having(motor_position=offset)], 4)
    assert error_mm(find("analytical")(), moved) < 1e-6


def test_the_linear_readout_agrees_with_the_normal_equations(data):
    train, _, test = make_windows(range(1, 5)), data[1], data[2]
    readout = find("linear")(ridge=0.0)
    readout.fit(train, data[1], np.random.default_rng(0), QUIET)
    scale = scale_of(train.x)  # independent: lstsq, by orthogonal factors, on the same columns
    one = with_one(scale.down(train.x))
    weight, *_ = np.linalg.lstsq(one, train.marker.reshape(-1, 27), rcond=None)
    expected = with_one(scale.down(test.x)) @ weight
    np.testing.assert_allclose(readout.predict(test.x).reshape(-1, 27), expected, atol=1e-5)


def test_a_ridge_with_gaps_equals_one_ridge_per_column():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(200, 6)), rng.normal(size=(200, 5))
    y[rng.random(200) < 0.1, :3] = np.nan
    y[rng.random(200) < 0.1, 4] = np.nan
    found = ridge_weights(x, y, 1e-2)
    for k in range(5):
        ok = np.isfinite(y[:, k])
        gram = x[ok].T @ x[ok] + 1e-2 * 200 * np.eye(6)
        np.testing.assert_allclose(found[:, k], np.linalg.solve(gram, x[ok].T @ y[ok, k]))


def test_the_residual_ridge_finds_a_linear_residual_exactly(data):
    rng = np.random.default_rng(1)
    slope = rng.normal(0, 1e-2, (99, 27))
    stiff = find("analytical")()

    def with_linear_residual(windows: win.Windows) -> win.Windows:
        marker = stiff.predict(windows.x) + (windows.x @ slope).reshape(-1, 9, 3)
        return win.Windows(4, (replace(windows.sessions[0], x=windows.x, marker=marker),))

    train, validate, test = map(with_linear_residual, data)
    readout = find("residual")(ridges=(1e-12,))
    readout.fit(train, validate, np.random.default_rng(0), QUIET)
    assert error_mm(readout, test) < 1e-3


def test_joint_angles_are_recovered_from_markers_and_unknown_where_some_are_lost():
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.4, 0.4, (30, 9))
    marker = geometry.markers(q)
    marker[::2, 3] = np.nan
    found = joint_angles(marker, q + rng.normal(0, 0.1, q.shape))
    assert np.isnan(found[::2]).all()
    # The guess weighs in as an error of 1 mm of a marker against 0.3 rad of a joint.
    np.testing.assert_allclose(found[1::2], q[1::2], atol=5e-3)


def test_scales_span_what_they_should():
    values = np.random.default_rng(0).normal(3, 2, (100, 4))
    values[:, 3], values[5, 0] = 7.0, np.nan
    scaled = scale_of(values).down(values)
    np.testing.assert_allclose(np.nanmin(scaled[:, :3], axis=0), -1)
    np.testing.assert_allclose(np.nanmax(scaled[:, :3], axis=0), 1)
    assert not scaled[:, 3].any()
    np.testing.assert_allclose(scale_of(values).up(scaled), values)
    np.testing.assert_allclose(np.nanstd(spread_of(values).down(values)[:, :3], axis=0), 1)


def test_scores_agree_with_hand_arithmetic():
    measured = np.zeros((2, 9, 3))
    measured[1, 1:] = np.nan
    estimate = np.zeros((2, 9, 3))
    estimate[0, 0] = (0.003, 0.004, 0)  # 5 mm
    estimate[0, 8] = (0, 0, 0.004)  # 4 mm, the tip
    estimate[1, 0] = (0.001, 0, 0)  # 1 mm; all other markers of this step are lost
    found = score(estimate, measured)
    assert found.mean_mm == pytest.approx(10 / 10)
    assert found.std_mm == pytest.approx(np.sqrt((25 + 16 + 1) / 10 - 1))
    assert found.std_of_step_means_mm == pytest.approx(0.0)  # both steps' means are 1 mm
    assert found.tip_mm == pytest.approx(4)
    assert found.per_marker_mm[0] == pytest.approx(3)
    with pytest.raises(SerpentError, match="no marker"):
        score(estimate, np.full((2, 9, 3), np.nan))


@pytest.mark.parametrize("name", WINDOWED)
def test_live_says_row_by_row_what_follow_says_of_a_session(name, data, fitted):
    session = data[2].sessions[0].some(0, 30)
    estimator = WindowEstimator(fitted[name])
    whole, live = estimator.follow(session), estimator.live()
    beliefs = [live.update(now) for now in readings(session.log)]
    assert all(belief is None for belief in beliefs[:3])
    marker = np.concatenate([belief.marker for belief in beliefs[-30:] if belief])
    if name != "analytical":  # which cameras start where there are any
        np.testing.assert_allclose(marker, whole.marker, atol=2e-6)
    error = estimator.follow(data[1].sessions[0]).marker - data[1].marker
    np.testing.assert_allclose(
        whole.spread[0] ** 2, (error**2).sum(axis=-1).mean(axis=0), rtol=1e-6, atol=4e-12
    )
