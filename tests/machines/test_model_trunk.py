"""Test the soft trunk that a machine.toml describes against statics: at rest its energy is least."""

import mujoco
import numpy as np
import pytest
from measured_logs import DATA, WHERE
from paths import ROOT
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from serpent_twin.machines.model import open_machine

FOLDER = ROOT / "experiments" / "measured" / "trunk"
MEASURED = DATA / "trunk"
measured = pytest.mark.skipif(not MEASURED.is_dir(), reason=WHERE)
GRAVITY, SEGMENT, PIECES, RADIUS, WOUND, STRETCH = 9.81, 0.1004, 3, 0.025, 0.035, 0.003
HOSE, SQUEEZE, CABLE, SERVO, END = 0.4, 1.5e4, 6e3, 50.0, 0.3
ENDS_AT, DIRECTIONS = (2, 3, 1, 3, 1, 2), (-46, -107, 180, 163, 114, 43)
BASE, HANGS = (
    np.array([0.102, -0.004, 0.106]),
    Rotation.from_matrix([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
)


def statics(goal):
    """Markers at rest (3, 3) and servos' angles (6,), by the least energy, which scipy finds."""
    both = np.repeat(np.radians(DIRECTIONS), 2) + np.tile([0, np.pi], 6)
    holes = RADIUS * np.stack([0 * both, np.cos(both), np.sin(both)], axis=1)
    long = SEGMENT / PIECES
    mass = 1 / (1 + END) / (3 * PIECES)

    def places(bend, squeeze):
        """Holes of base and disks (4, 12, 3), markers (3, 3), heights of the pieces' middles and the end."""
        at, turn, gap, middles = BASE, HANGS, 0.0, []
        passes, markers = [at + turn.apply(holes)], []
        for n, (about_y, about_z) in enumerate(bend):
            longer = squeeze[n // PIECES] if n % PIECES == 0 else 0.0
            at = at + turn.apply([gap + long / 2 + longer, 0, 0])
            turn, gap = turn * Rotation.from_euler("YZ", [about_y, about_z]), long / 2
            middles.append(at[1])
            if n % PIECES == PIECES - 1:
                passes.append(at + turn.apply(holes + [gap, 0, 0]))
                markers.append(at + turn.apply([gap, 0, 0]))
        return np.array(passes), np.array(markers), np.array(middles)

    def energy(x):
        bend, squeeze, winch = x[:18].reshape(9, 2), x[18:21], x[21:]
        passes, markers, middles = places(bend, squeeze)
        runs = np.linalg.norm(np.diff(passes, axis=0), axis=2).T
        ends = np.repeat(ENDS_AT, 2)
        away = np.array([runs[k, : ends[k]].sum() for k in range(12)]) - ends * SEGMENT
        pulled = np.repeat(winch, 2) * np.tile([1, -1], 6)
        stretch = np.maximum(away + pulled + STRETCH, 0)
        weight = GRAVITY * (mass * middles.sum() + END / (1 + END) * markers[-1, 1])
        springs = HOSE / long * (bend**2).sum() + SQUEEZE * (squeeze**2).sum()
        servos = SERVO * ((goal - winch / WOUND) ** 2).sum()
        return weight + (springs + CABLE * (stretch**2).sum() + servos) / 2

    scale = np.r_[np.ones(18), np.full(9, 1e-2)]
    found = minimize(
        lambda x: energy(scale * x), np.zeros(27), options={"gtol": 1e-5, "maxiter": 600}
    )
    x = scale * found.x
    return places(x[:18].reshape(9, 2), x[18:21])[1], x[21:] / WOUND


@pytest.mark.parametrize(
    "goal", [[0, 0, 0, 0, 0, 0], [0.5, 0, 0.3, 0, 0, 0], [0, 0.9, 0, -0.4, -0.3, 0.2]]
)
def test_at_rest_its_energy_is_least(goal):
    model = mujoco.MjModel.from_xml_path(str(FOLDER / "trunk.xml"))
    data = mujoco.MjData(model)
    data.ctrl[:] = goal
    mujoco.mj_step(model, data, 1000)
    markers, angles = statics(np.array(goal, float))
    there = np.array([data.site(f"marker{k}").xpos for k in (1, 2, 3)])
    np.testing.assert_allclose(there, markers, atol=5e-5)
    np.testing.assert_allclose(data.sensordata, angles, atol=1e-3)


@measured
def test_it_forgets_in_its_lead_how_it_was():
    """The trunk comes to the same motion from a state far from that in which segments begin."""
    rig = open_machine(FOLDER / "machine.toml")
    (run,) = rig.read(MEASURED / "controlled_1.parquet")
    model, period = rig.described.model, run.period / rig.described.about.every
    seen = []
    for begin in (0.0, 0.05):
        data = mujoco.MjData(model)
        data.qpos[:] = begin * (model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        for row in run.columns["motor1_command"][:40]:
            data.ctrl[:] = row
            mujoco.mj_step(model, data, round(run.period / model.opt.timestep))
        seen.append(data.site("marker3").xpos.copy())
    assert period == pytest.approx(model.opt.timestep)
    assert np.linalg.norm(seen[1] - seen[0]) < 2e-4
