"""Test that the dependence and place put into a made-up residual are found."""

import numpy as np
import pytest
from residual_cases import NOISE, PERIOD, SWAY, fading, found, made, only

from serpent_twin.arm.geometry import joint_axis, link_frames, markers
from serpent_twin.residual import Comparison, attribute_to_joints, describe
from serpent_twin.residual.drift import drift
from serpent_twin.residual.joint_attribution import joint_jacobian
from serpent_twin.residual.spectrum import autocorrelation_rows, spectrum


def first(name, kind):
    return next(d for d in found(name).depends_on if (d.kind == "load") == (kind == "load"))


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
    assert "joint 4" in found("force").where[0]
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


def test_what_moves_between_rows():
    assert found("shaken").noise.mean_jitter == pytest.approx(found("shaken").marker.mean, rel=0.2)
    assert "vibrates, chatters, or sticks and slips" in describe(found("shaken"))
    assert not any("vibrates" in describe(found(name)) for name in ("nothing", "delay", "play"))


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
    result = attribute_to_joints(c, NOISE)
    assert result.share.argmax() == 6 and result.share[6] > 0.85 * result.share.sum()
    error = result.rotation[..., 6] - wave
    assert np.std(error) < NOISE / 0.05  # less than one marker a link away would give
    assert np.abs(np.delete(result.rotation, 6, axis=-1)).max() < 0.015


def test_the_spectrum_keeps_the_power_and_names_the_swing():
    t = PERIOD * np.arange(640)
    wave = np.sin(2 * np.pi * 0.5 * t)[None, :, None] * np.array([3.0, 4.0])
    frequency, power = spectrum(wave, PERIOD)
    top = int(np.argmax(power))
    assert frequency[top] == pytest.approx(0.5, abs=0.04)
    assert power[top - 1 : top + 2].sum() > 0.95 * power.sum()
    assert np.sum(power) * frequency[1] == pytest.approx(25 / 2, rel=0.05)


def test_the_correlation_time_is_that_of_a_fading_memory():
    wander = fading(np.random.default_rng(0).normal(size=(20, 400)), 3.0)[..., None]
    assert PERIOD * autocorrelation_rows(wander) == pytest.approx(3.0, rel=0.25)


def test_drift_intervals_hold_on_wandering_noise():
    rng, time = np.random.default_rng(2), PERIOD * np.arange(1120).reshape(7, 160)
    seen = [
        drift(fading(rng.normal(size=(1, 1120)), 1.5).reshape(7, 160, 1), time, ("s",) * 7).seen
        for _ in range(40)
    ]
    assert sum(seen) <= 3  # one in 100 is expected
