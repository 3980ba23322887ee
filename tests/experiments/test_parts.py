"""Test how intervals of a bench arm's parts are judged."""

from dataclasses import asdict

import numpy as np
import pytest

import bench_arm
from experiments.confusion.parts import parts_held, true_parts
from serpent_twin import machines
from serpent_twin.arm.geometry import ARM
from serpent_twin.machines.model.coordinates import coordinates

ARM_AS_BUILT = asdict(bench_arm.draw(np.random.default_rng(3)))
TRUTH = {"parameters": ARM_AS_BUILT}


def entry(quantity, low, high, unit):
    return {"quantity": quantity, f"low_{unit}": low, f"high_{unit}": high}


def test_parts_are_those_of_the_arm():
    true = true_parts(ARM_AS_BUILT)
    ratio = ARM_AS_BUILT["length_ratio"][2]
    assert true["body x of link4"] == pytest.approx(ARM.link_length[2] * ratio)
    across = [1e3 * tilt[1] for tilt in ARM_AS_BUILT["axis_tilt"]]
    assert true["joint axis y of joint1"] == pytest.approx(-across[0])
    assert true["joint axis z of joint2"] == pytest.approx(across[1])
    place = ARM.markers_in_links[8, 1] + ARM_AS_BUILT["marker_offset"][8][1]
    assert true["site y of marker9"] == pytest.approx(1e3 * place)


def test_those_in_their_intervals_are_counted_and_what_has_no_truth_is_not():
    mass = true_parts(ARM_AS_BUILT)["mass of link4"]
    calibration = {
        "mass": entry("mass of link4", mass - 1e-3, mass + 1e-3, "kg"),
        "length": entry("body x of link2", 1.0, 2.0, "m"),
        "stiffness": entry("tendon stiffness of cable1_plus", 1.0, 2.0, "N_per_m"),
    }
    held = parts_held(calibration, TRUTH)
    assert (held.count, held.of) == (1, 2)


def test_each_part_is_a_number_of_the_arms_machine():
    described = machines.find(machines.ARM).described
    names = {each.quantity.name for each in coordinates(described)}
    assert true_parts(ARM_AS_BUILT).keys() - names == {"body x of link10"}  # the last link's length
