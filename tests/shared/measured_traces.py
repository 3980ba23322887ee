"""A log of a trunk, and traces of measured machines that take no time."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.measured import __main__ as measured
from experiments.measured import changed as measured_changed
from serpent_twin.residual import ANGLE, MARKERS, Comparison


def trunk(late=0.15, seconds=20, seed=0):
    """A log whose tip follows the commands' sum along x, so many seconds late, and the square of a motor's
    angle along z.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 0.01)
    columns = {"time": time}
    for n in range(1, 7):
        goal = np.convolve(rng.normal(0, 0.3, time.size), np.hanning(20), "same")
        columns[f"motor{n}_command"] = goal
        columns[f"motor{n}_position"] = np.interp(time - late, time, goal)
    for k in (1, 2, 3):
        tip = sum(columns[f"motor{n}_position"] for n in range(1, 7))
        seen = 0.01 * tip, -0.1 * k + 0 * time, 0.01 * columns["motor1_position"] ** 2
        columns |= {f"disk{k}_{axis}": x for axis, x in zip("xyz", seen, strict=True)}
    return {"rate_hz": 100}, columns


def compared(name, off):
    """A twin that is off by so many degrees or, the trunk's tip along y, millimetres."""
    tip = name.startswith("trunk")
    shape, measure = ((2, 20, 3, 3), MARKERS) if tip else ((2, 20, 1, 1), ANGLE)
    seen = np.zeros(shape)
    seen[..., -1, shape[-1] // 2] = 1e-3 * off if tip else np.radians(off)
    return Comparison(
        ("a", "b"), np.tile(np.arange(20.0), (2, 1)), marker_measured=seen,
        marker_predicted=np.zeros(shape), marker=measure,
    )  # fmt: skip


@pytest.fixture
def traced(monkeypatch):
    """A trace that takes no time and is off by 3, 2 and 1; returns what it was asked."""
    asked = []

    def fake(config, rig, training, judging):
        asked.append((rig.name, [r.name for r in training], [r.name for r in judging]))
        config.out.mkdir(parents=True)
        (config.out / "twin.json").write_text(json.dumps({"effects": []}))
        about = {"value": 0.2, "low": 0.1, "high": 0.3, "unit": "1"}
        found = [{"name": "gear_friction", "parameters": {"coefficient": about}}]
        if config.out.name.startswith("changed_"):
            found = [{"name": "payload", "parameters": {"mass": about | {"unit": "trunk weights"}}}]
        if config.out.name == "changed_same":
            found = []
        diagnosis = SimpleNamespace(
            comparisons={
                stage: compared(rig.name, off)
                for stage, off in zip(measured.STAGES, (3, 2, 1), strict=True)
            },
            candidates=[SimpleNamespace(name="cable_creep", verdict="rejected")],
            unexplained=SimpleNamespace(depends_on=""),
        )
        return diagnosis, {"effects": found, "stand_ins": [], "seconds": 1.0}

    monkeypatch.setattr(measured, "trace_sessions", fake)

    def before(name, twin, runs, path):
        assert {r.name for r in runs} <= {"controlled_1", "controlled_2"}
        return twin

    def carried(rig, runs, effects, twin):
        return {"value": 0.2, "low": 0.1, "high": 0.3} if effects else None

    monkeypatch.setattr(measured_changed, "trace_sessions", fake)
    monkeypatch.setattr(measured_changed, "_before", before)
    monkeypatch.setattr(measured_changed, "carried", carried)
    return asked
