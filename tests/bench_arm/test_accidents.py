"""Accidents of the independent arm against their laws, and against arms without them."""

import numpy as np
import pytest
from bench_by_hand import machine

from bench_arm import NONE, TYPICAL, BenchArm, Effects, SessionSpec, inject, simulate
from bench_arm.accidents import (
    ACCIDENTS,
    CORD,
    Accident,
    cord,
    draw,
    loads,
    relax,
    relaxing_torque,
    shifts,
    strand_slack,
)
from bench_arm.servo import ServoBatch
from bench_arm.session import RATE, SETTLE

SILENT = BenchArm(load_noise=0.0, marker_noise=0.0, marker_loss=0.0)
STEPS = 24
STRAIGHT = (
    np.tile(0.06 * np.arange(1.0, 10)[:, None] * [1, 0, 0], (2, 1, 1)),
    np.tile(0.06 * np.arange(0.5, 9)[:, None] * [1, 0, 0], (2, 1, 1)),
    np.tile(np.eye(3), (2, 9, 1, 1)),
)
"""Markers, origins and rotations of the links of two straight arms"""


def log(*accidents):
    return simulate([SessionSpec(SILENT, Effects(accidents=accidents), 1, 0)], STEPS, 40)[0]


@pytest.fixture(scope="module")
def plain():
    return simulate([SessionSpec(SILENT, NONE, 1, 0)], STEPS, 40)[0]


@pytest.mark.parametrize("kind", ACCIDENTS)
def test_an_accident_of_no_strength_changes_not_one_bit(kind, plain):
    found = log(draw(kind, 0.0, np.random.default_rng(1), 1.0))
    for name, column in plain.items():
        assert np.array_equal(found[name], column, equal_nan=True), name


@pytest.mark.parametrize("kind", ACCIDENTS)
def test_its_strength_and_part_are_drawn_into_the_truth(kind):
    effects = inject(kind, 2 * TYPICAL[kind], np.random.default_rng(4), seconds=100.0)
    (happened,) = effects.accidents
    assert effects.strength(kind) == happened.strength == 2 * TYPICAL[kind]
    assert 20 <= happened.instant <= (100 if kind == "dying_load" else 55)
    assert np.linalg.norm(happened.direction) == pytest.approx(1.0)


def test_a_knocked_marker_alone_moves_with_its_link(plain):
    found = log(Accident("knocked_marker", 4e-3, 3, (0.0, 0.6, 0.8), instant=3.0))
    moved = found["marker"] - plain["marker"]
    ran = (np.arange(STEPS) + SETTLE) / RATE
    assert np.linalg.norm(moved[ran > 3.3, 2], axis=1) == pytest.approx(4e-3)
    assert not moved[ran < 3.0].any()
    assert not np.delete(moved, 2, axis=1).any()


def test_the_play_of_one_gear_holds_its_winch_back():
    """The winch lags by half the play, to either side."""
    loose = Effects(accidents=(Accident("loose_gear", 0.2, 3),))
    servo = ServoBatch([SILENT], [loose])
    for command, side in ((1.0, -0.1), (-1.0, 0.1)):
        for _ in range(2000):
            servo.step(np.full((1, 10), command), np.zeros((1, 10)), 1e-3)
        behind = servo.winch - servo.angle[:, :9]
        assert behind[0] == pytest.approx(np.where(np.arange(9) == 2, side, 0.0), abs=1e-12)


def test_moved_cameras_see_all_markers_moved_alike():
    happened = (Accident("moved_cameras", 3e-3, direction=(0.0, 0.0, 1.0), instant=5.0),)
    seen = shifts([happened, ()], np.array([9.0, 9.0]), *STRAIGHT)
    assert seen[0] == pytest.approx(np.tile([0, 0, 3e-3], (9, 1)))
    assert not seen[1].any()


def test_what_turns_moves_markers_about_its_own_origin():
    """Cameras about the base, a link with all beyond about its joint, and no other."""
    clock = np.array([9.0, 9.0])
    upward = (0.0, 0.0, 1.0)
    cameras = (Accident("turned_cameras", 0.1, 1, upward, instant=5.0),)
    link = (Accident("turned_link", 0.1, 4, upward, instant=5.0),)
    marker, origin, _ = STRAIGHT
    seen = marker + shifts([cameras, link], clock, *STRAIGHT)
    turned = np.array([np.cos(0.1), np.sin(0.1), 0.0])
    assert seen[0] == pytest.approx(marker[0, :, :1] * turned)
    assert seen[1, :3] == pytest.approx(marker[1, :3])
    assert seen[1, 3:] - origin[1, 3] == pytest.approx(
        (marker - origin[:, 3:4])[1, 3:, :1] * turned
    )


