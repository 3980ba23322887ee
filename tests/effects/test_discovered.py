"""A composed law against its formula, the virtual work of its forces, and every way of running."""

from dataclasses import replace

import numpy as np
import pytest
from moments import moment
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from serpent_twin.arm.geometry import ARM, link_frames, markers, motor_from_joint
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.effects import KNOWN
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import HANDLES, Law, parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.errors import SerpentError
from serpent_twin.sim import twin_model
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.twin import Twin, replay_motors
from serpent_twin.sim.twin_model import TwinModel

COM = np.array([[length / 2, 0.0, 0.0] for length in ARM.link_length])


def acted(at, rows=3, seed=1, **numbers):
    """A moment before and after a law."""
    before, after = moment(rows, seed), moment(rows, seed)
    effect = Discovered(at=at, **numbers)
    effect.act(after, None)
    return before, after


@pytest.mark.parametrize("shape", sorted(SHAPES))
@pytest.mark.parametrize("reading", ["joint_angle of joint4", "motor_velocity of motor2"])
def test_a_law_is_read_back_as_it_is_written(shape, reading):
    law = parse(f"joint_torque of joint3: {shape} {reading}")
    assert parse(str(law)) == law
    assert f"{law.reading} of {law.where}" == reading
    assert str(parse("slack of cable2_plus: constant")) == str(Law("slack", "cable2_plus"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("joint_torque", "states no law"),
        ("torque of joint1: constant", "no quantity that a law changes named 'torque'.*slack"),
        ("slack of cable1_plus: cubic", "no law named 'cubic'.*periodic"),
        ("slack of cable1_plus: linear heat of motor1", "no reading that a law follows.*tension"),
    ],
)
def test_a_law_that_is_not_known_is_refused_with_what_there_is(text, says):
    with pytest.raises(SerpentError, match=says):
        Discovered(1.0, at=text)


def test_a_place_that_the_arm_lacks_is_refused():
    with pytest.raises(SerpentError, match=r"of a joint, and 'joint12' is none.*joint9"):
        acted("joint_torque of joint12: constant", size=0.1)


@pytest.mark.parametrize(
    ("shape", "first", "second", "expected"),
    [
        ("linear", 0.0, 0.0, lambda q: q),
        ("beyond", 0.05, 0.0, lambda q: np.where(q > 0.05, q - 0.05, 0.0)),
        ("below", 0.05, 0.0, lambda q: np.where(q < 0.05, q - 0.05, 0.0)),
        ("above", 0.05, 0.0, lambda q: 1.0 * (q > 0.05)),
        ("under", 0.05, 0.0, lambda q: 1.0 * (q < 0.05)),
        ("within", -0.05, 0.1, lambda q: 1.0 * ((q > -0.05) & (q < 0.05))),
        ("periodic", 3.0, 0.4, lambda q: np.sin(3.0 * q + 0.4)),
    ],
)
def test_a_torque_follows_a_joints_angle_by_its_law(shape, first, second, expected):
    at = f"joint_torque of joint3: {shape} joint_angle of joint5"
    before, after = acted(at, 200, size=0.2, first=first, second=second)
    q = before.joint_angle[:, 4]
    clear = np.all([np.abs(q - edge) > 2e-3 for edge in (first, first + second)], axis=0)
    assert_allclose(after.joint_torque[clear, 2], 0.2 * expected(q)[clear], atol=1e-12)
    others = np.delete(after.joint_torque, 2, axis=1)
    assert not others.any()


def test_beyond_the_readings_of_its_logs_a_law_stays_as_at_their_ends():
    at = "joint_torque of joint3: linear joint_angle of joint5"
    before, after = acted(at, 200, size=1.0, least=-0.05, most=0.08)
    q = before.joint_angle[:, 4]
    assert q.min() < -0.05 and q.max() > 0.08
    assert_allclose(after.joint_torque[:, 2], np.clip(q, -0.05, 0.08))


