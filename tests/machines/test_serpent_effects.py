"""Effects of the serpent arm as model/machine.toml has it, beside the arm's own engine."""

from dataclasses import replace

import numpy as np
import pytest
from serpent_twins import serpent

from experiments.arm_catalogue import CATALOGUE
from serpent_twin.arm.mjcf import MODEL
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import parse
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.candidates import candidates
from serpent_twin.sim.arm_moment import Moment

STARTS, ROWS = (0, 1800), 24
WORLD_FROM_BASE = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Rotation from the base to the world, as in serpent.xml: the arm hangs along the base's +x"""
IN_WORLD = ("force", "spring", "acceleration")
"""What laws change along the base's axes on the arm, and along the world's on a model"""
LAWS = {
    "joint_torque of joint5: linear joint_angle of joint3": (0.2,),
    "joint_friction of joint3: constant": (0.02,),
    "motor_torque of motor3: constant": (0.05,),
    "gear_friction of motor3: linear horn_torque of motor3": (0.2,),
    "winch_angle of motor3: periodic motor_angle of motor3": (0.05,),
    "winch_angle of motor3: play motor_angle of motor3": (1.0,),
    "slack of cable3_plus: linear time of session": (2e-5,),
    "force of link5: linear motor_angle of motor5": (0.2, 0.1, 0.3),
    "force_in_body of link5: constant": (0.2, 0.1, 0.3),
    "spring of link7: constant": (0.1, 0.2, 0.1, 2.0),
    "acceleration of base: constant": (0.3, 0.5, 0.2),
    "marker_shift of marker4: linear joint_angle of joint4": (0.01, 0.02, 0.03),
    "camera_shift of base: linear time of session": (1e-5, 2e-5, 3e-5),
    "camera_turn of base: constant": (0.01, 0.02, 0.03),
    "camera_delay of base: constant": (0.02,),
    "link_turn of link4: constant": (0.01, 0.02, 0.03),
    "load_shift of motor4_load: above tension of cable4_plus": (0.02,),
    "load_shift of motor3_load: linear horn_torque of motor3": (0.3,),
    "load_scale of motor4_load: constant": (0.1,),
}
"""A law for each quantity, with its sizes"""


@pytest.fixture(scope="module")
def arm():
    """Pieces of a log, and what the nominal twin does there by either engine."""
    of = serpent(STARTS, ROWS)
    return of, of.as_model(), of.by_itself()


def assert_alike(arm, effect, own):
    """Compare by both engines what an effect changes of the markers, and of the loads of motors that turn."""
    of, *without = arm
    did = of.as_model(effect), of.by_itself(own)
    changes = [each - base for each, base in zip(did, without, strict=True)]
    limits = (slice(27), 1.0, 0.05, 0.99), (slice(27, 37), of.turns, 0.07, 0.95)
    for channels, counts, apart, least in limits:
        found, own = (np.ravel((each[..., channels] * counts)[:, 2:]) for each in changes)
        sizes = np.linalg.norm(found), np.linalg.norm(own)
        assert sizes == pytest.approx((sizes[1],) * 2, rel=apart, abs=1e-9)
        assert found @ own >= least * np.prod(sizes) - 1e-18


def test_candidates_are_those_of_the_arms_catalogue(arm):
    of, *_ = arm
    rig = open_machine(MODEL / "machine.toml")
    assert candidates(rig.described, of.pieces.whole).keys() == CATALOGUE.keys()


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_acts_alike(arm, name):
    effect = CATALOGUE[name].variants()[0]
    assert_alike(arm, effect, effect)


def test_forces_at_two_links_act_side_by_side_as_alone(arm):
    """Though each adds a site to another link, so that markers have other numbers."""
    of, *_ = arm
    two = [CATALOGUE["constant_force"](0.2, place=place) for place in (0.5, 0.25)]
    both = of.as_models(*[(each,) for each in two])
    assert both[1] == pytest.approx(of.as_model(two[1]), abs=1e-9)


@pytest.mark.parametrize("name", ["cable_creep", "cable_friction", "cable_stiffening"])
def test_an_effect_on_one_cable_acts_alike(arm, name):
    effect = replace(CATALOGUE[name].variants()[0], strand=22.0)
    assert_alike(arm, effect, effect)


@pytest.mark.parametrize("at", LAWS)
def test_a_law_acts_alike(arm, at):
    sizes = dict(zip(("size", "size_y", "size_z", "stiffness"), LAWS[at], strict=False))
    turned = dict(sizes)
    if parse(at).handle in IN_WORLD:
        turned |= dict(
            zip(("size", "size_y", "size_z"), WORLD_FROM_BASE @ LAWS[at][:3], strict=True)
        )
    form = {
        "above": {"first": 1.0},
        "play": {"first": 0.05},
        "periodic": {"first": 3.0},
        "lag": {"first": 0.3},
    }
    more = form.get(parse(at).shape, {})
    assert_alike(arm, Discovered(at=at, **turned, **more), Discovered(at=at, **sizes, **more))


def test_there_is_a_law_for_each_quantity():
    assert {parse(at).handle for at in LAWS} == set(Moment.changed)
