"""Test that the demo of the README does what it says."""

import json
import os
import shlex
import subprocess
import sys
from itertools import pairwise

import pytest
from paths import ROOT

from serpent_twin.identification.run import Trace, planned


@pytest.mark.slow
def test_the_demo_ends_with_its_reports_and_its_replay(tmp_path):
    out = tmp_path / "a demo"  # a path with a space, too
    command = [sys.executable, "-m", "experiments.demo", "--out", str(out)]
    env = dict(os.environ, PYTHONPATH=str(ROOT))
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=env)
    assert done.returncode == 0, done.stderr
    for name in ("twin_readouts/report.html", "arm_a_readouts/report.html"):
        assert "<svg" in (page := (out / name).read_text()) or "data:image/png;base64" in page
        assert str(out / name) in done.stdout
    assert (out / "arm_a_session_04.rrd").stat().st_size > 1_000_000
    found = json.loads((out / "twin_readouts" / "scores.json").read_text())["readouts"]
    assert min(found, key=lambda name: found[name]["mean_mm"]) == "observer"
    step = shlex.split(done.stdout.rstrip().rpartition("\n")[2])
    assert step[:4] == ["next:", "python", "-m", "serpent_twin.trace"]
    asked = dict(pairwise(step[4:]))
    logs, where = (tmp_path / asked[name] for name in ("--logs", "--out"))
    assert len(planned(Trace(logs, where))[1]) == 3 and not where.exists()
