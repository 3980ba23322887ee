"""Test that the demo of the README does what it says."""

import json
import os
import shlex
import subprocess
import sys
from itertools import pairwise

import pytest
from paths import ROOT

from serpent_twin.sim import twin_model


@pytest.mark.slow
def test_the_demo_closes_the_loop_and_replays_what_it_found(tmp_path):
    out = tmp_path / "a demo"  # a path with a space, too
    command = [sys.executable, "-m", "experiments.demo", "--out", str(out)]
    env = dict(os.environ, PYTHONPATH=str(ROOT))
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=env)
    assert done.returncode == 0, done.stderr
    for name in ("readouts/report.html", "loop/report.html", "loop/arm_a/report.html"):
        assert "<svg" in (page := (out / name).read_text()) or "data:image/png;base64" in page
        assert str(out / name) in done.stdout
    assert (out / "arm_a_session_04.rrd").stat().st_size > 1_000_000
    found = json.loads((out / "readouts" / "scores.json").read_text())["readouts"]
    assert min(found, key=lambda name: found[name]["mean_mm"]) == "observer"
    loop = json.loads((out / "loop" / "results.json").read_text())
    assert [each["name"] for each in loop["arms"]["arm_a"]["effects"]] == ["cable_friction"]
    error = loop["arms"]["arm_a"]["error_mm"]
    assert error["corrected"] < 0.65 * error["calibrated"]
    off = loop["overlay"]
    assert off["nominal_twin_mm"] > 10 and off["corrected_twin_mm"] < 0.1 * off["nominal_twin_mm"]
    step = shlex.split(done.stdout.rstrip().rpartition("\n")[2])
    assert step[:4] == ["next:", "python", "-m", "serpent_twin.collect"]
    asked = dict(pairwise(step[4:]))
    twin, where = (tmp_path / asked[name] for name in ("--twin", "--out"))
    assert twin_model.read(twin).active and not where.exists()
