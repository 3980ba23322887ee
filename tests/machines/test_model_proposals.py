"""Test that motions proposed for a model keep what its logs used, and how its twin follows them."""

from dataclasses import replace

import mujoco
import numpy as np
import posed_models
import pytest
import swung_models

from serpent_twin import tables
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.motions import OF_MOTION, OF_POSES
from serpent_twin.machines.model.proposing import propose

SITE = swung_models.TOML.replace(
    'joint = "pivot", columns = ["angle"], unit = "rad", noise = 0.0005',
    'site = "tip", columns = ["x", "y", "z"], unit = "mm", cameras = false, noise = 0.1',
)


def proposals(path, log, count, rate_hz, **changed):
    rig = open_machine(path)
    machine = replace(rig.open(rig.read(log)).machine, **changed)
    nominal = ParameterVector.nominal(machine.declared)
    return propose(machine, nominal, count, 20.0, rate_hz, np.random.default_rng(0))


def lever(folder, **how):
    """A lever and a log of 8 s in which it swings slowly."""
    path = swung_models.machine(folder / "lever")
    return path, swung_models.log(folder / "log.csv", swung_models.slow(0, 8.0), 0, **how)


def with_tip(folder):
    """A lever that swings slowly and its log of 8 s, in which the place of the tip is measured."""
    path, log = lever(folder)
    model = path.with_name("lever.xml")
    tip = '<site name="tip" pos="0 0 -0.25"/></body>'
    model.write_text(model.read_text().replace("</body>", tip))
    path.write_text(SITE)
    table = tables.read(log).columns
    angle = table["angle"]
    places = np.c_[-250 * np.sin(angle), 0 * angle, 1000 - 250 * np.cos(angle)]
    rows = np.c_[table["t_ms"], table["goal_deg"], places]
    lines = [",".join(f"{v:.7f}" for v in row) for row in rows]
    log.write_text("\n".join(["t_ms,goal_deg,x,y,z", *lines]))
    return path, log


def test_every_kind_of_motion_keeps_what_the_log_used_and_begins_and_ends_at_rest(tmp_path):
    path, log = lever(tmp_path)
    found = proposals(path, log, 2 * len(OF_MOTION), swung_models.RATE)
    assert found.kinds == tuple(OF_MOTION) * 2
    used = tables.read(log).columns["goal_deg"]
    steps = np.abs(np.diff(used))
    assert found.targets.shape == (14, 200, 1) and [c.name for c in found.columns] == ["goal_deg"]
    assert found.targets.min() >= used.min() - 1e-9 and found.targets.max() <= used.max() + 1e-9
    fastest = np.percentile(steps[steps > 0], 99)
    assert np.abs(np.diff(found.targets, axis=1)).max() <= fastest + 1e-9
    assert not found.targets[:, :15].any() and not found.targets[:, -40:].any()
    assert np.ptp(found.targets, axis=(1, 2)).min() > 0.2 * np.ptp(used)
    assert found.columns[0].fastest == pytest.approx(fastest * swung_models.RATE)
    assert found.time == ("t_ms", 1e-3)


@pytest.mark.parametrize("machine", [lever, with_tip])
def test_the_twin_follows_as_mujoco_does_in_small_steps(tmp_path, machine):
    path, log = machine(tmp_path)
    found = proposals(path, log, 3, swung_models.RATE, steps=256)
    spec = mujoco.MjSpec.from_file(str(path.with_name("lever.xml")))
    spec.option.timestep, spec.option.integrator = 5e-4, mujoco.mjtIntegrator.mjINT_RK4
    model = spec.compile()
    for target, name in zip(found.targets, dict.fromkeys(found.pieces.session), strict=True):
        data, seen = mujoco.MjData(model), []
        for goal in -np.radians(target[:, 0]):
            mujoco.mj_forward(model, data)
            seen.append(data.qpos.copy() if machine is lever else data.site("tip").xpos.copy())
            data.ctrl[:] = goal
            mujoco.mj_step(model, data, nstep=80)
        counted = found.pieces.measured[[each == name for each in found.pieces.session]]
        counted = counted[np.isfinite(counted).all(axis=-1)]
        np.testing.assert_allclose(counted, np.array(seen)[-len(counted) :], atol=1e-4)
        assert len(counted) == 185  # after a lead


def test_the_twin_rests_in_every_proposed_pose_where_its_energy_is_least(tmp_path):
    path = posed_models.machine(tmp_path / "arm")
    found = proposals(path, posed_models.log(tmp_path / "log.csv", 0), 5, 1.0)
    assert found.kinds == tuple(OF_POSES) and found.targets.shape == (5, 20, 2)
    assert found.time is None and not found.targets[:, [0, -1]].any()
    down = np.array([0.0, 0.0, -9.81])
    for target, rest in zip(found.targets, found.pieces.measured, strict=True):
        places = [posed_models.places(posed_models.rest(g, down))[1] for g in np.radians(target)]
        np.testing.assert_allclose(rest, places, atol=1e-5)


def test_a_twin_that_leaves_what_the_log_showed_is_refused(tmp_path):
    """A weak servo does not hold a lever upright."""
    path, log = lever(tmp_path)
    weak = swung_models.MJCF.replace("0 0 -0.25", "0 0 0.25").replace('kp="4"', 'kp="0.5"')
    path.with_name("lever.xml").write_text(weak)
    why = r"none of 21 motions keeps lever's limits\. The last that was refused: the twin's angle"
    with pytest.raises(SerpentError, match=why):
        proposals(path, log, 7, swung_models.RATE)


def test_drives_that_never_move_leave_no_motion(tmp_path):
    path = swung_models.machine(tmp_path / "lever")
    log = swung_models.log(tmp_path / "log.csv", np.full(200, 0.1), 0)
    with pytest.raises(SerpentError, match="the logs move no drive of lever"):
        proposals(path, log, 7, swung_models.RATE)
