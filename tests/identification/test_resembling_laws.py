"""Laws that resemble a fitted one: on other bodies, by other readings."""

from types import SimpleNamespace

import numpy as np
from made_residual import M, Made

from serpent_twin.effects.discovered import Discovered
from serpent_twin.identification.discovery import resembling
from serpent_twin.identification.discovery.candidates import by_other_readings, candidate_of
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
    others = resembling(candidate, fit)
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
    others = [each.law.where for each in by_other_readings(found[0], found)]
    assert {found[0].law.where, *others} == {"joint1", "motor3"}
    assert not by_other_readings(Made(AT_JOINT).found()[0], Made(AT_JOINT).found())


def test_a_law_at_a_joint_is_tried_at_no_other():
    made = Made(AT_JOINT)
    best = made.found()[0]
    candidate = candidate_of(best, made.readings, best.law.units(), ["joint1", "joint2"])
    fit = SimpleNamespace(
        point=ParameterVector(np.zeros(M)).having(candidate.name, candidate.variants[0])
    )
    assert not resembling(candidate, fit)
