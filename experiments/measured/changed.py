"""Identify what was changed about a machine, and by how much.

The nominal twin is that of the machine as it was, fitted to all of its runs; what may have been changed are
the candidates. The beginning of a run after the change is fitted; its rest judges.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.measured.benchmark import BENCHMARKS
from experiments.measured.result_page import effect_told, rejected
from experiments.measured.split import by_time
from serpent_twin import stored
from serpent_twin.identification import Trace, held_out
from serpent_twin.identification.discovery import with_laws
from serpent_twin.identification.fitting.fitted import NORMAL_95
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.run import trace_sessions
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model.twin_file import MachineTwin, read_twin
from serpent_twin.runs.provenance import file_hash
from serpent_twin.tables.log import Log

_DERIVATIVES, _SEGMENTS = 2, 9
_MASS, _PAYLOAD = "mass of ", "payload@"
"""Beginnings of the names of a body's mass among the coordinates, whose logarithm is fitted, and of a load"""


def changed(
    rig: Any, twin: Path, unchanged: Sequence[Log], runs: Sequence[Log], out: Path, seed: int
) -> list[dict[str, Any]]:
    """The entry in results.json of each run after a change; effects are those of a trace's twin.json."""
    if not runs:
        return []
    before = _before(rig, twin, unchanged, out / rig.name / "unchanged" / "twin.json")
    return [_one(rig, before, run, out, seed) for run in runs]


def _before(rig: Any, twin: Path, runs: Sequence[Log], path: Path) -> Path:
    """The twin of the machine as it was, fitted again to all its runs, with its parameters' errors."""
    of = {run.name: file_hash(run.path) for run in runs if run.path} | {"twin": _digest(twin)}
    if path.exists() and (told := read_twin(path, rig.name)).fitted_to == of and told.error:
        return path
    case = rig.open(runs)
    pieces, at = case.pieces(runs), read_twin(twin, rig.name).point
    case = with_laws(case, at.effects).reweighted(at, pieces)
    free = free_parameters(case, list(at.effects))
    found = fit(case, pieces, at, free, _DERIVATIVES, case.segments[1])
    names = [case.declared[k].name for k in free.declared]
    errors = dict(zip(names, found.error[: len(names)].tolist(), strict=True))
    path.parent.mkdir(exist_ok=True)
    left = held_out.errors(case.compare(found.point, pieces)).marker
    case.write(found.point, path, {"fitted_to": of, "standard_error": errors, "error": left})
    return path


def _one(rig: Any, twin: Path, run: Log, out: Path, seed: int) -> dict[str, Any]:
    assert run.path
    fitted, judging = by_time(run)
    asked = Trace(
        (run.path.parent,),
        out / rig.name / f"changed_{run.name}",
        rig=f"{rig.name}, changed since {_digest(twin)}",
        seed=seed,
        judge=judging[0].name,
    )
    since = rig.changed(twin)
    found, numbers = trace_sessions(asked, since, fitted, judging)
    metric = BENCHMARKS[rig.name].metric
    error = {stage: metric.of(each) for stage, each in found.comparisons.items()}
    effects = numbers["effects"]
    return {
        "file": run.path.name,
        "before": error["nominal"],
        "rezeroed": error["calibrated"],
        "after": error["corrected"],
        "effects": [each["name"] for each in effects],
        "found": [effect_told(each) for each in effects],
        "stand_ins": [effect_told(each) for each in numbers["stand_ins"]],
        "rejected": rejected(found),
        "payload_ratio": carried(since, fitted, effects, twin),
        "report": str((asked.out / "report.html").relative_to(out)),
    }


def carried(
    rig: Any, runs: Sequence[Log], effects: Sequence[Mapping[str, Any]], twin: Path
) -> dict[str, float] | None:
    """What the machine carries, in its own weights; None if nothing was found.

    The interval spans all places where the load may hang, and holds what the logs of the machine as it was
    leave open of its own weight.
    """
    found = {e["name"]: [p["value"] for p in e["parameters"].values()] for e in effects}
    loads = [name for name in found if name.startswith(_PAYLOAD)]
    if not loads:
        return None
    case = rig.open(runs)
    pieces = case.pieces(runs)
    own, error = weight(case.machine, read_twin(twin, rig.name))
    ends = []
    for place in [name for name in case.candidates if name.startswith(_PAYLOAD)]:
        values = {name: np.array(of) for name, of in found.items() if name != loads[0]}
        start = ParameterVector.nominal(case.declared, values | {place: np.array(found[loads[0]])})
        weighed, free = case.reweighted(start, pieces), free_parameters(case, list(start.effects))
        fitted = fit(weighed, pieces, start, free, _DERIVATIVES, _SEGMENTS)
        value, _, high = fitted.interval(place, 0)
        factor = float(np.exp(np.hypot(high / value - 1, NORMAL_95 * error)))
        ends += [value / own / factor, value / own * factor]
    return {"value": found[loads[0]][0] / own, "low": min(ends), "high": max(ends)}


def weight(machine: Any, twin: MachineTwin) -> tuple[float, float]:
    """A twin's own mass in the unit of its model, and its relative standard error: fits know the sum of
    masses better than each, so that independent errors are on the safe side.
    """
    mass, off = machine.spec(np.zeros(len(machine.declared)), ()).compile().body_mass, 0.0
    for each in machine.coordinates:
        if each.declared.name.startswith(_MASS):
            off += (mass[list(each.of)].sum() * twin.standard_error[each.declared.name]) ** 2
    return float(mass.sum()), float(np.sqrt(off) / mass.sum())


def _digest(twin: Path) -> str:
    """Hash of a twin without its provenance, so that a trace which began with another one does not go on."""
    told = stored.read_json(twin)
    for origin in ("provenance", "fitted_to"):
        told.pop(origin, None)
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:12]
