"""Test a joint's free play against MuJoCo's springs with a dead zone, and against a rotor behind a gap."""

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from serpent_twin.effects import KNOWN
from serpent_twin.machines.model.clocks import Clocks
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_laws import StateLaws

GAP, TOLD, STIFFNESS = 0.2, 0.3, 8.0
OPTION = '<option timestep="0.0005"/>'
LINK = """<body><joint name="hinge" axis="0 1 0" damping="0.1"/>
<geom type="capsule" size="0.01" fromto="0 0 0 0 0 -0.3" mass="0.4"/></body>"""
SERVO = f"""<mujoco>{OPTION}<worldbody>{LINK}</worldbody>
<actuator><position name="servo" joint="hinge" kp="{STIFFNESS}"/></actuator></mujoco>"""
DEAD_ZONE = f"""<mujoco>{OPTION}<worldbody>{LINK}</worldbody><tendon>
<fixed springlength="{TOLD - GAP / 2} {TOLD + GAP / 2}" stiffness="{STIFFNESS}">
<joint joint="hinge" coef="1"/></fixed></tendon></mujoco>"""
ROTOR = f"""<mujoco>{OPTION}<worldbody>{LINK}
<body><joint name="rotor" axis="0 1 0" armature="1e-3" damping="0.01"/><geom size="0.001" mass="1e-6"/></body>
</worldbody><tendon><fixed springlength="{-GAP / 2} {GAP / 2}" stiffness="400" damping="0.002">
<joint joint="hinge" coef="1"/><joint joint="rotor" coef="-1"/></fixed></tendon>
<actuator><position joint="rotor" kp="{STIFFNESS}"/></actuator></mujoco>"""


def swung(gap: float, begin: float = -0.5, told: float = TOLD, steps: int = 4000) -> np.ndarray:
    """The hinge from where it begins, with a gap in its drive."""
    model = mujoco.MjModel.from_xml_string(SERVO)
    batch, clocks = Batch(model, 1, 1), Clocks(np.zeros(1), np.zeros(1))
    acting = Acting([[KNOWN["free_play"](gap, at="servo")]], clocks)
    laws = StateLaws(batch, acting, np.full(1, model.opt.timestep), half=False)
    laws.begin()
    batch.reset()
    batch.bind("qpos")[...], batch.bind("ctrl")[...] = begin, told
    batch.forward()
    laws.start()
    out = []
    for _ in range(steps):
        laws.act()
        batch.step()
        out.append(float(batch.bind("qpos")[0, 0]))
    return np.array(out)


def bare(mjcf: str) -> np.ndarray:
    """Angles of the hinge of a model without effects [rad]; the hinge comes first."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    data.qpos[:] = [-0.5, -0.5 + GAP / 2][: model.nq]
    data.ctrl[:] = TOLD
    out = []
    for _ in range(4000):
        mujoco.mj_step(model, data)
        out.append(float(data.qpos[0]))
    return np.array(out)


def test_a_drive_with_a_gap_is_a_spring_with_a_dead_zone():
    assert np.abs(swung(GAP) - bare(DEAD_ZONE)).max() < 1e-9
    assert np.abs(swung(GAP) - swung(0.0)).max() > 0.05


def test_a_gap_behind_a_light_rotor_is_such_a_drive():
    truth = bare(ROTOR)
    with_it, without = (np.sqrt(np.mean((swung(gap) - truth) ** 2)) for gap in (GAP, 0.0))
    assert with_it < 0.2 * without


@pytest.mark.parametrize("told", [0.1, -0.4])
def test_inside_the_gap_the_joint_hangs_whatever_its_drive_is_told(told):
    assert abs(swung(1.0, 0.01, told, 8000)[-1]) < 1e-2
