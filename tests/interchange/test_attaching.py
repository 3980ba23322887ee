"""Test what attaching refuses, what it leaves alone, and that it can be undone."""

import mujoco
import numpy as np
import pytest
import taken_away

import serpent_twin
from serpent_twin import SerpentError

STICKS = {"stribeck@elbow": [0.1, 0.2]}
PULLS = {"discovered@force of lower: constant": [0.5, 0.2, 1, 0, 0, 0, 0, 0]}
PLAYS = {"gear_backlash@at_elbow": 0.05}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return taken_away.arm(tmp_path_factory.mktemp("arm"))


@pytest.fixture(autouse=True)
def alone():
    yield
    mujoco.set_mjcb_control(None)


def program(arm, lacks):
    path = arm.write(arm.twin(lacks))
    model = mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml")))
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = [0.3, -0.2], [0.6, 0.3]
    return model, data, path


def run(model, data, steps=100):
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return data.qpos.copy()


def numbers(model):
    fields = (
        "dof_frictionloss",
        "actuator_gainprm",
        "actuator_biasprm",
        "jnt_stiffness",
        "actuator_delay",
    )
    return np.concatenate([getattr(model, name).ravel() for name in fields])


def test_detached_a_program_is_what_it_was(arm):
    lacks = (
        STICKS
        | PULLS
        | PLAYS
        | {"discovered@slack of at_elbow: constant": [0.1, 0, 0, 0, 0, 0, 0, 0]}
    )
    model, data, path = program(arm, lacks)
    usual, bare = numbers(model), run(*program(arm, lacks)[:2])
    with serpent_twin.attach(model, data, path) as attached:
        assert len(attached.effects) == 4
        moved = run(model, data)
        assert not np.array_equal(numbers(model), usual)
    np.testing.assert_array_equal(numbers(model), usual)
    np.testing.assert_array_equal(data.ctrl, [0.6, 0.3])
    assert mujoco.get_mjcb_control() is None
    assert np.abs(moved - bare).max() > 1e-3
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.ctrl[:] = [0.3, -0.2], [0.6, 0.3]
    np.testing.assert_array_equal(run(model, data), bare)


def test_a_callback_that_was_there_goes_on(arm):
    model, data, path = program(arm, PLAYS)

    def swing(model, data):
        data.ctrl[1] = 0.3 * np.sin(9 * data.time)

    mujoco.set_mjcb_control(swing)
    with serpent_twin.attach(model, data, path):
        late = []
        for _ in range(500):
            mujoco.mj_step(model, data)
            late.append(abs(0.3 * np.sin(9 * (data.time - model.opt.timestep)) - data.ctrl[1]))
        assert max(late) == pytest.approx(0.025)  # half the play
    assert mujoco.get_mjcb_control() is swing


def test_other_simulations_are_left_alone(arm):
    model, data, path = program(arm, PULLS)
    other, beside = mujoco.MjData(model), run(*program(arm, PULLS)[:2])
    other.qpos[:], other.ctrl[:] = [0.3, -0.2], [0.6, 0.3]
    with serpent_twin.attach(model, data, path):
        run(model, data)
        np.testing.assert_array_equal(run(model, other), beside)


def test_two_simulations_are_attached_and_detached_in_any_order(arm):
    one, alone = program(arm, PULLS), program(arm, PULLS)
    with serpent_twin.attach(*alone):
        expected = run(*alone[:2])
    two = program(arm, PULLS)
    first, second = serpent_twin.attach(*one), serpent_twin.attach(*two)
    np.testing.assert_array_equal(run(*one[:2]), expected)
    first.detach()
    np.testing.assert_array_equal(run(*two[:2]), expected)
    second.detach()


def test_a_program_may_compute_forward_as_often_as_it_likes(arm):
    lacks = PULLS | STICKS | PLAYS | {"discovered@joint_torque of elbow: lag joint_angle of elbow":
                                      [3, 0, 0, 0, 0.1, 0, -1, 1]}  # fmt: skip
    model, data, path = program(arm, lacks)
    with serpent_twin.attach(model, data, path):
        expected = run(model, data)
    model, data, path = program(arm, lacks)
    with serpent_twin.attach(model, data, path):
        for _ in range(100):
            mujoco.mj_forward(model, data)
            mujoco.mj_step1(model, data)
            mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.qpos, expected, atol=1e-9)


