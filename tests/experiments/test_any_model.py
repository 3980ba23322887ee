"""Test the machines of the any-model experiment, and how a trace of one is judged."""

import mujoco
import numpy as np
import pytest

from experiments.any_model import score, torques, trial
from experiments.any_model.models import MODELS
from experiments.any_model.record import FaultyRun
from experiments.any_model.trial import FaultyMachine, machines
from serpent_twin import effects
from serpent_twin.errors import SerpentError

ACCIDENTS = [(name, fault) for name, model in MODELS.items() for fault in model.accidents]
TORQUES = [(name, fault) for name, model in MODELS.items() for fault in model.torques]
FAULTS = [(name, fault) for name, model in MODELS.items() for fault in model.faults]


def moved(name, fault, strength, aside=0.0):
    machine = FaultyRun(MODELS[name], fault, strength, 1)
    machine.data.qpos[:] = np.array(MODELS[name].middle) + aside
    drives = len(MODELS[name].drives)
    start = machine.data.qpos[:drives] if MODELS[name].gain == 0 else np.zeros(drives)
    for n in range(400):
        machine.step(start + 0.2 * np.sin(0.01 * n))
    return machine.data.qpos.copy()


@pytest.mark.parametrize(("name", "fault"), FAULTS)
def test_a_fault_acts_in_proportion_to_its_strength(name, fault):
    if fault.startswith("sensor_delay"):
        pytest.skip("a delay of readings does not move the machine")
    nothing, strength = moved(name, "", 0.0), MODELS[name].faults[fault]
    small, large = (np.abs(moved(name, fault, k * strength) - nothing).max() for k in (0.01, 1))
    assert 0 < small < 0.2 * large and large > 1e-5


@pytest.mark.parametrize(("name", "fault"), TORQUES)
def test_a_fault_takes_its_part_of_a_torque(name, fault):
    def pushed(strength):
        machine = FaultyRun(MODELS[name], fault, strength, 1)
        machine.data.qpos[:] = np.array(MODELS[name].middle) + 0.2
        for n in range(400):
            machine.push(0.1 * np.sin(0.01 * n) * np.ones(machine.model.nv))
        return machine.data.qpos.copy()

    nothing, strength = pushed(0.0), MODELS[name].torques[fault]
    small, large = (np.abs(pushed(k * strength) - nothing).max() for k in (0.01, 1))
    assert 0 < small < 0.2 * large and large > 1e-6


def test_a_drive_tells_the_torque_that_moves_its_joint(tmp_path, monkeypatch):
    """Its own model's inverse dynamics, of angles that are differentiated twice."""
    monkeypatch.setattr(torques, "SECONDS", 2)
    model = MODELS["acrobot"]
    torques.record(tmp_path / "log.csv", model, "", 0.0, 3)
    table = np.genfromtxt(tmp_path / "log.csv", delimiter=",", names=True)
    names = [name.strip('"') for name in table.dtype.names]
    rows = table.view(float).reshape(len(table), -1)
    assert names == ["t", "q_shoulder", "q_elbow", "tau_shoulder", "tau_elbow"]
    described = mujoco.MjModel.from_xml_path(
        str(torques.describe(tmp_path, model).with_name("model.xml"))
    )
    data, width, found = mujoco.MjData(described), 10, []
    for n in range(width, len(rows) - width):
        around = slice(n - width, n + width + 1)
        fits = np.polynomial.polynomial.polyfit(rows[around, 0] - rows[n, 0], rows[around, 1:3], 3)
        data.qpos[:], data.qvel[:], data.qacc[:] = fits[0], fits[1], 2 * fits[2]
        mujoco.mj_inverse(described, data)
        found.append(data.qfrc_inverse - rows[n, 3:])
    assert np.sqrt(np.mean(np.square(found))) < 0.05 * rows[:, 3:].std()


def test_a_mass_is_added_as_a_body_at_the_same_place_would_be():
    """Huygens' and Steiner's axes, against MuJoCo's own sum over bodies."""
    added = FaultyRun(MODELS["leg"], "payload@bfoot", 1.5, 1).model
    spec = MODELS["leg"].spec()
    child = spec.body("bfoot").add_body(mass=1.5, explicitinertial=True)
    child.inertia = 3 * [1e-9]
    other = spec.compile()
    found = []
    for model in (added, other):
        data, mass = mujoco.MjData(model), np.zeros((3, 3))
        data.qpos[:] = [0.1, 0.2, -0.3]
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        found.append(np.r_[mass.ravel(), data.qfrc_bias])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-5)


def row(fault, *named, **strengths):
    machine = FaultyMachine("pendulum", fault)
    return {
        "name": machine.name,
        "true": {"": 0.1} if fault else {},
        "named": list(named),
        "rivals": {named[0]: ["hinge_friction@hinge"]} if named else {},
        "stand_ins": [],
        "unexplained": False,
        "strengths": {
            name: {"coulomb": dict(zip(("value", "low", "high"), of, strict=True))}
            for name, of in strengths.items()
        },
    }


def test_a_machine_is_judged_by_what_is_named_first():
    fault = "hinge_friction@hinge"
    good = row(fault, fault, "gravity", **{fault: (0.11, 0.09, 0.12)})
    assert score.right(good) and score.covered(good) and score.off(good) == pytest.approx(0.1)
    swapped = row(fault, "gravity", fault, **{fault: (0.2, 0.19, 0.21)})
    assert not score.right(swapped) and score.undecided(swapped) and not score.covered(swapped)
    assert score.covered(row(fault, "gravity")) is None
    assert score.right(row("")) and not score.right(row("", "gravity"))


def test_a_composed_law_is_judged_by_its_place_and_what_it_follows():
    machine = FaultyMachine("reacher", "soft_stop@wrist")
    found = {"name": "discovered", "changes": "joint_torque", "law": "beyond",
             "place": {"kind": "joint", "name": "wrist"}, "depends_on": ["joint angle of wrist"]}  # fmt: skip
    assert trial._named(machine, found) == machine.name
    other = found | {"place": {"kind": "joint", "name": "shoulder"}}
    said = "joint_torque of shoulder beyond joint angle of wrist"
    assert trial._named(machine, other) == said
    assert trial._named(machine, {"name": "gravity"}) == "gravity"
    size = {"size": {"value": -0.104, "low": -0.12, "high": -0.09}}
    good = row("", machine.name) | {"name": machine.name, "true": {"": 0.1}}
    good["strengths"] = {machine.name: size}
    assert score.right(good) and score.covered(good) and score.off(good) == pytest.approx(0.04)


@pytest.mark.parametrize(("name", "fault"), ACCIDENTS)
def test_an_accident_acts_and_is_not_in_the_catalogue(name, fault):
    strength = MODELS[name].accidents[fault]
    if fault.startswith("encoder_wave"):
        machine = FaultyRun(MODELS[name], fault, strength, 1)
        machine.data.qpos[:] = np.array(MODELS[name].middle) + 0.1
        assert 0 < np.abs(machine.read() - machine.data.qpos).max() <= strength
    else:
        assert np.abs(moved(name, fault, strength, 0.2) - moved(name, "", 0.0, 0.2)).max() > 1e-4
    assert fault.partition("@")[0] not in effects.KNOWN


def test_a_model_or_a_kind_of_fault_can_be_asked_for():
    assert {each.model for each in machines(("leg",))} == {"leg"}
    assert {each.fault.partition("@")[0] for each in machines(("payload",))} == {"payload"}
    with pytest.raises(SerpentError, match="--only hexapod: there is no such thing here"):
        machines(("hexapod",))
