"""Test filters of commands in whole sessions against MuJoCo, which steps the machine through them."""

import mujoco
import numpy as np
import pytest

from serpent_twin.machines.model.filters import filtered, only_filters
from serpent_twin.machines.model.stepped_runs import DrivenRuns

LIMITED = 'ctrllimited="true" ctrlrange="-0.5 0.5"'
LAGGED = '<general joint="turn" dyntype="filterexact" dynprm="0.07" gainprm="3"/>'
TWO = f"{LAGGED}<motor joint='turn'/>{LAGGED.replace('gainprm', f'{LIMITED} gainprm')}"


def model(actuators):
    body = '<body><joint name="turn"/><geom size="0.1" mass="1"/></body>'
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.001"/><worldbody>{body}</worldbody>'
        f"<actuator>{actuators}</actuator></mujoco>"
    )


def test_activations_are_those_of_a_simulation():
    of, rng, rows, parts, period = model(TWO), np.random.default_rng(0), 40, 2, 0.02
    told = np.repeat(rng.normal(size=(1, 10, of.nu)), 8, axis=1)
    driven = DrivenRuns([of], told, np.zeros((1, rows), np.int32), np.array([period]))
    data, found = mujoco.MjData(of), []
    data.act[:] = np.clip(told[0, 0, [0, 2]], [-np.inf, -0.5], [np.inf, 0.5])
    for n in range(rows * parts):
        if n % parts == 0:
            found.append(data.act.copy())
        data.ctrl[:] = told[0, n]
        mujoco.mj_step(of, data, round(period / parts / of.opt.timestep))
    past = filtered(driven, np.zeros(1))
    np.testing.assert_allclose(past.activation[0], found, atol=1e-12)
    state = past.at(np.array([0]), np.array([7]))
    assert state.activation[0] == pytest.approx(found[7])
    assert state.pose.shape == state.rate.shape == (1, 1)


@pytest.mark.parametrize(
    "other",
    [
        '<general joint="turn" dyntype="filter" dynprm="0.07"/>',
        '<general joint="turn" dyntype="integrator" actlimited="true" actrange="-1 1"/>',
        LAGGED.replace("gainprm", 'actlimited="true" actrange="-1 1" gainprm'),
        '<position joint="turn" kp="1" delay="0.01" nsample="20"/>',
    ],
)
def test_what_holds_more_is_simulated(other):
    assert only_filters(model(TWO))
    assert not only_filters(model(TWO + other))
