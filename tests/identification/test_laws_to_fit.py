"""Which laws are fitted, of those that were screened."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from made_residual import Made

from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import Law
from serpent_twin.identification.discovery import in_each_shape
from serpent_twin.identification.discovery.sizes import shows_flat, solved
from serpent_twin.identification.laws_to_fit import laws_to_fit
from serpent_twin.identification.score_test import Score
from serpent_twin.machines.candidate import Candidate

RNG = np.random.default_rng(5)
CHANNELS = 6


def composed(name, changes):
    composed = {"changes": changes}
    return Candidate(name, {}, (np.ones(1),), composed=composed)


def test_of_laws_that_make_one_change_one_is_fitted():
    change, other = RNG.standard_normal((2, 40 * CHANNELS)).astype(np.float32)
    screened = {
        "torque": ("motor_torque", 0.30, change),
        "misread load": ("load_shift", 0.30, -2 * change),
        "nearly": ("load_shift", 0.29, change + 0.3 * other),
        "slack": ("slack", 0.2, other),
    }
    candidates = {name: composed(name, changes) for name, (changes, *_) in screened.items()}
    found = {
        name: Score(name, share, 1.0, np.ones(1), change=each, beyond=each)
        for name, (_, share, each) in screened.items()
    }
    case = SimpleNamespace(candidates=candidates, channels=CHANNELS)
    assert laws_to_fit(case, found, 0.01, 2, 0.8) == ["torque", "nearly", "slack"]
    assert laws_to_fit(case, found, 0.01, 1, 0.8) == ["torque", "nearly"]


def test_of_laws_that_make_one_change_one_that_shows_in_every_direction_comes_first():
    change = RNG.standard_normal(40 * CHANNELS).astype(np.float32)
    turn = replace(composed("turn", "link_turn"), flat=True)
    candidates = {"turn": turn, "shift": composed("shift", "marker_shift")}
    found = {
        name: Score(name, 0.3, 1.0, np.ones(1), change=change, beyond=change) for name in candidates
    }
    case = SimpleNamespace(candidates=candidates, channels=CHANNELS)
    assert laws_to_fit(case, found, 0.01, 2, 0.8) == ["shift"]


def test_a_direction_that_shows_nowhere_is_noticed():
    """A turn about the line through the joint and the one marker."""
    marker = np.array([0.08, 0.025, 0.0])
    moved = np.array([np.cross(axis, marker) for axis in np.eye(3)])
    assert shows_flat(moved @ moved.T) and not shows_flat(np.eye(3))


def test_a_change_is_sized_in_the_directions_that_nothing_else_takes_up():
    axes = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    size, width = np.array([0.4, -0.2, 0.7]), np.array([5.0, 3.0, 1e-6])
    gram = axes @ np.diag(width) @ axes.T
    pull = -gram @ size
    (sized,), (removed,) = solved(pull[None], gram[None], 5.0 * np.eye(3)[None])
    shown = axes[:, :2] @ axes[:, :2].T @ size
    np.testing.assert_allclose(sized, shown, rtol=1e-6)
    assert np.isclose(removed, shown @ gram @ shown)
    taken_up = 1e-6 * np.eye(3)[None]
    assert not solved(pull[None], taken_up, np.eye(3)[None])[1].any()


def test_a_law_is_made_in_each_shape_wherever_it_shows_alike():
    """A wave of which the logs have a part, at a horn; its load, misread, shows the same."""
    at = "joint_torque of joint1: periodic motor_angle of motor2"
    made = Made(Discovered(1.0, at=at, first=2.0, second=0.3), noise=0.2)
    own, strand, _ = made.responses
    strand.change[...] = -3 * own.change
    units = {"size": "N m", "first": "1", "second": "rad", "bound": "rad"}
    made.case.take = lambda pieces, used: made.pieces
    made.case.places = lambda point, some: made
    made.case.units_of_law = lambda law: units
    made.fit.used = (0,)
    step = Law("joint_torque", "joint1", "above", "motor_angle", "motor2")
    found = {each.name: each for each in in_each_shape(made.case, None, made.fit, step)}
    ends = [name.removeprefix("discovered@").split(":") for name in found]
    assert {place for place, _ in ends} == {"joint_torque of joint1", "slack of cable1_plus"}
    assert {f.split()[0] for _, f in ends} >= {"periodic", "above", "within", "linear", "beyond"}
    assert all(f.endswith("motor_angle of motor2") for _, f in ends)
    alike = found["discovered@slack of cable1_plus: periodic motor_angle of motor2"].variants[0]
    first = found["discovered@joint_torque of joint1: periodic motor_angle of motor2"].variants[0]
    assert np.isclose(abs(alike[0] / first[0]), 1 / 3, rtol=1e-3)
    angle = made.readings["motor_angle", "motor2"]
    made.readings["motor_velocity", "motor5"] = RNG.standard_normal(angle.shape)
    noise = Law("joint_torque", "joint1", "above", "motor_velocity", "motor5")
    assert in_each_shape(made.case, None, made.fit, noise) == ()
