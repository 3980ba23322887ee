"""Test that commands hold from row to row of the file where one reading is used of several rows."""

import mujoco
import numpy as np
import pytest
from example import Example, opened

from serpent_twin.machines.model.proposing import propose

RATE, NOISE, LATE = 100.0, 2e-4, 0.015  # [Hz], [rad], [s]
MJCF = """<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body name="arm">
    <joint name="hinge" axis="0 1 0" damping="0.05" armature="0.005"/>
    <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.2"/>
  </body></worldbody>
  <actuator><position name="servo" joint="hinge" kp="20" kv="0.6" ctrlrange="-2 2"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
every = {every}
steps = 60
time = {{ column = "t", unit = "s" }}
drive = [{{ actuator = "servo", column = "goal", unit = "rad", exact = true }}]
measured = [{{ joint = "hinge", columns = ["angle"], unit = "rad", noise = 0.0002 }}]
"""


def _log(path, late):
    """A servo that obeys late, simulated by MuJoCo in steps of 0.1 ms."""
    rng, rows, step = np.random.default_rng(3), 600, 1e-4
    model = mujoco.MjModel.from_xml_string(MJCF)
    model.opt.timestep = step
    data = mujoco.MjData(model)
    goals = np.cumsum(0.05 * rng.standard_normal(rows))
    goals = 0.6 * np.tanh(goals - goals.mean())
    data.qpos[0], seen, n = goals[0], [], round(1 / RATE / step)
    for k in range(-100 * n, rows * n):
        if k >= 0 and k % n == 0:
            seen.append(data.qpos[0] + NOISE * rng.standard_normal())
        data.ctrl[0] = goals[max(0, (k - round(late / step)) // n)]
        mujoco.mj_step(model, data)
    text = "\n".join(
        f"{t / RATE:.4f},{u:.7f},{q:.7f}" for t, (u, q) in enumerate(zip(goals, seen, strict=True))
    )
    path.write_text(f"t,goal,angle\n{text}\n")
    return path


@pytest.mark.parametrize("late", [0.0, LATE])
@pytest.mark.parametrize("every", [1, 2, 3])
def test_the_true_delay_leaves_noise_alone_however_many_rows_are_used(tmp_path, every, late):
    Example(MJCF, TOML.format(every=every)).write(tmp_path)
    _log(tmp_path / "log.csv", late)
    case, pieces, at = opened(tmp_path / "machine.toml", tmp_path / "log.csv")
    if late:
        at = at.having("command_delay", np.array([LATE]))
    off = pieces.measured - case.machine.respond([at], pieces)[0]
    assert (
        np.sqrt(np.nanmean(off**2)) < 1.35 * NOISE
    )  # with every command held twice as long: 30 * NOISE


def test_a_motion_is_planned_where_some_rows_are_used(tmp_path):
    """Its commands hold for the rows that are used."""
    Example(MJCF, TOML.format(every=2)).write(tmp_path)
    _log(tmp_path / "log.csv", 0.0)
    case, _, at = opened(tmp_path / "machine.toml", tmp_path / "log.csv")
    found = propose(case.machine, at, 1, 4.0, RATE / 2, np.random.default_rng(0))
    shown = case.machine.respond([at], found.pieces)[0]
    again = found.pieces.measured - shown
    assert np.sqrt(np.nanmean(again**2)) < NOISE


def test_one_step_for_each_command_converges_with_the_square_of_the_step(tmp_path):
    """The spring is hardly damped, as an implicit step of damping is of first order."""
    slow = MJCF.replace('timestep="0.002"', 'timestep="0.01"').replace(
        '"20" kv="0.6"', '"2" kv="0"'
    )
    slow = slow.replace('damping="0.05"', 'damping="0.001"')
    shown = {}
    for steps in (5, 10, 20, 80):
        toml = TOML.format(every=5).replace("steps = 60", f"steps = {steps}")
        path = Example(slow, toml).write(tmp_path / str(steps))
        case, pieces, at = opened(path, _log(tmp_path / "log.csv", 0.0))
        assert case.machine.steps == steps
        shown[steps] = case.machine.respond([at], pieces)[0]
    off = [np.sqrt(np.nanmean((shown[n] - shown[80]) ** 2)) for n in (5, 10, 20)]
    assert off[0] < 3e-3
    assert off[0] / off[1] > 3 and off[1] / off[2] > 3
