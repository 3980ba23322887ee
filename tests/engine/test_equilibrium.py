"""Test where models rest, against energies that are minimised without MuJoCo."""

import mujoco
import numpy as np
import posed_models
import pytest

from serpent_twin.engine.equilibrium import Equilibrium
from serpent_twin.engine.stepper import side_by_side
from serpent_twin.errors import SerpentError

GRAVITY = np.array([0.0, 0.0, -9.81])
GOALS = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 2))


def settled(xml: str, controls, start=0.0):
    model = mujoco.MjModel.from_xml_string(xml)
    batch = side_by_side([model] * len(controls), 1)
    batch.bind("ctrl")[...] = controls
    pose = batch.bind("qpos")
    pose[...] = start
    return Equilibrium(batch), batch, pose


def test_poses_rest_where_the_energy_is_least():
    rest, _, pose = settled(posed_models.MJCF, GOALS)
    assert rest.settle().all()
    wanted = [posed_models.rest(goals, GRAVITY) for goals in GOALS]
    np.testing.assert_allclose(pose, wanted, atol=2e-5)


def test_a_pendulum_falls_from_its_summit_to_its_rest():
    hanging = """<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/>
        <geom size="0.1" pos="0 0 1" mass="1"/></body></worldbody></mujoco>"""
    rest, _, pose = settled(hanging, np.zeros((3, 0)), [[1e-4], [-0.5], [2.0]])
    assert rest.settle().all()
    np.testing.assert_allclose(np.abs(pose), np.pi, atol=1e-5)


def test_cables_rest_taut_or_slack_where_a_slow_simulation_comes_to_rest():
    """A stick between two pulling-only cables, of which one is slack in some of the poses."""
    xml = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
        <site name="left" pos="-0.1 0 0"/><site name="right" pos="0.1 0 0"/>
        <body pos="0 0 0.05"><joint name="hinge" axis="0 1 0" stiffness="0.05" damping="0.05"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.01" mass="0.05"/>
        <site name="top_left" pos="-0.02 0 0.15"/><site name="top_right" pos="0.02 0 0.15"/></body>
        </worldbody>
        <tendon><spatial name="a"><site site="left"/><site site="top_left"/></spatial>
        <spatial name="b"><site site="right"/><site site="top_right"/></spatial></tendon>
        <actuator><position tendon="a" kp="300" forcerange="-100 0" forcelimited="true"/>
        <position tendon="b" kp="300" forcerange="-100 0" forcelimited="true"/></actuator></mujoco>"""
    controls = np.array([[0.2, 0.2], [0.18, 0.25], [0.3, 0.19], [0.21, 0.22]])
    rest, _, pose = settled(xml, controls)
    assert rest.settle().all()
    slow, model = [], mujoco.MjModel.from_xml_string(xml)
    for control in controls:
        data = mujoco.MjData(model)
        data.ctrl[:] = control
        mujoco.mj_step(model, data, nstep=20_000)
        slow.append(data.qpos.copy())
    np.testing.assert_allclose(pose, slow, atol=2e-5)


def test_the_stiffness_of_one_twin_leads_to_the_poses_of_another():
    rest, batch, pose = settled(posed_models.MJCF, GOALS)
    assert rest.settle().all()
    near = rest.giving_way()
    batch.bind("ctrl")[...] = GOALS + 0.02
    assert rest.settle(near).all() and rest.continued == 0
    again, *_, alone = settled(posed_models.MJCF, GOALS + 0.02)
    again.settle()
    np.testing.assert_allclose(pose, alone, atol=2e-6)


@pytest.mark.parametrize(
    "joint, actuator, wanted",
    [
        ("<freejoint/>", "", "free or ball"),
        (
            '<joint name="j"/>',
            '<actuator><intvelocity joint="j" kp="1" actrange="-1 1"/></actuator>',
            "activation",
        ),
    ],
)
def test_a_model_whose_rest_cannot_be_found_is_refused(joint, actuator, wanted):
    xml = f"<mujoco><worldbody><body>{joint}<geom size='1'/></body></worldbody>{actuator}</mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    with pytest.raises(SerpentError, match=wanted):
        Equilibrium(side_by_side([model], 1))
