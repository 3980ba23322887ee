"""Take back what a calibration moved beyond reason, or as far as it may: something may have been absorbed
by it.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import at_its_end, between
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import bettered
from serpent_twin.identification.fitting.objective import cost_at
from serpent_twin.identification.score_test import times_strength
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_STRONGER = (1.0, 1.2, 1.4, 1.7, 2.0)
"""Times an effect's strength at which a fit begins again without what stood for a part of it"""

_SAME = 0.03
"""Below this share of its squares beyond the declared parameters, a change counts as theirs: segments begin
at measured poses, where a misplaced marker shows less
"""
_AS_GOOD = 0.005
"""Share of its cost by which a fit may differ where it comes in: joints that stick make it rough"""


def without_ends(case: Case[Any], training: Any, found: Fit, name: str) -> ParameterVector | None:
    """Where a fit with an effect may begin again: what it took as far as it may is where it was declared, and
    the effect is as much stronger as is best there. None if nothing is at its end.
    """
    ended = at_its_end(case, found.point, found.free)
    if not ended.any():
        return None
    declared = found.point.declared.copy()
    declared[np.array(found.free.declared)[ended]] = 0.0
    point = ParameterVector(declared, found.point.effects)
    values = [times_strength(case.candidates[name], point.effects[name], by) for by in _STRONGER]
    points = [point.having(name, each) for each in values]
    left = case.residual(points, case.take(training, found.used))
    costs = [
        cost_at(case, *each, found.variance_inflation) for each in zip(points, left, strict=True)
    ]
    return points[int(np.argmin(costs))]


def prefer_interior(case: Case[Any], training: Any, ended: Fit, within: Fit) -> Fit:
    """Choose between a fit with parameters at their bounds, and one that began with none there.

    The better one; if both are as good, the one that began within. Then the logs do not tell the two apart,
    and the derivative of the chosen fit is changed to say so.
    """
    left = case.residual([within.point], case.take(training, ended.used))[0]
    cost = cost_at(case, within.point, left, ended.variance_inflation)
    if abs(cost - ended.cost) > _AS_GOOD * ended.cost:
        return within if cost < ended.cost else ended
    step, unseen = between(within.point, ended.point, within.free), np.zeros_like(within.residual)
    slopes = bettered(within.jacobian.copy(), unseen, step, within.variance_inflation)
    return replace(within, jacobian=slopes)


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
    return begun, begun.only([n for n in range(len(base.free)) if n != row])


def by_parameters(case: Case[Any], begun: Fit, change: Array) -> bool:
    """Whether declared parameters would make a change of the residual, (N,), were it not for their priors."""
    slopes = Information.of(case, begun).slopes.T.astype(float)
    left = change - slopes @ np.linalg.lstsq(slopes, change)[0]
    return bool(left @ left < _SAME * (change @ change))
