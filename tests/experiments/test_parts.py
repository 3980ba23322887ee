"""Test how intervals of a bench arm's parts are judged."""

from dataclasses import asdict

import numpy as np
import pytest

import bench_arm
from experiments.confusion.parts import parts_held, true_parts
from serpent_twin.arm.geometry import ARM

ARM_AS_BUILT = asdict(bench_arm.draw(np.random.default_rng(3)))
TRUTH = {"parameters": ARM_AS_BUILT}


def entry(quantity, low, high, unit):
    return {"quantity": quantity, f"low_{unit}": low, f"high_{unit}": high}


def test_parts_are_those_of_the_arm():
    true = true_parts(ARM_AS_BUILT)
    ratio = ARM_AS_BUILT["length_ratio"][2]
    assert true["length of link 3"] == pytest.approx(1e3 * ARM.link_length[2] * ratio)
    assert true["lean of axis 2, across"] == pytest.approx(1e3 * ARM_AS_BUILT["axis_tilt"][1][1])
    assert true["cameras about y"] == pytest.approx(1e3 * ARM_AS_BUILT["camera_turn"][1])
    place = ARM.markers_in_links[8, 1] + ARM_AS_BUILT["marker_offset"][8][1]
    assert true["place of marker 9, y in its link's frame"] == pytest.approx(1e3 * place)


def test_those_in_their_intervals_are_counted_and_what_has_no_truth_is_not():
    mass = true_parts(ARM_AS_BUILT)["mass of link 4"]
    calibration = {
        "mass": entry("mass of link 4", mass - 1, mass + 1, "g"),
        "length": entry("length of link 1", 1.0, 2.0, "mm"),
        "stiffness": entry("strand stiffness 1+", 1.0, 2.0, "kN_per_m"),
    }
    held = parts_held(calibration, TRUTH)
    assert (held.count, held.of) == (1, 2)
