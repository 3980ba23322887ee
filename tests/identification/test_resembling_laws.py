"""Laws that resemble a fitted one: on other bodies, by other readings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from made_residual import M, Made

from serpent_twin.effects.discovered import Discovered
from serpent_twin.identification.discovery import elsewhere, of_shape, turned
from serpent_twin.identification.discovery.candidates import candidate_of, resembling_at_first
from serpent_twin.machines.machine import ParameterVector

AT_JOINT = Discovered(0.3, at="joint_torque of joint1: above joint_angle of joint1", first=0.2)


def test_a_law_on_a_body_is_tried_on_others_with_its_fitted_numbers():
    law = Discovered(0.2, -0.1, 0.3, at="force of link3: above joint_angle of joint1", first=0.2)
    made = Made(law)
    best = next(each for each in made.found() if each.law == law.law)
    links = ["link2", "link3", "link4"]
    candidate = candidate_of(best, made.readings, best.law.units(), links)
    assert candidate.places == ("link2", "link4")
    fitted = np.array([0.25, -0.1, 0.3, 0.0, 0.21, 0.0, -1.0, 1.0])
    fit = SimpleNamespace(point=ParameterVector(np.zeros(M)).having(candidate.name, fitted))
    others = elsewhere(candidate, fit)
    at = "force of {}: above joint_angle of joint1"
    assert [each.name for each in others] == [
        f"discovered@{at.format(link)}" for link in ("link2", "link4")
    ]
    assert all((each.variants[0] == fitted).all() for each in others)
    assert others[1].place["place"] == {"kind": "body", "name": "link4"}
    assert sorted(others[1].places) == ["link2", "link3"]


def test_a_law_is_tried_by_other_readings_that_are_nearly_the_same():
    made = Made(AT_JOINT)
    angle = made.readings["joint_angle", "joint1"]
    noise = 0.01 * np.random.default_rng(3).standard_normal(angle.shape)
    made.readings["motor_angle", "motor3"] = angle + noise
    found = made.found()
    others = [each.law.where for each in resembling_at_first(found[0], found)]
    assert {found[0].law.where, *others} == {"joint1", "motor3"}


def test_a_law_is_tried_in_another_shape_that_removes_nearly_as_much():
    made = Made(AT_JOINT)
    step = made.found()[0]
    wave = replace(step, law=replace(step.law, shape="periodic"), gain=0.85 * step.gain)
    weak = replace(wave, gain=0.5 * step.gain)
    assert resembling_at_first(replace(step, shapes={"periodic": wave}), []) == [wave]
    assert resembling_at_first(replace(step, shapes={"periodic": weak}), []) == []


def test_a_law_at_a_joint_is_tried_at_no_other():
    made = Made(AT_JOINT)
    best = made.found()[0]
    candidate = candidate_of(best, made.readings, best.law.units(), ["joint1", "joint2"])
    fit = SimpleNamespace(
        point=ParameterVector(np.zeros(M)).having(candidate.name, candidate.variants[0])
    )
    assert elsewhere(candidate, fit) == []


def test_a_shape_that_is_better_at_one_place_is_tried_at_the_others_that_came_near():
    made = Made(AT_JOINT)
    step = made.found()[0]

    def candidate(place, shape, *others):
        law = replace(step.law, place=place, shape=shape)
        one = candidate_of(replace(step, law=law), made.readings, law.units())
        return replace(one, alternatives=others)

    above, wave = candidate("joint2", "above"), candidate("joint2", "periodic")
    fitted = [candidate("joint2", "beyond", wave, above), candidate("joint3", "beyond")]
    assert of_shape(candidate("joint1", "above").name, fitted) == [above]


def test_what_holds_until_an_instant_is_tried_from_then_on():
    made = Made(Discovered(0.3, at="slack of cable1_plus: above runtime of machine", first=90.0))
    later = made.found()[0]
    until = replace(later, law=replace(later.law, shape="under"), shapes={"above": later})
    assert resembling_at_first(until, []) == [later]
    assert resembling_at_first(later, []) == []


def test_a_step_is_turned_the_other_way_round():
    made = Made(AT_JOINT)
    best = next(each for each in made.found() if each.law == AT_JOINT.law)
    candidate = candidate_of(best, made.readings, best.law.units())
    other = turned(candidate, np.array([0.3, 0, 0, 0, 0.2, 0, -1.0, 1.0]))
    assert other.name == "discovered@joint_torque of joint1: under joint_angle of joint1"
    assert other.composed["law"] == "under"
    assert list(other.variants[0][:5]) == [-0.3, 0, 0, 0, 0.2]
    linear = replace(best, law=replace(best.law, shape="linear"))
    assert turned(candidate_of(linear, made.readings, best.law.units()), other.variants[0]) is None
