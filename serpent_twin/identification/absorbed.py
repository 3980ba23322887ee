"""Take back what a calibration moved beyond reason: a law may have been absorbed by it."""

from dataclasses import replace
from typing import Any

from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.free_parameters import FreeParameters
from serpent_twin.identification.objective import cost_at
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector


def without_move(case: Case[Any], training: Any, base: Fit, coordinate: str) -> tuple[Fit, Fit]:
    """A fit whose one declared coordinate is where it was declared, from which other fits may begin; and the
    same as if that were not free, by which laws are sought.
    """
    k = [each.name for each in case.declared].index(coordinate)
    declared = base.point.declared.copy()
    declared[k] = 0.0
    point = ParameterVector(declared, base.point.effects)
    residual = case.residual([point], case.take(training, base.used))[0]
    cost = cost_at(case, point, residual, base.variance_inflation)
    begun = replace(base, point=point, residual=residual, cost=cost)
    row = base.free.declared.index(k)
    others = tuple(each for each in base.free.declared if each != k)
    kept = [n for n in range(len(base.free)) if n != row]
    free = FreeParameters(others, base.free.effects)
    return begun, replace(begun, free=free, jacobian=base.jacobian[kept])
