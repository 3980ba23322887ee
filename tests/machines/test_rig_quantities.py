"""Test that the numbers of a calibration table are those that the twin is built from."""

import numpy as np
import pytest

from serpent_twin.arm import mjcf
from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.kinematic_calibration import Kinematics
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.identification.build_diagnosis import _calibrated
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters
from serpent_twin.machines.arm.cable_law import CableLaw
from serpent_twin.machines.arm.quantities import quantities
from serpent_twin.machines.arm.vector import vector
from serpent_twin.machines.machine import ParameterVector, by_coordinate

RNG = np.random.default_rng(6)


def at(of, several, x):
    """Values by name at coordinates x."""
    value = by_coordinate(of.declared, x)
    return {each.name: each.after(sum(value[name] for name in each.of)) for each in several}


@pytest.fixture(scope="module")
def arm():
    """The vector about first guesses of all cables but one, which no log shows."""
    sure = {"stiffness_error": (0.1, 0.1), "slack_error": (1e-4, 1e-4), "winch_error": 0.01}
    laws = [
        CableLaw((9e3 + 400 * j, 11e3), (2e-4, 3e-4), 0.01, 0.02 + 1e-3 * j, **sure, explains=0.5)
        for j in range(9)
    ]
    parts = {"marker": 27, "link_length": 9, "link_mass": 9, "axis_tilt": 18, "camera_pose": 6}
    built = Deviations(**{name: tuple(RNG.normal(0, 1e-3, n)) for name, n in parts.items()})
    return vector([*laws, None], Kinematics(built, np.full((9, 3), 1e-4), 0.0), 4e-3, 4e-3)


@pytest.mark.parametrize("spread", [0.0, 0.2])
def test_the_arms_table_holds_the_numbers_of_its_design(arm, spread):
    x = RNG.normal(0, spread, len(arm.declared))
    found, design = at(arm, quantities(arm), x), arm.design(ParameterVector(x))
    p, t = design.parameters, design.tolerances
    for n, name in enumerate(mjcf.STRANDS):
        short = name.removeprefix("cable").replace("_plus", "+").replace("_minus", "−")
        stiffness = p.strand_stiffness * np.exp(t.strand_stiffness[n]) / 1e3
        assert found[f"strand stiffness {short}"] == pytest.approx(stiffness)
        slack = 1e3 * (p.strand_slack + t.strand_slack[n])
        assert found[f"strand slack {short}"] == pytest.approx(slack)
    for i in range(9):
        friction = 1e3 * p.joint_friction * np.exp(t.joint_friction[i])
        assert found[f"hinge friction, joint {i + 1}"] == pytest.approx(friction)
        damping = 1e3 * p.joint_damping * np.exp(t.joint_damping[i])
        assert found[f"hinge damping, joint {i + 1}"] == pytest.approx(damping)
        velocity = 1e3 * design.transition_velocity[i]
        assert found[f"transition velocity, joint {i + 1}"] == pytest.approx(velocity)
        for k, axis in enumerate("xyz"):
            place = 1e3 * (ARM.marker[i][k] + t.marker[3 * i + k])
            assert found[f"place of marker {i + 1}, {axis} in its link's frame"] == pytest.approx(
                place
            )
        mass = 1e3 * ARM.link_mass[i] * np.exp(t.link_mass[i])
        assert found[f"mass of link {i + 1}"] == pytest.approx(mass)
        for k, way in enumerate(("along its link", "across")):
            lean = 1e3 * t.axis_tilt[2 * i + k]
            assert found[f"lean of axis {i + 1}, {way}"] == pytest.approx(lean)
    for i in range(8):
        length = 1e3 * ARM.link_length[i] * (1 + t.link_length[i])
        assert found[f"length of link {i + 1}"] == pytest.approx(length)
    for k, axis in enumerate("xyz"):
        for n, way in enumerate(("along", "about")):
            assert found[f"cameras {way} {axis}"] == pytest.approx(1e3 * t.camera_pose[3 * n + k])
    for j in range(10):
        winch = 1e3 * ARM.pulley_radius[j] * (1 + t.winch_radius[j])
        assert found[f"winch radius, motor {j + 1}"] == pytest.approx(winch)
        gear = 1e3 * p.gear_friction * np.exp(t.gear_friction[j])
        assert found[f"gear friction, motor {j + 1}"] == pytest.approx(gear)
    nominal = {each.name: each.nominal for each in quantities(arm)}
    assert nominal["strand stiffness 3+"] == NOMINAL.strand_stiffness / 1e3
    assert nominal["place of marker 1, y in its link's frame"] == 25
    assert len(found) == len(arm.declared)


def test_an_interval_of_two_coordinates_has_the_errors_of_both(arm):
    """A hinge's friction: what all have in common, and by how much it differs, against random draws."""
    several, n = quantities(arm), len(arm.declared)
    k = next(i for i, each in enumerate(several) if each.name == "hinge friction, joint 2")
    error, correlation = np.full(n, 0.05), np.eye(n)
    common = [each.name for each in arm.declared].index(several[k].of[0])
    correlation[common, k] = correlation[k, common] = -0.6
    point = ParameterVector(RNG.normal(0, 0.1, n))
    fit = Fit(
        point,
        FreeParameters(tuple(range(n)), ()),
        0.0,
        1.0,
        error,
        correlation,
        True,
        np.zeros(0),
        np.zeros(0),
        (),
        np.ones(0),
    )
    case = type("Case", (), {"declared": arm.declared})
    found = _calibrated(case, fit, several[k], k)
    draws = RNG.multivariate_normal(
        [0, 0], 0.05**2 * np.array([[1, -0.6], [-0.6, 1]]), 200_000
    ).sum(axis=1)
    ends = found.value.value * np.exp(np.quantile(draws, [0.025, 0.975]))
    assert (found.value.low, found.value.high) == pytest.approx(tuple(ends), rel=2e-3)
    assert found.value.unit == "mN m" and found.start == pytest.approx(4.0)
    assert found.coordinate.value == point.declared[k]
