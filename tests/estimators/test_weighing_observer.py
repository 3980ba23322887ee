"""Test that the payload is identified from the loads, also after it changes."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.sim_to_real.conditions import ArmChange, Condition, changing, recovery, session_of
from experiments.sim_to_real.conditions import followed as errors_of
from serpent_twin.arm.geometry import joint_from_motor
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects.base_tilt import BaseTilt
from serpent_twin.effects.payload import Payload
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import find
from serpent_twin.estimators.weighing_observer import followed
from serpent_twin.live.estimate import estimate
from serpent_twin.live.options import Estimate
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import cut
from serpent_twin.sim import twin_model
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import DrivenArms
from serpent_twin.sim.twin_model import TwinModel

TWIN = TwinModel(
    replace(NOMINAL, strand_stiffness=4e3, strand_slack=6e-4, marker_noise=2e-4, load_noise=2e-3)
)
ARM = replace(TWIN, parameters=replace(TWIN.parameters, strand_stiffness=4.05e3))
"""What is traced is never quite the arm"""
USUAL = Condition("usual", rows=240)


def windows_of(arm, seed):
    return cut([session_of(arm, USUAL, seed)], 4, 40)


def fitted(name, **settings):
    made = find(name)(4, twin=twin_model.to_dict(TWIN), **settings)
    made.fit(windows_of(ARM, 1), windows_of(ARM, 2), np.random.default_rng(0))
    return made


@pytest.fixture(scope="module")
def weighing():
    return fitted("weighing_observer")


@pytest.fixture(scope="module")
def observer():
    return fitted("observer")


def error_mm(readout, arm, seed=3):
    test = windows_of(arm, seed).sessions[0]
    told = readout.follow(test)
    return score(told.marker, test.marker).mean_mm, told.coverage(test.marker)


@pytest.mark.slow
def test_an_arm_that_holds_more_is_followed_and_one_that_does_not_is_left_alone(weighing, observer):
    heavy = ARM.with_effect(Payload(mass=0.03))
    assert error_mm(weighing, ARM)[0] < 1.25 * error_mm(observer, ARM)[0]
    error, coverage = error_mm(weighing, heavy)
    blind, blind_coverage = error_mm(observer, heavy)
    assert error < 0.5 * blind and error < 1.25 * error_mm(weighing, ARM)[0]
    assert coverage > 0.8 > 0.5 > blind_coverage


def test_what_is_taken_up_on_the_way_is_weighed_without_markers(weighing):
    session = changing(ARM, 600, 200, ArmChange(more_kg=0.03), seed=5)
    live = weighing.live()
    error = np.array(list(errors_of(live, session)))
    grams = 30 * live.amount[0]
    assert grams == pytest.approx(30, abs=4)
    assert 30 * np.sqrt(live.covariance[0, 0]) < 8
    found = recovery(error, 200)
    assert found["recovered_s"] is not None and found["recovered_s"] < 60
    assert found["last_mm"] < 1.25 * found["before_mm"]


@pytest.mark.slow
def test_a_stand_that_leans_is_followed_as_well():
    leaning = ARM.with_effect(BaseTilt(about_y=0.04, about_z=-0.03))
    both = fitted("weighing_observer", unknown=("payload", "base_tilt"))
    live = both.live()
    list(errors_of(live, session_of(leaning, USUAL, 3)))
    names = [(each.kind.__name__, each.name) for each in live.followed]
    assert names == [("Payload", "mass"), ("BaseTilt", "about_y"), ("BaseTilt", "about_z")]
    assert live.amount * [each.typical for each in live.followed] == pytest.approx(
        [0.0, 0.04, -0.03], abs=0.008
    )
    assert error_mm(both, leaning)[0] < 0.25 * error_mm(fitted("observer"), leaning)[0]


def test_nothing_weighs_less_than_nothing(weighing):
    light = replace(TWIN, parameters=TWIN.parameters).with_effect(Payload(mass=0.02))
    other = weighing.with_twin(light)
    live = other.live()
    list(errors_of(live, session_of(ARM, USUAL, 3)))
    (mass,) = live.followed
    assert mass.value == 0.02 and mass.bounds[0] == pytest.approx(-0.02 / 0.03)
    assert -0.02 / 0.03 <= live.amount[0] < -0.4


def test_a_live_run_says_what_it_weighed(weighing, tmp_path, capsys):
    weighing.save(tmp_path / "model")
    twin_model.write(tmp_path / "heavy.json", ARM.with_effect(Payload(mass=0.03)), {})
    config = Estimate(tmp_path / "model", tmp_path / "out", steps=80, record=False)
    found = estimate(replace(config, simulate=tmp_path / "heavy.json"))["weighed"]
    assert found["payload.mass"]["value"] == pytest.approx(0.03, abs=0.006)
    assert 0 < found["payload.mass"]["std"] < 0.01 and found["payload.mass"]["unit"] == "kg"
    assert "By loads at the end: payload.mass 0.0" in capsys.readouterr().out


def test_what_loads_cannot_follow_is_refused():
    with pytest.raises(SerpentError, match=r"hinge_friction cannot be followed .* base_tilt"):
        fitted("weighing_observer", unknown=("hinge_friction",))
    with pytest.raises(SerpentError, match="there is no effect 'weight'"):
        fitted("weighing_observer", unknown=("weight",))


@pytest.mark.parametrize(
    ("effect", "share_left"),
    [(Payload(mass=0.06), 2e-3), (BaseTilt(about_y=0.006, about_z=0.002), 1e-2)],
)
def test_arms_that_vary_are_those_that_were_built_so(effect, share_left):
    """Half of what a neighbour has more, set while it runs, against an arm built with half of it; gravity's
    own length shows in a tilt of larger angles.
    """
    kind = type(effect)
    name = {Payload: "payload", BaseTilt: "base_tilt"}[kind]
    none = TWIN.with_effect(kind(**{"mass": 1e-9} if kind is Payload else {"about_y": 1e-9}))
    half = [getattr(effect, each.name) / 2 for each in followed(TWIN, [name])]
    built = none
    for each, more in zip(followed(none, [name]), half, strict=True):
        built = each.added(built, more)
    angle, still = np.full((2, 10), 0.4), np.zeros((2, 10))

    def settled(designs, share):
        arms = DrivenArms(designs, [each.spec(motors=False).compile() for each in designs])
        arms.place(MotorTrajectory(np.zeros(2), angle, still), joint_from_motor(angle[:, :9]))
        if share is not None:
            arms.variation().set(share)
        arms.move(MotorTrajectory(np.full(2, 2.0), angle, still), 2000)
        return arms.read()

    varied = settled([none, none.with_effect(effect)], np.array([[0.5], [0.5]]))
    expected = settled([built, built], None)
    off = abs(varied.marker - expected.marker).max()
    moved = abs(settled([none, none], None).marker - expected.marker).max()
    assert off < share_left * moved
    np.testing.assert_allclose(varied.load, expected.load, atol=1e-4)
