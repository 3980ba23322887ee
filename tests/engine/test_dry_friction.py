"""Test where dry friction holds runs at rest, against closed forms and energies that are minimised."""

import mujoco
import numpy as np
from scipy.optimize import minimize

from serpent_twin.engine.dry_friction import DryFriction, rubs
from serpent_twin.engine.equilibrium import Equilibrium
from serpent_twin.engine.stepper import side_by_side

SLIDE = """<mujoco><option gravity="0 0 0"/><worldbody><body>
    <joint name="slide" type="slide" axis="1 0 0" stiffness="{spring}" frictionloss="{friction}"/>
    <geom size="0.1" mass="1"/></body></worldbody>
    <actuator><position joint="slide" kp="{servo}"/></actuator></mujoco>"""
FINGER = """<mujoco><option gravity="0 0 0"/><worldbody><site name="root" pos="0 0 0.02"/>
    <body><joint name="one" axis="0 1 0" stiffness="0.2"/><geom size="0.01" pos="0.1 0 0" mass="0.1"/>
    <site name="near" pos="0.1 0 0.02"/>
    <body pos="0.2 0 0"><joint name="two" axis="0 1 0" stiffness="0.1" frictionloss="0.01"/>
    <geom size="0.01" pos="0.1 0 0" mass="0.1"/><site name="far" pos="0.1 0 0.02"/></body></body></worldbody>
    <tendon><spatial name="cable" frictionloss="0.8"><site site="root"/><site site="near"/>
    <site site="far"/></spatial></tendon>
    <actuator><position tendon="cable" kp="500" forcelimited="true" forcerange="-50 0"/></actuator>
    </mujoco>"""


def dragged(xml: str, controls: np.ndarray) -> np.ndarray:
    """Poses at rest, (n, T, nq), under controls (n, T) that follow each other."""
    model = mujoco.MjModel.from_xml_string(xml)
    assert rubs(model)
    batch = side_by_side([model] * len(controls), 1)
    rest, friction = Equilibrium(batch), DryFriction(batch)
    control, pose, found = batch.bind("ctrl"), batch.bind("qpos"), []
    control[:, 0] = controls[:, 0]
    assert rest.settle().all()
    rest.friction = friction
    near = rest.giving_way()
    for now in controls.T:
        control[:, 0] = now
        assert rest.settle(near).all()
        friction.hold()
        found.append(pose.copy())
    return np.stack(found, axis=1)


def test_friction_holds_a_slide_until_the_servo_overcomes_it():
    """K (u − x) − s x lies within ± F, and x moves no more than it must."""
    servo, spring, friction = 100.0, 30.0, 2.0
    controls = np.random.default_rng(0).uniform(-0.2, 0.2, (5, 40))
    found = dragged(SLIDE.format(servo=servo, spring=spring, friction=friction), controls)[..., 0]
    stiffness = servo + spring
    x = servo * controls[:, 0] / stiffness
    for t, told in enumerate(controls.T):
        x = np.clip(x, (servo * told - friction) / stiffness, (servo * told + friction) / stiffness)
        np.testing.assert_allclose(found[:, t], x, atol=1e-8)


def test_friction_of_tendon_and_joint_holds_a_finger_where_energy_and_friction_are_least():
    """Each pose is the least of energy and friction's work from the pose before, by another minimiser."""
    rng = np.random.default_rng(1)
    controls = 0.298 + 0.004 * rng.uniform(-1.0, 0.6, (2, 14)).cumsum(axis=1)
    controls[:, 0] = 0.298
    found = dragged(FINGER, controls)
    model = mujoco.MjModel.from_xml_string(FINGER)
    data = mujoco.MjData(model)

    def length(pose: np.ndarray) -> float:
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        return float(data.ten_length[0])

    for run, told in zip(found, controls, strict=True):
        for before, after, control in zip(run, run[1:], told[1:], strict=False):
            was = length(before)

            def work(pose: np.ndarray, before=before, was=was, control=control) -> float:
                now = length(pose)
                springs = 0.1 * pose[0] ** 2 + 0.05 * pose[1] ** 2
                cable = 250 * max(now - control, 0.0) ** 2
                return springs + cable + 0.8 * abs(now - was) + 0.01 * abs(pose[1] - before[1])

            starts = [after, before, after + 0.02, after - 0.02]
            best = min(
                (
                    minimize(
                        work,
                        start,
                        method="Nelder-Mead",
                        options={"xatol": 1e-9, "fatol": 1e-14, "maxiter": 4000},
                    )
                    for start in starts
                ),
                key=lambda each: each.fun,
            )
            np.testing.assert_allclose(after, best.x, atol=2e-4)
            assert work(after) <= best.fun + 1e-9


def test_poses_without_friction_are_those_of_the_springs():
    controls = np.array([[0.29, 0.285, 0.28]])
    bare = FINGER.replace(' frictionloss="0.8"', "").replace(' frictionloss="0.01"', "")
    assert not rubs(mujoco.MjModel.from_xml_string(bare))
    little = FINGER.replace('"0.8"', '"1e-9"').replace(
        'frictionloss="0.01"', 'frictionloss="1e-12"'
    )
    model = mujoco.MjModel.from_xml_string(bare)
    batch = side_by_side([model] * 3, 1)
    batch.bind("ctrl")[:, 0] = controls[0]
    rest = Equilibrium(batch)
    assert rest.settle().all()
    np.testing.assert_allclose(dragged(little, controls)[0], batch.bind("qpos"), atol=1e-6)
