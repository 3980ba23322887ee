"""Test that a twin.json of model/machine.toml is the arm's twin model wherever that is taken."""

import json

import numpy as np
import pytest
from serpent_twins import STALL, serpent

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects.cable_friction import CableFriction
from serpent_twin.effects.named import MotorLatency
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.sim import twin_model

KINDS = ("tendon stiffness", "tendon slack", "moment arm", "joint friction", "friction near rest",
         "joint damping", "mass", "joint axis", "body x", "site", "cameras", "")  # fmt: skip
NOISE = np.r_[np.full(27, 3e-4), np.full(10, 6e-3)]


@pytest.fixture(scope="module")
def arm():
    return serpent((0, 150), 40)


def moved(machine, kind, seed=3):
    """A twin whose numbers of a kind are off by half the width of their priors; hinges creep."""
    names = [each.name for each in machine.declared]
    some = np.array([name.startswith(kind) for name in names])
    at = np.zeros(len(names))
    at[some] = 0.5 * np.random.default_rng(seed).standard_normal(some.sum())
    at *= [each.prior for each in machine.declared]
    at = np.where([name.startswith("friction near") for name in names], -np.abs(at) - 4, at)
    return ParameterVector(np.where(some, at, 0.0))


def written(arm, point, folder):
    """The arm's twin model of a twin that its machine writes."""
    path = folder / "twin.json"
    arm.machine.write(point, NOISE, path, {"arm": "arm_x", "provenance": {"held_out": 1}})
    return twin_model.read_file(path)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind or "all")
def test_each_kind_of_number_comes_over(arm, kind, tmp_path):
    """Markers within 0.05 mm, loads within 0.1 % of the stall torque, in the mean; all moved by more."""
    point = moved(arm.machine, kind)
    design = written(arm, point, tmp_path).design
    assert design != twin_model.NOMINAL_TWIN
    shown = arm.machine.respond([point], arm.pieces)[0]
    apart = np.abs(shown - arm.of_design(design))
    assert apart[..., :27].mean() < 5e-5 and apart[..., 27:][arm.turns].mean() < 1.5e-3
    nominal = arm.machine.respond([ParameterVector.nominal(arm.machine.declared)], arm.pieces)[0]
    assert np.abs(shown - nominal).mean() > 2 * apart.mean()


def test_a_jaw_that_friction_holds_is_held_in_the_twin(arm, tmp_path):
    """It has no weight there: through a soft constraint so light a jaw would creep under its cable."""
    begin = arm.machine.begin
    design = written(arm, ParameterVector(begin), tmp_path).design
    assert design.tolerances.jaw_held == (1.0,) and design.tolerances.jaw_friction == (0.0,)
    shown = arm.machine.respond([ParameterVector(begin)], arm.pieces)[0]
    apart = np.abs(shown - arm.of_design(design))
    assert apart[..., :27].mean() < 5e-5 and apart[..., 27:][arm.turns].mean() < 1.5e-3
    light = np.where([d.name.endswith("of jaw") for d in arm.machine.declared], 0.0, begin)
    turns = arm.machine.respond([ParameterVector(light)], arm.pieces)[0]
    assert np.abs(shown - turns)[..., 36].mean() > 3e-3


def test_effects_sensors_and_origin_come_over(arm, tmp_path):
    at = ParameterVector.nominal(arm.machine.declared)
    point = at.having("cable_friction", np.array([0.1, 0.1, 0.0, 0.005, -1.0]))
    point = point.having("motor_latency", np.array([0.02]))
    found = written(arm, point, tmp_path)
    assert found.design.effect_of(CableFriction).coefficient == pytest.approx(0.1)
    assert found.design.effect_of(MotorLatency).delay == pytest.approx(0.02)
    assert found.parameters.marker_noise == pytest.approx(3e-4)
    assert found.parameters.load_noise == pytest.approx(6e-3 / STALL)
    assert found.parameters.strand_stiffness == NOMINAL.strand_stiffness
    assert found.arm == "arm_x" and found.provenance.held_out == 1


def test_what_such_a_file_lacks_is_said(arm, tmp_path):
    path = tmp_path / "twin.json"
    written(arm, ParameterVector.nominal(arm.machine.declared), tmp_path)
    values = json.loads(path.read_text())
    del values["first"]
    path.write_text(json.dumps(values))
    with pytest.raises(SerpentError, match=r"twin\.json: it lacks first.*Give the twin\.json"):
        twin_model.read(path)
