"""Is what was put into a made-up residual found again, and nothing where nothing was put in?"""

import io
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from serpent_twin.arm import joint_axis, link_frames, markers, motor_from_joint
from serpent_twin.errors import SerpentError
from serpent_twin.residual import (
    Comparison,
    analyse,
    depends_on,
    describe,
    expected_distance,
    join,
    load_size,
    marker_size,
    measurement_noise,
    place,
)
from serpent_twin.residual import learned as last_resort
from serpent_twin.residual.drift import drift
from serpent_twin.residual.figures import figures
from serpent_twin.residual.place import joint_jacobian
from serpent_twin.residual.spectrum import spectrum

PERIOD = 0.25
NOISE, LOAD_NOISE = 0.4e-3, 0.007


def motion(rng, S, T):
    """Joint angles and velocities under P control to random targets, new every five rows."""
    low = np.where(np.arange(9) % 2 == 0, -np.pi / 8, 0.0)
    target = np.repeat(rng.uniform(low, np.pi / 8, (T // 5 + 5, S, 9)), 5, axis=0)
    q, rows = np.zeros((S, 9)), []
    for goal in target[: T + 20]:
        dq = 1.6 * (goal - q)
        rows.append((q, dq))
        q = q + PERIOD * dq
    return (np.stack(column[20:], axis=1) for column in zip(*rows, strict=True))


def predicted_loads(q, dm):
    gravity = 0.03 * np.cumsum(np.sin(q[..., ::-1]), axis=-1)[..., ::-1]
    return np.concatenate([gravity, 0.1 * gravity[..., :1]], axis=-1) + 0.03 * np.tanh(dm / 0.05)


def made(seed, S=10, T=160, sessions=1, noise=NOISE, turn=None, load=None, shift=None):
    """A comparison whose twin lacks rotations [rad], loads or shifts [m] given as functions.

    Each is a function of joint angles, joint velocities, motor angles, predicted loads and time.
    """
    rng = np.random.default_rng(seed)
    q, dq = motion(rng, S, T)
    m, dm = (np.concatenate([v, v[..., -1:]], -1) for v in map(motor_from_joint, (q, dq)))
    time = ((np.arange(S) % (S // sessions)) * T)[:, None] * PERIOD + PERIOD * np.arange(T)
    loads = predicted_loads(q, dm)
    state = (q, dq, m, loads, time)
    origin, rotation = link_frames(q)
    measured = markers(q + (turn(*state) if turn else 0)) + (shift(*state) if shift else 0)
    measured = measured + rng.normal(0, noise, measured.shape)
    measured[rng.random(measured.shape[:3]) < 0.002] = np.nan
    felt = loads + (load(*state) if load else 0) + rng.normal(0, LOAD_NOISE, loads.shape)
    return Comparison(
        session=tuple(f"session_{s * sessions // S + 1:02d}" for s in range(S)),
        time=time,
        marker_measured=measured,
        marker_predicted=markers(q),
        load_measured=felt,
        load_predicted=loads,
        motor_angle=m,
        motor_velocity=dm,
        motor_command=dm,
        joint_angle=q,
        tension=50 * np.concatenate([np.maximum(loads, 0), np.maximum(-loads, 0)], axis=-1),
        joint_anchor=origin,
        joint_axis=np.stack([rotation[..., i, :, :] @ joint_axis(i) for i in range(9)], axis=-2),
    )


def only(index, values, count=9):
    """The values for one joint or motor, nought for the others."""
    return values[..., None] * (np.arange(count) == index)


def fading(values, seconds):
    """Exponentially fading mean over rows, by its definition."""
    keep, out = np.exp(-PERIOD / seconds), [values[:, 0]]
    for row in values.T[1:]:
        out.append(keep * out[-1] + (1 - keep) * row)
    return np.stack(out, axis=1)


def held_back(q, dq, *_):
    inside = (q[..., 3] > 0.14) & (q[..., 3] < 0.26)
    return only(3, -0.03 * np.sign(dq[..., 3]) * inside)


SWAY = np.linspace(0, 1, 9)[:, None] * np.array([0, 1e-3, 0])
CASES = {
    "nothing": {},
    "force": {"turn": lambda q, *_: only(3, 0.02 * (q[..., 3] > 0.21))},
    "sticks": {"turn": held_back},
    "ripple": {"load": lambda q, dq, m, *_: only(2, 0.012 * np.sin(6 * m[..., 2]), 10)},
    "sway": {"shift": lambda *s: np.sin(2 * np.pi * 0.7 * s[-1])[..., None, None] * SWAY},
    "drift": {"turn": lambda *s: only(5, 0.02 * s[-1] / 400)},
    "jump": {"turn": lambda *s: only(6, 0.015 * (s[-1] > 213))},
    "play": {"turn": lambda q, dq, *_: only(4, -0.01 * np.tanh(dq[..., 4] / 0.02))},
    "creep": {"turn": lambda *s: only(2, 0.5 * fading(s[3][..., 2], 10.0))},
    "delay": {"turn": lambda q, dq, *_: -0.02 * dq},
}


@cache
def case(name):
    return made(1, **CASES[name])


@cache
def found(name):
    return analyse(case(name), np.random.default_rng(0), permutations=99)


def first(name, kind):
    return next(d for d in found(name).depends_on if (d.kind == "load") == (kind == "load"))


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
    np.testing.assert_allclose(size.by_marker_mm, [0] * 8 + [5], atol=1e-9)
    assert size.mean_mm == pytest.approx(5 * 1600 / (9 * 1600 - 1))
    np.testing.assert_allclose(size.mean_residual_mm[8], [3, 4, 0], atol=1e-9)
    np.testing.assert_allclose(load.moving_percent, only(1, np.array(3.0), 10), atol=1e-9)
    np.testing.assert_allclose(load.resting_percent, only(1, np.array(1.0), 10), atol=1e-9)


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
    assert found("nothing").marker.mean_mm == pytest.approx(
        found("nothing").noise.floor_mm, rel=0.05
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


# On what, and where


def test_a_force_beyond_a_joint_angle():
    d = first("force", "markers")
    assert (d.kind, d.index, d.feature.name, d.shape.kind) == (
        "joint",
        3,
        "joint 4's angle",
        "step",
    )
    assert d.shape.edges[0] == pytest.approx(0.21, abs=0.01)
    assert d.share_above_noise > 0.75
    assert "joint 4" in found("force").where[0].text
    assert "above 0.21 rad (12°)" in describe(found("force"))


def test_a_joint_that_sticks_in_a_window():
    d = first("sticks", "markers")
    assert (d.kind, d.index) == ("joint", 3)
    assert d.feature.name == "joint 4's angle, against its motion" and d.shape.kind == "window"
    np.testing.assert_allclose(d.shape.edges, [0.14, 0.26], atol=0.015)
    assert "between 0.14 and 0.26 rad (8° and 15°)" in describe(found("sticks"))


def test_a_ripple_in_one_motors_load():
    d = first("ripple", "load")
    assert (d.index, d.feature.name, d.shape.per_turn) == (2, "motor 3's angle", 6)
    assert "6 times per turn (every 60°)" in describe(found("ripple"))
    assert [x for x in found("ripple").depends_on if x.kind != "load"] == []


def test_a_sway_in_time():
    change = found("sway").marker_change
    assert change.swings and change.line.frequency_hz == pytest.approx(0.7, abs=0.01)
    swing = np.sum(SWAY**2) / 2
    assert change.line.share == pytest.approx(swing / (swing + 27 * NOISE**2), rel=0.1)
    assert "swings at 0.70 Hz" in describe(found("sway"))
    assert not found("nothing").marker_change.swings and not found("delay").marker_change.swings


def test_a_slow_drift():
    change = found("drift").marker_change
    assert change.steady == "drift"
    at = change.drift.strongest
    assert change.channels[at] == "the rotation at joint 6"
    rate, half = (
        change.in_unit[at] * v[at] for v in (change.drift.per_minute, change.drift.interval)
    )
    assert abs(rate - np.degrees(0.02 / 400 * 60)) < half < 0.2 * rate
    assert "drifts, most in the rotation at joint 6 (+0.17° ±" in describe(found("drift"))


def test_a_jump_at_one_time():
    change = found("jump").marker_change
    assert change.steady == "jump" and change.jump.time_s == pytest.approx(213, abs=1.0)
    np.testing.assert_allclose(
        change.in_unit * change.jump.size, only(6, np.array(np.degrees(0.015))), atol=0.1
    )
    assert "jumps at 213 s of session_01, most in the rotation at joint 7" in describe(
        found("jump")
    )


def test_play_follows_the_direction_of_motion():
    d = first("play", "markers")
    assert (d.kind, d.index) == ("joint", 4)
    assert d.feature.name.startswith("joint 5's") and d.feature.kind in ("velocity", "direction")


def test_creep_follows_the_past():
    d = first("creep", "markers")
    assert (d.kind, d.index, d.feature.kind) == ("joint", 2, "past")
    assert "in the last 10 s" in d.feature.name and "creep" in describe(found("creep"))


def test_a_delay_follows_all_velocities():
    assert first("delay", "markers").feature.name == "all joints' velocities"


def test_what_moves_a_marker_agrees_with_finite_differences():
    q = np.random.default_rng(3).uniform(-0.4, 0.4, (1, 8, 9))
    origin, rotation = link_frames(q)
    axis = np.stack([rotation[..., i, :, :] @ joint_axis(i) for i in range(9)], axis=-2)
    c = Comparison(
        ("s",),
        np.arange(8.0)[None],
        *[markers(q)] * 2,
        joint_anchor=origin,
        joint_axis=axis,
    )
    step = 1e-6 * np.eye(9)
    slopes = [(markers(q + d) - markers(q - d)) / 2e-6 for d in step]
    np.testing.assert_allclose(joint_jacobian(c), np.stack(slopes, axis=-1), atol=1e-9)


def test_the_joint_at_which_an_error_arises():
    wave = 0.02 * np.sin(np.linspace(0, 40, 160))
    c = made(5, turn=lambda q, *_: only(6, np.broadcast_to(wave, q.shape[:2])))
    result = place(c, NOISE)
    assert result.share.argmax() == 6 and result.share[6] > 0.85 * (1 - result.remainder)
    error = result.rotation[..., 6] - wave
    assert np.std(error) < NOISE / 0.05  # less than one marker a link away would give
    assert np.abs(np.delete(result.rotation, 6, axis=-1)).max() < 0.015


def test_the_spectrum_keeps_the_power_and_names_the_swing():
    t = PERIOD * np.arange(640)
    wave = np.sin(2 * np.pi * 0.5 * t)[None, :, None] * np.array([3.0, 4.0])
    s = spectrum(wave, PERIOD)
    assert s.dominant_hz == pytest.approx(0.5, abs=0.04) and s.dominant_share > 0.95
    assert np.sum(s.power) * s.frequency[1] == pytest.approx(25 / 2, rel=0.05)
    memory = spectrum(
        fading(np.random.default_rng(0).normal(size=(20, 400)), 3.0)[..., None], PERIOD
    )
    assert memory.autocorrelation_s == pytest.approx(3.0, rel=0.25)


def test_drift_intervals_hold_on_wandering_noise():
    rng, time = np.random.default_rng(2), PERIOD * np.arange(1120).reshape(7, 160)
    seen = [
        drift(fading(rng.normal(size=(1, 1120)), 1.5).reshape(7, 160, 1), time, ("s",) * 7).seen
        for _ in range(40)
    ]
    assert sum(seen) <= 3  # one in 100 is expected


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
    before = marker_size(case("delay")).mean_mm
    after = marker_size(learned.corrected(case("delay"))).mean_mm
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
    with pytest.raises(SerpentError, match="holds no learned correction"):
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
        "residual_by_feature",
        "error_by_place_and_time",
        "residual_spectrum",
    ]
    lines = drawn[0].drawing.axes[0].get_lines()
    np.testing.assert_allclose(lines[0].get_ydata(), marker_size(nominal).by_marker_mm)
    assert [line.get_label() for line in lines] == ["nominal", "calibrated"]
    for figure in drawn:
        figure.drawing.savefig(io.BytesIO(), format="png", dpi=40)
    assert "joint 4's angle" in drawn[3].caption
