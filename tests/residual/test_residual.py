"""Test that a residual is separated from noise, and that nothing is found where nothing was put in."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from residual_cases import CASES, LOAD_NOISE, NOISE, case, fading, found, made, only

from serpent_twin.errors import SerpentError
from serpent_twin.residual import (
    analyse,
    depends_on,
    describe,
    expected_distance,
    join,
    load_size,
    marker_size,
    measurement_noise,
)
from serpent_twin.residual import learned as last_resort
from serpent_twin.residual.figures import figures

# Size and noise


def test_sizes_agree_with_a_count_by_hand():
    c = case("nothing")
    off = np.zeros((10, 160, 9, 3))
    off[:, :, 8] = [0.003, 0.004, 0.0]
    off[0, 0, 0] = np.nan
    felt = c.load_predicted + only(
        1, np.where(np.abs(c.motor_velocity[..., 1]) > 0.1, 0.03, 0.01), 10
    )
    c = replace(c, marker_measured=c.marker_predicted + off, load_measured=felt)
    size, load = marker_size(c), load_size(c, moving_above=0.1)
    np.testing.assert_allclose(size.by_marker, [0] * 8 + [5], atol=1e-9)
    assert size.mean == pytest.approx(5 * 1600 / (9 * 1600 - 1))
    np.testing.assert_allclose(size.mean_residual[8], [3, 4, 0], atol=1e-9)
    np.testing.assert_allclose(load.moving, only(1, np.array(3.0), 10), atol=1e-9)
    np.testing.assert_allclose(load.resting, only(1, np.array(1.0), 10), atol=1e-9)


def test_the_mean_length_of_gaussian_vectors():
    drawn = np.linalg.norm(np.random.default_rng(0).normal(0, 0.7, (200_000, 3)), axis=1)
    assert expected_distance(0.7) == pytest.approx(drawn.mean(), rel=0.005)


@pytest.mark.parametrize("name", ["nothing", "force", "sticks", "play", "delay", "drift"])
@pytest.mark.parametrize("geometry", [True, False])
def test_the_noise_is_told_from_motion_and_from_errors_of_the_twin(name, geometry):
    c = case(name)
    noise = measurement_noise(c if geometry else replace(c, joint_anchor=None, joint_axis=None))
    # Without joint axes an error that jumps with the motion is partly taken for noise.
    above = 1.08 if geometry or name in ("nothing", "drift") else 1.6
    assert 0.95 * NOISE < noise.marker.mean() < above * NOISE
    assert noise.load.mean() == pytest.approx(LOAD_NOISE, rel=0.05)


def test_rows_in_which_no_marker_is_seen_say_nothing_of_the_noise():
    """Markers are lost in the first rows of each segment, which do not count."""
    c = case("force")
    seen = c.marker_measured.copy()
    seen[:, :12] = np.nan
    noise = measurement_noise(replace(c, marker_measured=seen))
    assert 0.95 * NOISE < noise.marker.mean() < 1.08 * NOISE


def test_markers_may_differ_in_their_noise():
    c = case("nothing")
    scale = np.linspace(0.5, 2.0, 9)
    c = replace(c, marker_measured=c.marker_predicted + c.marker_residual * scale[:, None])
    np.testing.assert_allclose(measurement_noise(c).marker, scale * NOISE, rtol=0.2)


# Nothing where nothing is


def test_white_noise_depends_on_nothing():
    wrong = [
        bool(depends_on(made(100 + n, S=7), np.random.default_rng(n), permutations=79))
        for n in range(8)
    ]
    assert sum(wrong) <= 1  # one in 20 is expected


def test_an_arm_that_lacks_nothing_is_called_so():
    text = describe(found("nothing"))
    assert "no more than noise" in text and "follow" not in text
    assert found("nothing").marker.mean == pytest.approx(
        found("nothing").noise.mean_floor, rel=0.05
    )


def test_a_slow_error_that_follows_nothing_is_called_so():
    """Wander of its own: memory alone must not pass for dependence."""
    rng, wrong = np.random.default_rng(7), 0
    for seed in range(6):
        wander = [fading(rng.normal(0, 0.03, (7, 260)), 5.0)[:, 100:] for _ in range(9)]
        own = np.stack(wander, axis=-1)
        c = made(seed, S=7, turn=lambda *_, own=own: own)
        wrong += bool([d for d in depends_on(c, rng, permutations=79) if d.kind != "load"])
    assert wrong <= 1


# Rigs that lack something


@pytest.mark.parametrize("without", ["tension", "joint_anchor", "joint_angle", "motor_velocity"])
def test_a_rig_may_lack_some_quantities(without):
    c = replace(case("force"), **{without: None})
    result = analyse(c, np.random.default_rng(0), permutations=49)
    assert result.depends_on and np.isfinite(
        json.loads(json.dumps(result.numbers()))["above_noise_mm"]
    )
    if without != "joint_angle":
        assert result.depends_on[0].feature.name == "joint 4's angle"


def test_a_rig_may_measure_loads_alone_or_markers_alone():
    c = case("ripple")
    loads = replace(c, marker_measured=None, marker_predicted=None, joint_anchor=None)
    result = analyse(loads, np.random.default_rng(0), permutations=49)
    assert result.depends_on[0].feature.name == "motor 3's angle"
    assert describe(result).startswith("The loads by") and figures({"twin": loads}, result)
    alone = replace(case("force"), load_measured=None, load_predicted=None)
    result = analyse(alone, np.random.default_rng(0), permutations=49)
    assert result.depends_on[0].shape.edges[0] == pytest.approx(0.21, abs=0.01)


def test_what_does_not_fit_together_is_refused():
    c = case("nothing")
    with pytest.raises(SerpentError, match="load_measured has shape"):
        replace(c, load_predicted=c.load_predicted[..., :3])
    with pytest.raises(SerpentError, match="tension has shape"):
        replace(c, tension=c.tension[:2])
    with pytest.raises(SerpentError, match="2 marker_names for 9"):
        replace(c, marker_names=("a", "b"))


def test_comparisons_join_and_part():
    a, b = made(1, S=2), made(2, S=3)
    both = join([a, b])
    assert len(both) == 5
    np.testing.assert_array_equal(both.segments(slice(2, None)).tension, b.tension)


# The last resort


def test_the_learned_correction_helps_on_logs_it_has_not_seen():
    learned = last_resort.learn(
        made(11, S=12, **CASES["delay"]), case("delay"), np.random.default_rng(0)
    )
    before = marker_size(case("delay")).mean
    after = marker_size(learned.corrected(case("delay"))).mean
    assert learned.on and learned.share == pytest.approx(1 - after / before)
    assert learned.interval[0] < learned.share < learned.interval[1]
    assert after < 1.4 * expected_distance(1e3 * NOISE)


@pytest.mark.parametrize("name", ["nothing", "sway"])
def test_the_learned_correction_is_off_where_it_does_not_help(name):
    learned = last_resort.learn(made(11, S=12, **CASES[name]), case(name), np.random.default_rng(0))
    assert not learned.on and learned.share == 0.0 and learned.interval == (0.0, 0.0)
    corrected = learned.corrected(case(name))
    np.testing.assert_array_equal(corrected.marker_predicted, case(name).marker_predicted)


def test_what_holds_in_training_alone_is_not_switched_on():
    """Another error on the held-out logs than in training."""
    training = made(11, S=12, **CASES["delay"])
    held_out = made(12, S=6, turn=lambda q, dq, *_: 0.02 * dq)
    learned = last_resort.learn(training, held_out, np.random.default_rng(0))
    assert not learned.on and learned.share == 0.0


def test_a_learned_correction_is_saved_and_refused_where_it_does_not_fit(tmp_path):
    training = made(11, S=12, **CASES["delay"])
    learned = last_resort.learn(training, case("delay"), np.random.default_rng(0))
    learned.save(tmp_path / "learned.npz")
    again = last_resort.load(tmp_path / "learned.npz")
    assert (again.share, again.interval, again.lags) == (
        learned.share,
        learned.interval,
        learned.lags,
    )
    np.testing.assert_array_equal(
        again.corrected(case("delay")).marker_predicted,
        learned.corrected(case("delay")).marker_predicted,
    )
    faster = replace(case("delay"), time=case("delay").time / 10)
    with pytest.raises(
        SerpentError, match=r"0\.025 s between rows, the learned correction 0\.25 s"
    ):
        again.corrected(faster)
    (tmp_path / "other.npz").write_bytes(b"no such thing")
    with pytest.raises(SerpentError, match=r"other\.npz is not a whole \.npz file"):
        last_resort.load(tmp_path / "other.npz")


# Figures


def test_figures_show_what_was_measured():
    nominal = case("force").corrected(np.full((10, 160, 9, 3), 2e-3))
    drawn = figures({"nominal": nominal, "calibrated": case("force")}, found("force"))
    names = [figure.name for figure in drawn]
    assert names == [
        "error_by_marker",
        "error_over_time",
        "load_error_by_motor",
        "residual_spectrum",
    ]
    lines = drawn[0].drawing.axes[0].get_lines()
    np.testing.assert_allclose(lines[0].get_ydata(), marker_size(nominal).by_marker)
    assert [line.get_label() for line in lines] == ["nominal", "calibrated"]
    for figure in drawn:
        figure.drawing.savefig(io.BytesIO(), format="png", dpi=40)
