"""Score a twin on files that did not exist when its effects were chosen.

The effects are those that a trace on the other runs accepts; all parameters are then fitted again to all of
the other runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from serpent_twin.identification.build_diagnosis import estimates
from serpent_twin.identification.diagnosis import ParameterEstimate
from serpent_twin.identification.discovery import with_laws
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model.twin_file import read_twin
from serpent_twin.residual import Comparison
from serpent_twin.tables.log import Log

_DERIVATIVES = 3


@dataclass(frozen=True)
class Judged:
    """Scores of a twin on files that were used neither to fit nor to choose anything."""

    comparisons: dict[str, Comparison]
    """nominal, calibrated, corrected"""
    effects: dict[str, dict[str, ParameterEstimate]]
    """Parameters of each, fitted again"""


def judge(rig: Any, twin: Path, training: Sequence[Log], judging: Sequence[Log]) -> Judged:
    """Fit the effects of a traced twin, twin.json, to all training runs; compare on those that judge."""
    named = read_twin(twin, rig.name).point.effects
    case = with_laws(rig.open(training), named)
    bare = _fitted(case, training, ParameterVector.nominal(case.declared))
    whole = _fitted(case, training, replace(bare.point, effects=named)) if named else bare
    points = {"nominal": None, "calibrated": bare.point, "corrected": whole.point}
    runs = case.pieces(judging)
    return Judged(
        {stage: case.compare(point, runs) for stage, point in points.items()},
        {effect: estimates(case, whole, effect) for effect in named},
    )


def _fitted(case: Case[Any], training: Sequence[Log], start: ParameterVector) -> Fit:
    """All parameters of a point, weights renewed in between."""
    runs, at = case.pieces(training), start
    for _ in range(2):
        case = case.reweighted(at, runs)
        free = free_parameters(case, list(start.effects))
        found = fit(case, runs, at, free, _DERIVATIVES, case.segments[1])
        at = found.point
    return found
