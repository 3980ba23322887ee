"""Test that attached effects move a plain MuJoCo program as they move a trace's own simulation."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import taken_away
from mujoco.batch import Batch
from taken_away import SECOND, begun, stepped

import serpent_twin
from serpent_twin.machines.model.clocks import Clocks
from serpent_twin.machines.model.drives import controls
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_laws import StateLaws
from serpent_twin.machines.model.twin_file import read_described

ON_ARM = {
    "stribeck@elbow": [0.1, 0.2],
    "friction_warming@elbow": [0.1, 40.0],
    "cable_creep@at_elbow": [0.3, 60.0, -1.0],
    "stiffness_drift@at_elbow": [5.0, 0.0, -1.0],
    "discovered@joint_torque of elbow: linear joint_angle of shoulder": [1.5, 0, 0, 0, 0, 0, -1, 1],
    "discovered@joint_torque of elbow: beyond joint_velocity of elbow": [1, 0, 0, 0, 0.1, 0, -9, 9],
    "discovered@joint_torque of elbow: periodic time of session": [1, 0, 0, 0, 9, 0, 0, 0],
    "discovered@joint_friction of elbow: above joint_angle of elbow": [
        0.1,
        0,
        0,
        0,
        -0.25,
        0,
        -1,
        1,
    ],
    "discovered@slack of at_elbow: constant": [0.1, 0, 0, 0, 0, 0, 0, 0],
    "discovered@force of lower: constant": [0.5, 0.2, 1, 0, 0, 0, 0, 0],
    "discovered@force_in_body of lower: linear position_x of lower": [0.5, 0.2, 1, 0, 0, 0, -9, 9],
    "discovered@spring of lower: constant": [0.5, 0.2, 1, 2, 0, 0, 0, 0],
    "discovered@command of at_elbow: linear command of at_elbow": [0.1, 0, 0, 0, 0, 0, -9, 9],
}
ON_LEVER = {
    "stribeck@pivot": [0.1, 0.2],
    "cable_friction@cable": [0.3, 0.0, 0.0, 0.0, -1.0],
    "cable_creep@cable": [0.3, 60.0, -1.0],
    "stiffness_drift@pivot": [5.0, 0.0, -1.0],
    "discovered@slack of cable: constant": [0.002, 0, 0, 0, 0, 0, 0, 0],
}
STILL = 1e-6  # [rad]


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return taken_away.arm(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def lever(tmp_path_factory):
    return taken_away.lever(tmp_path_factory.mktemp("lever"))


def both(taken, lacks, declared=()):
    """Poses in a second of the trace's simulation, of the attached twin and of its bare twin.xml."""
    twin = taken.twin(lacks, declared)
    path, states, told = taken.write(twin), taken.by_trace(twin), taken.told(SECOND)
    period = taken.pieces.period[0]
    model, data = begun(path, states, told)
    bare = stepped(*begun(path, states, told), period, told)
    with serpent_twin.attach(model, data, path) as attached:
        assert set(attached.effects) == set(lacks)
        mine = stepped(model, data, period, told)
    return states.pose[0, :SECOND], mine, bare


@pytest.mark.parametrize("name", ON_ARM)
def test_an_arm_moves_as_a_trace_moves_it(arm, name):
    ours, attached, bare = both(arm, {name: ON_ARM[name]})
    assert np.abs(attached - ours).max() < STILL
    if name != "stiffness_drift@at_elbow":  # in a second it softens by a thousandth
        assert np.abs(bare - ours).max() > 20 * STILL


@pytest.mark.parametrize("name", ON_LEVER)
def test_a_cabled_lever_moves_as_a_trace_moves_it(lever, name):
    ours, attached, _ = both(lever, {name: ON_LEVER[name]})
    assert np.abs(attached - ours).max() < STILL