@pytest.mark.parametrize("own", [False, True])
def test_a_force_works_as_much_as_its_point_moves(own):
    """Against the finite difference of the force's potential, with the force held in the base frame."""
    at = f"force{'_in_body' if own else ''} of link7: constant"
    before, after = acted(at, 1, size=0.3, size_y=-0.5, size_z=0.7)
    q, vector = before.joint_angle[0], np.array([0.3, -0.5, 0.7])
    force = link_frames(q)[1][6] @ vector if own else vector

    def work(q):
        origin, rotation = link_frames(q)
        return force @ (origin[6] + rotation[6] @ COM[6])

    slopes = [(work(q + h) - work(q - h)) / 2e-6 for h in 1e-6 * np.eye(9)]
    assert_allclose(after.joint_torque[0], slopes, atol=1e-8)


def test_a_spring_pulls_as_its_energy_falls():
    """K |p - x|² / 2, with the force k p where x is the base's origin."""
    k, point = 3.0, np.array([0.2, -0.1, 0.3])
    sizes = dict(zip(("size", "size_y", "size_z"), k * point, strict=True))
    before, after = acted("spring of link6: constant", 1, stiffness=k, **sizes)
    q = before.joint_angle[0]

    def energy(q):
        origin, rotation = link_frames(q)
        return k / 2 * np.sum((point - origin[5] - rotation[5] @ COM[5]) ** 2)

    slopes = [-(energy(q + h) - energy(q - h)) / 2e-6 for h in 1e-6 * np.eye(9)]
    assert_allclose(after.joint_torque[0], slopes, atol=1e-8)


def test_cameras_that_are_late_see_markers_where_they_were():
    late = 1e-4
    q, speed = np.random.default_rng(5).normal(0, [[[0.3]], [[0.8]]], (2, 2, 9))
    now = moment(2, joint_angle=q, joint_velocity=speed)
    Discovered(late, at="camera_delay of base: constant").act(now, None)
    was = markers(q - late * speed) - markers(q)
    assert np.abs(was).max() > 3e-5
    assert_allclose(now.marker_shift, was, atol=3e-8)


def test_what_has_turned_moves_the_markers_of_its_link_and_beyond():
    turn = 1e-4 * np.array([1.0, -2.0, 0.5])
    sizes = dict(zip(("size", "size_y", "size_z"), turn, strict=True))
    before, link = acted("link_turn of link4: constant", 1, **sizes)
    cameras = acted("camera_turn of base: constant", 1, **sizes)[1]
    origin, rotation = (each[0] for each in link_frames(before.joint_angle))
    marker = markers(before.joint_angle)[0]
    about = Rotation.from_rotvec(rotation[3] @ turn)
    reach = marker[3:] - origin[3]
    assert not link.marker_shift[0, :3].any()
    assert_allclose(link.marker_shift[0, 3:], about.apply(reach) - reach, atol=3e-8)
    all_ = Rotation.from_rotvec(turn).apply(marker) - marker
    assert_allclose(cameras.marker_shift[0], all_, atol=3e-8)


def test_an_accelerated_base_is_gravity_the_other_way():
    before, after = acted("acceleration of base: constant", 1, size=-9.81)
    q = before.joint_angle[0]

    def energy(q):
        origin, rotation = link_frames(q)
        com = origin + (rotation @ COM[..., None])[..., 0]
        return -9.81 * np.array(ARM.link_mass) @ com[:, 0]

    slopes = [-(energy(q + h) - energy(q - h)) / 2e-6 for h in 1e-6 * np.eye(9)]
    assert_allclose(after.joint_torque[0], slopes, atol=1e-7)


@pytest.mark.parametrize("handle", ["joint_friction", "gear_friction"])
def test_friction_is_never_less_than_none(handle):
    place = {"joint_friction": "joint2", "gear_friction": "motor2"}[handle]
    before, after = acted(f"{handle} of {place}: constant", size=-1.0)
    assert (getattr(after, handle) >= 0).all()
    assert_allclose(
        np.delete(getattr(after, handle), 1, 1), np.delete(getattr(before, handle), 1, 1)
    )


MOTION = 0.2 * np.sin(np.linspace(0, 6, 40))[:, None] * np.ones(10)


def replayed(*effects):
    return replay_motors(0.25 * np.arange(40), MOTION, TwinModel(effects=effects))