def test_a_reset_begins_anew(arm):
    lacks = {
        "discovered@joint_torque of elbow: play joint_angle of elbow": [3, 0, 0, 0, 0.1, 0, -1, 1]
    }
    model, data, path = program(arm, lacks)
    with serpent_twin.attach(model, data, path) as attached:
        expected = run(model, data)
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.ctrl[:] = [0.3, -0.2], [0.6, 0.3]
        np.testing.assert_allclose(run(model, data), expected, atol=1e-12)
        data.qpos[:], data.qvel[:] = [0.3, -0.2], 0.0
        attached.begin()
        np.testing.assert_allclose(run(model, data), expected, atol=1e-6)


def test_a_program_places_the_machine_after_attaching(arm):
    lacks = {
        "discovered@joint_torque of elbow: play joint_angle of elbow": [3, 0, 0, 0, 0.1, 0, -1, 1]
    }
    model, data, path = program(arm, lacks)
    with serpent_twin.attach(model, data, path):
        expected = run(model, data)
    model, data, path = program(arm, lacks)
    data.qpos[:] = 0.0
    with serpent_twin.attach(model, data, path):
        data.qpos[:] = [0.3, -0.2]
        np.testing.assert_allclose(run(model, data), expected, atol=1e-9)


def test_a_programs_own_forces_stay(arm):
    model, data, path = program(arm, PULLS)
    data.qfrc_applied[1] = data.xfrc_applied[2, 2] = 0.7
    with serpent_twin.attach(model, data, path):
        pushed = run(model, data)
        assert data.qfrc_applied[1] == data.xfrc_applied[2, 2] == 0.7
    free = program(arm, PULLS)
    with serpent_twin.attach(*free):
        assert np.abs(run(*free[:2]) - pushed).max() > 0.01


def test_readings_are_shifted_and_late(arm):
    shift = "discovered@reading_shift of elbow: linear joint_velocity of shoulder"
    lacks = {shift: [0.5, 0, 0, 0, 0, 0, 0, 0], "sensor_delay@shoulder": 0.02}
    model, data, path = program(arm, lacks)
    with serpent_twin.attach(model, data, path) as attached:
        assert attached.effects == (shift,)
        angles = []
        for _ in range(50):
            angles.append(data.qpos[0])
            mujoco.mj_step(model, data)
        assert attached.reading("elbow")[0] == pytest.approx(data.qpos[1] + 0.5 * data.qvel[0])
        assert attached.reading("shoulder")[0] == pytest.approx(angles[-1 - 5], abs=1e-9)  # of 4 ms
        with pytest.raises(
            SerpentError, match="no joint, site, tendon, actuator or sensor 'wrist'"
        ):
            attached.reading("wrist")


def test_what_cannot_be_attached_is_named(arm, tmp_path):
    model, data, path = program(arm, STICKS | {"sensor_delay@shoulder": 0.02})
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.raises(SerpentError, match="stribeck@elbow cannot be attached: the integrator RK4"):
        serpent_twin.attach(model, data, path)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.sensor_delay[:] = 0.0
    with pytest.raises(SerpentError, match=r"sensor_delay@shoulder delays .* no late sensor of it"):
        serpent_twin.attach(model, data, path)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    with pytest.raises(SerpentError, match="the model's flag `actuation` is off"):
        serpent_twin.attach(model, data, path)
    plain = arm.case.machine.described.spec.compile()
    with pytest.raises(SerpentError, match=r"lacks the table .* Load .*twin\.xml; trace"):
        serpent_twin.attach(plain, mujoco.MjData(plain), path)
    serpent_twin.sim.twin_model.write(tmp_path / "twin.json", serpent_twin.NOMINAL_TWIN, {})
    with pytest.raises(SerpentError, match="is a twin of the serpentine arm"):
        serpent_twin.attach(plain, mujoco.MjData(plain), tmp_path / "twin.json")
    assert mujoco.get_mjcb_control() is None


def test_an_effect_that_a_model_has_no_place_for_is_refused_and_leaves_nothing(arm):
    model, data, path = program(
        arm, {"discovered@slack of elbow: constant": [1, 0, 0, 0, 0, 0, 0, 0]}
    )
    path.write_text(path.read_text().replace("slack of elbow", "slack of wrist"))
    with pytest.raises(SerpentError, match=r"no hinge, slide, tendon, body .* 'wrist'"):
        serpent_twin.attach(model, data, path)
    assert mujoco.get_mjcb_control() is None


def test_a_twin_that_needs_nothing_is_attached_to_no_effect(arm):
    model, data, path = program(arm, {"joint_stiffening@elbow": 2.0})
    bare = run(*program(arm, {"joint_stiffening@elbow": 2.0})[:2])
    with serpent_twin.attach(model, data, str(path)) as attached:
        assert attached.effects == ()
        np.testing.assert_array_equal(run(model, data), bare)