def test_a_cord_pulls_to_its_end_by_its_stretch_and_never_pushes():
    each = Accident("elastic_cord", 2.0, direction=(0.0, 0.0, 1.0))
    end = np.array([0.25, 0.0, 0.1])
    assert cord(each, end - [0.2, 0.0, 0.0]) == pytest.approx([2.0 * (0.2 - CORD), 0.0, 0.0])
    assert not cord(each, end - [0.0, 0.5 * CORD, 0.0]).any()


def test_a_fading_sensor_shows_a_share_less_and_a_dying_one_ever_less():
    load, clock = np.full((1, 10), 0.2), np.array([30.0])
    assert loads([(Accident("fading_load", 0.25, 4),)], load, clock)[0, 3] == pytest.approx(0.15)
    dying = (Accident("dying_load", 0.6, 4, instant=60.0),)
    assert loads([dying], load, clock)[0, 3] == pytest.approx(0.14)
    assert loads([dying], load, 4 * clock)[0, 3] == pytest.approx(0.08)


def test_a_strand_gives_way_within_a_moment_at_its_instant():
    happened = (Accident("loose_strand", 6e-4, 11, instant=10.0),)
    slack = [strand_slack([happened], np.array([t]), (1, 2, 9)) for t in (9.9, 10.1, 10.3)]
    assert [each[0, 1, 2] for each in slack] == pytest.approx([0.0, 3e-4, 6e-4])
    assert slack[-1].sum() == pytest.approx(6e-4)


def test_an_encoder_waves_around_where_its_horn_is(plain):
    happened = Accident("encoder_wave", 0.04, 2, rate=3.0, phase=0.5)
    found = log(happened)
    true = plain["motor_position"][0, 1]
    shown = true + 0.04 * np.sin(3.0 * true + 0.5)
    assert found["motor_position"][0, 1] == pytest.approx(shown, abs=4e-3)


def test_a_bumper_pushes_back_in_proportion():
    m = machine(SILENT, Effects(accidents=(Accident("soft_stop", 0.5, 4, begin=0.1),)))
    m.q[:, m.joint[3]] = 0.3
    torque = m._outside(m.chain.pose(m.q))
    assert torque[0, m.joint[3]] == pytest.approx(-0.5 * 0.2)


def test_a_push_swings_by_the_clock_and_works_at_its_link():
    happened = Accident("swinging_push", 0.3, 9, (0.0, 1.0, 0.0), rate=0.5, phase=0.0)
    m = machine(SILENT, Effects(accidents=(happened,)))
    m.clock[:] = 0.5
    torque = m._outside(m.chain.pose(m.q))[0, m.joint]
    lever = 8 * 0.055 + 0.105 / 2
    assert torque[0] == pytest.approx(0.3 * lever, rel=1e-6)


def test_a_slipped_winch_and_a_rubbing_cable_are_the_motors(plain):
    slipped = log(Accident("slipped_winch", 0.06, 3, instant=2.0))
    assert np.nanmax(np.abs(slipped["marker"] - plain["marker"])) > 1e-3
    rubbed = log(Accident("rubbing_cable", 0.2, 3, begin=-3.0, width=6.0))
    more = np.abs(rubbed["motor_load"]) - np.abs(plain["motor_load"])
    assert more[4:, 2].mean() > 0.02
    assert np.abs(more[4:, 7]).mean() < 0.01


def test_a_spring_that_relaxes_gives_way_by_its_time_constant():
    happened = (Accident("relaxing_joint", 0.3, 3, time_constant=0.5),)
    q, rest = np.full((2, 9), 0.2), np.zeros((2, 9))
    torque = [relaxing_torque([happened, ()], q, rest)[0, 2]]
    for _ in range(100):
        relax([happened, ()], q, rest, 0.01)
        torque.append(relaxing_torque([happened, ()], q, rest)[0, 2])
    assert torque == pytest.approx(-0.06 * np.exp(-np.arange(101) * 0.01 / 0.5), rel=1e-9)
    assert not rest[1].any() and not np.delete(rest[0], 2).any()


def test_one_load_is_read_late():
    """Alone, and the more the later it is."""
    found, plain_load = log(Accident("late_load", 0.02, 3))["motor_load"], log()["motor_load"]
    later = log(Accident("late_load", 0.04, 3))["motor_load"]
    assert np.array_equal(np.delete(found, 2, axis=1), np.delete(plain_load, 2, axis=1))
    changed = np.abs(found - plain_load)[:, 2]
    assert changed.max() > 0.005
    assert np.abs(later - plain_load)[:, 2].sum() > 1.3 * changed.sum()