def test_sensors_that_err_change_what_is_read_and_nothing_else():
    plain = replayed()
    load = replayed(Discovered(0.02, at="load_shift of motor3_load: constant"))
    assert_allclose(load.load[:, 2], plain.load[:, 2] + 0.02, atol=1e-12)
    assert_allclose(load.marker, plain.marker)
    less = replayed(Discovered(-0.3, at="load_scale of motor3_load: constant"))
    assert_allclose(less.load, plain.load * np.where(np.arange(10) == 2, 0.7, 1.0), atol=1e-12)
    moved = replayed(
        Discovered(1e-3, 2e-3, at="camera_shift of base: above time of session", first=5.0)
    )
    late = 0.25 * np.arange(40) > 5.1
    assert_allclose(
        (moved.marker - plain.marker)[late], np.tile([1e-3, 2e-3, 0.0], (late.sum(), 9, 1))
    )
    assert_allclose(moved.joint_angle, plain.joint_angle)
    knocked = replayed(Discovered(0.0, 3e-3, at="marker_shift of marker4: constant"))
    shift = knocked.marker - plain.marker
    assert_allclose(np.linalg.norm(shift[:, 3], axis=1), 3e-3)
    assert not np.delete(shift, 3, axis=1).any()


def test_a_pose_that_shifted_cameras_saw_begins_without_the_shift():
    true = 0.1 * np.arange(9)[None] - 0.4
    shift = np.array([2e-3, -3e-3, 4e-3])
    seen = joints_from_markers(markers(true) + shift, true)
    law = Discovered(*shift, at="camera_shift of base: constant")
    held = np.append(motor_from_joint(true), 0.0) * np.ones((1, 3, 1))
    motors = MotorTrajectory(0.25 * np.arange(3)[None], held, 0 * held)
    arm = [TwinModel(effects=(law,))]
    blind = impose(arm, PrescribedMotion(motors, seen))
    known = impose(arm, PrescribedMotion(motors, seen, seen=markers(true) + shift))
    assert_allclose(known.joint_angle[0, 0, 0], true[0], atol=5e-4)
    assert_allclose(known.marker[0, 0, 0], (markers(true) + shift)[0], atol=2e-4)
    assert np.abs(blind.joint_angle[0, 0, 0] - true[0]).max() > 0.03


def test_a_simulated_arm_reports_what_a_law_makes_of_its_sensors():
    law = Discovered(0.05, at="load_shift of motor3_load: constant")
    scale = Discovered(-0.5, at="load_scale of motor4_load: constant")
    shift = Discovered(1e-3, at="camera_shift of base: constant")
    plain, other = (Twin(TwinModel(effects=each)) for each in ((), (law, scale, shift)))
    for twin in (plain, other):
        twin.advance(0.3, 0.25)
    told, plainly = (each.reported[0, 2] / ARM.servo.stall_torque for each in (other, plain))
    torque = plainly * np.where(np.arange(10) == 3, 0.5, 1.0) + 0.05 * (np.arange(10) == 2)
    assert_allclose(told, torque, atol=1e-9)
    assert_allclose(other.markers - plain.markers, np.tile([1e-3, 0, 0], (1, 9, 1)), atol=1e-9)


def test_a_law_is_stored_in_twin_json_and_restored():
    effect = Discovered(0.02, at="joint_torque of joint5: above joint_angle of joint5", first=0.1)
    twin = TwinModel(effects=(effect, KNOWN["payload"](0.03)))
    assert twin_model.from_dict(twin_model.to_dict(twin)) == twin
    assert "discovered@joint_torque of joint5" in twin.xml()
    stored = twin_model.to_dict(twin)
    del stored["effects"][0]["stiffness"]  # as before laws had springs
    assert twin_model.from_dict(stored) == twin
    stored["effects"][0]["at"] = "joint_torque of joint5: by_magic joint_angle of joint5"
    with pytest.raises(SerpentError, match="no law named 'by_magic'"):
        twin_model.from_dict(stored)


def test_every_quantity_has_places_in_words():
    assert all(each.words and each.unit for each in HANDLES.values())


def test_no_size_is_absence():
    assert replace(Discovered(at="slack of cable1_plus: constant"), size=0.0).absent
