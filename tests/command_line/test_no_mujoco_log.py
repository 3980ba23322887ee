"""Test that MuJoCo leaves no MUJOCO_LOG.TXT where a user works, whatever makes it warn."""

import subprocess
import sys

import pytest

UNSTABLE = ["--strand-stiffness", "9e8", "--steps", "8"]
WARNS = """
import numpy as np, mujoco, serpent_twin.effects
from mujoco.batch import Batch
xml = ("<mujoco><option timestep='1'/><worldbody><body><joint stiffness='1e12'/><geom size='.1'/>"
       "</body></worldbody></mujoco>")
model = mujoco.MjModel.from_xml_string(xml)
"""
WAYS = {
    "one run": "d = mujoco.MjData(model); d.qpos[:] = 1\nfor _ in range(50): mujoco.mj_step(model, d)",
    "threads": "b = Batch(model, 8, 2); b.bind('qpos')[:] = 1\nfor _ in range(50): b.step()",
    "binary model": (
        "open('x.mjb', 'wb').write(b'none' * 99)\n"
        "try: mujoco.MjModel.from_binary_path('x.mjb')\nexcept ValueError: print('WARNING refused')"
    ),
    "error": "mujoco.mj_setState(model, mujoco.MjData(model), np.zeros(1), 1 << 30)",
}


def run(folder, *command):
    done = subprocess.run(
        [sys.executable, *command], cwd=folder, capture_output=True, text=True, timeout=200
    )
    return done.stdout + done.stderr


@pytest.mark.parametrize("way", WAYS)
def test_whatever_makes_it_warn(way, tmp_path):
    said = run(tmp_path, "-c", WARNS + WAYS[way])
    assert "WARNING" in said or "ERROR" in said
    assert not list(tmp_path.glob("MUJOCO*"))


@pytest.mark.parametrize("sessions", [1, 3])
def test_an_unstable_twin_in_this_process_and_in_workers(sessions, tmp_path):
    said = run(tmp_path, "-m", "serpent_twin.collect", "--out", "logs", "--workers", "2",
               "--sessions", str(sessions), *UNSTABLE)  # fmt: skip
    assert "error: the twin's simulation became unstable" in said
    assert not list(tmp_path.glob("MUJOCO*"))


def test_an_arm_that_is_no_mjcf(tmp_path):
    (tmp_path / "arm.xml").write_text("<mujoco><worl")
    said = run(tmp_path, "-m", "serpent_twin.collect", "--out", "logs", "--twin", "arm.xml")
    assert "error: " in said and "Traceback" not in said
    assert [path.name for path in tmp_path.iterdir()] == ["arm.xml"]