def test_several_effects_and_a_calibration_act_together(arm):
    lacks = {"stribeck@elbow": [0.1, 0.2], "discovered@force of lower: constant": [0.5, 0, 1, 0, 0, 0, 0, 0],
             "gear_friction@shoulder": 0.2}  # fmt: skip
    calibrated = {"zero of at_elbow": 3.0, "scale of the drives": 0.05}
    ours, attached, _ = both(arm, lacks, calibrated)
    assert np.abs(attached - ours).max() < STILL


def test_friction_by_load_takes_what_actuators_gave_in_the_step_before(arm):
    ours, attached, bare = both(arm, {"gear_friction@elbow": 0.2})
    assert np.abs(attached - ours).max() < STILL
    assert np.abs(bare - ours).max() > 1e-2


@pytest.mark.parametrize("shape", ["play", "lag"])
def test_what_remembers_begins_where_the_program_begins(arm, shape):
    """Against the trace's laws on a batch, from a pose and a rate; a trace has a log's past besides."""
    law = {f"discovered@joint_torque of elbow: {shape} joint_angle of elbow":
           [3, 0, 0, 0, 0.1, 0, -1, 1]}  # fmt: skip
    twin = arm.twin(law)
    path = arm.write(twin)
    model = mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml")))
    pose, rate, told = np.array([0.1, -0.2]), np.array([0.5, 1.0]), np.array([0.3, 0.1])
    batch, step = Batch(model, 1, 1), np.array([model.opt.timestep])
    (effect,) = read_described(path).several
    laws = StateLaws(batch, Acting([[effect]], Clocks(np.zeros(1), np.zeros(1))), step, half=True)
    batch.reset()
    batch.bind("qpos")[...], batch.bind("qvel")[...], batch.bind("ctrl")[...] = pose, rate, told
    batch.forward()
    laws.begin()
    laws.start()
    batch.forward()
    laws.lag()
    ours = []
    for _ in range(400):
        laws.act()
        batch.step()
        ours.append(batch.bind("qpos")[0].copy())
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = pose, rate, told
    with serpent_twin.attach(model, data, path):
        for at in ours:
            mujoco.mj_step(model, data)
            assert np.abs(data.qpos - at).max() < 1e-9


@pytest.mark.parametrize(
    "lacks",
    [
        {"torque_saturation@at_elbow": 0.5},
        {"gear_backlash@at_elbow": 0.05},
        {"gear_backlash@at_elbow": 0.05, "command_delay": 0.0163},
        {"discovered@command of at_elbow: constant": [0.1, 0, 0, 0, 0, 0, 0, 0]},
    ],
)
def test_actuators_are_told_what_a_trace_tells_them(arm, lacks):
    """Commands agree in each part of a row, for a log that begins at rest, with calibrated scale and zero."""
    twin = arm.twin(lacks, {"zero of at_elbow": 3.0, "scale of the drives": 0.05})
    path, machine, pieces = arm.write(twin), arm.case.machine, arm.pieces
    resting = {n: np.c_[np.repeat(v[:, 9:10], 10, 1), v[:, 10:]] for n, v in pieces.column.items()}
    pieces = replace(pieces, column=resting)
    x = dict(zip((d.name for d in machine.declared), twin.declared, strict=True))
    there = read_described(path).several
    told = controls(machine.described, there, x, pieces)[0]
    given = np.stack([resting["goal_1"][0], resting["goal_2"][0]], axis=1)
    parts = len(told) // len(given)
    model = mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml")))
    plain, data = model.actuator_gainprm.copy(), mujoco.MjData(model)
    model.opt.timestep = pieces.period[0] / parts
    data.ctrl[:] = given[0]
    with serpent_twin.attach(model, data, path):
        for t in range(200):
            if t % parts == 0:
                data.ctrl[:] = given[t // parts]
            mujoco.mj_step(model, data)
            scale, offset = np.exp(0.05), [0.0, np.radians(3.0)]
            np.testing.assert_allclose(scale * data.ctrl + offset, told[t], atol=1e-9)
    assert (model.actuator_gainprm == plain).all()
