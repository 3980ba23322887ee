"""Test that the demo of the README does what it says."""

import json
import os
import shlex
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from paths import ROOT
from PIL import Image

from experiments.demo import robot
from experiments.demo.verdict import verdict
from serpent_twin.matching import describe
from serpent_twin.sim import twin_model


def effect(name, size):
    return {"name": name, "parameters": {"strength": {"value": size}}}


def test_right_wrong_missed_and_invented_effects_are_told_apart():
    found = [
        effect("command_delay", 1.03 * robot.LATE),
        effect("hinge_friction@tilt", 2 * robot.FRICTION),
    ]
    both = list(verdict({"effects": found}))
    assert "right" in both[0] and f"found {1030 * robot.LATE:.3g} ms" in both[0]
    assert "WRONG" in both[1] and f"found {2 * robot.FRICTION:.3g} N m" in both[1]
    at_pan = list(verdict({"effects": [effect("hinge_friction@pan", robot.FRICTION)]}))
    assert [line.split()[0] for line in at_pan] == ["MISSED", "MISSED", "WRONG"]


def test_the_robot_moves_late_and_sticks_where_it_should():
    time, command, angle = robot.run(np.random.default_rng(3))
    assert command.shape == angle.shape == (len(time), 2)
    assert (np.abs(command).max(axis=0) <= [0.9, 0.6]).all() and not command[0].any()
    still = (np.diff(angle, axis=0) == 0) & (np.abs(np.gradient(command, axis=0)[1:]) > 5e-4)
    pan, tilt = still.sum(axis=0)
    assert tilt > 3 * pan  # dry friction holds a joint while its goal moves
    np.testing.assert_allclose(angle, command, atol=0.35)


def test_all_columns_of_its_logs_are_matched(tmp_path):
    logs = robot.write(tmp_path)
    found = describe(tmp_path / "robot.xml", logs)
    assert found.whole and not found.undecided
    table = found.table()
    for joint in robot.JOINTS:
        assert f"command of actuator {joint}" in table and f"reading of joint {joint}" in table


@pytest.mark.slow
def test_the_demo_finds_both_faults_and_draws_the_arm(tmp_path):
    out = tmp_path / "a demo"  # a path with a space, too
    command = [sys.executable, "-m", "experiments.demo", "--out", str(out)]
    env = dict(os.environ, PYTHONPATH=str(ROOT))
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=env)
    assert done.returncode == 0, done.stderr
    assert (
        "<svg" in (page := (out / "pan_tilt/trace/report.html").read_text()) or "image/png" in page
    )
    assert str(out / "pan_tilt/trace/report.html") in done.stdout
    diagnosis = json.loads((out / "pan_tilt/trace/diagnosis.json").read_text())
    assert all(line.split()[0] == "right" for line in verdict(diagnosis)), done.stdout
    picture = np.asarray(Image.open(out / "arm.png"))
    assert picture.shape[1] == 720 and len(np.unique(picture.reshape(-1, 3), axis=0)) > 1000
    step = shlex.split(done.stdout.rstrip().rpartition("\n")[2])
    assert step[:4] == ["next:", "python", "-m", "serpent_twin.collect"]
    asked = dict(pairwise(step[4:]))
    twin, where = (tmp_path / asked[name] for name in ("--twin", "--out"))
    assert twin_model.read(twin).active and not where.exists()
