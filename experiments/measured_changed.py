"""What was changed about a machine, and how much?

The twin of the machine as it was is the nominal one, and what may have been changed are the candidates. The
beginning of a run after the change is fitted; its rest judges.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from measured_bench import BENCHES
from measured_page import effect_told
from measured_split import by_time

from serpent_twin import rigs
from serpent_twin.measured import Recording
from serpent_twin.trace import Trace
from serpent_twin.trace.run import trace_sessions

_WEIGHT = "weight of the trunk"
"""The coordinate of the fit, a logarithm"""


def changed(
    name: str, twin: Path, runs: Sequence[Recording], out: Path, seed: int
) -> list[dict[str, Any]]:
    """What results.json says of each run after a change to the machine that twin.json is of."""
    return [_one(name, twin, run, out, seed) for run in runs]


def _one(name: str, twin: Path, run: Recording, out: Path, seed: int) -> dict[str, Any]:
    assert run.path
    machine: Any = rigs.find(name)
    fitted, judging = by_time(run)
    asked = Trace(
        run.path.parent,
        out / name / f"changed_{run.name}",
        rig=f"{name}, changed since {_digest(twin)}",
        seed=seed,
        judge=judging[0].name,
    )
    found, numbers = trace_sessions(asked, machine.changed(twin), fitted, judging)
    error = {stage: BENCHES[name].metric.of(each) for stage, each in found.comparisons.items()}
    effects = numbers["effects"]
    return {
        "file": run.path.name,
        "before": error["nominal"],
        "rezeroed": error["calibrated"],
        "after": error["corrected"],
        "effects": [each["name"] for each in effects],
        "found": [effect_told(each) for each in effects],
        "rejected": [each.name for each in found.candidates if each.verdict != "accepted"],
        "payload_ratio": _payload(effects, twin),
        "report": str((asked.out / "report.html").relative_to(out)),
    }


def _payload(effects: Sequence[Mapping[str, Any]], twin: Path) -> dict[str, float] | None:
    """What the machine carries, in its own weights.

    The interval holds what the logs of the machine as it was leave open of its weight, besides the trace's.
    """
    known = json.loads(twin.with_name("diagnosis.json").read_text())["calibration"]
    own = known.get(_WEIGHT, {"low": 0.0, "high": 0.0})
    for each in effects:
        if each["name"] == "payload":
            mass = each["parameters"]["mass"]
            value = mass["value"]
            apart = (mass["high"] - mass["low"]) / 2 / value, (own["high"] - own["low"]) / 2
            factor = float(np.exp(np.hypot(*apart)))
            return {"value": value, "low": value / factor, "high": value * factor}
    return None


def _digest(twin: Path) -> str:
    """Of what a twin is, so that a trace which began with another one does not go on."""
    told = json.loads(twin.read_text())
    told.pop("provenance", None)
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:12]
