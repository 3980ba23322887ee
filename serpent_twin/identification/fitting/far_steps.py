"""Step to where one number is far off, which no derivative reaches.

A joint that sticks does not show how it would creep, nor one that is held how strong the friction is that
holds it. The cost is flat there and has its minimum elsewhere. So a number that may be off by a large factor
is tried far from where it is, all others refitted to first order.
"""

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.free_parameters import moved
from serpent_twin.identification.fitting.objective import At, Objective

_MAY_BE_ABSENT = 2.0
"""Width of the prior of a number's logarithm, a factor of seven, from which it is tried"""
_WHERE, _APART = (-2.0, -1.0, 0.0, 1.0, 2.0), 0.5
"""Where, in widths of the prior; nearer than that to where it is, it is not tried"""
_BEST, _SHARES = 3, (1.0, 0.5)
"""Number of the best tried values from which the refitting step is simulated; shares of that step to try"""
DECISIVE = 6.0
"""Least decrease of squares and priors, as twice the logarithm of a Bayes factor: strong evidence (Kass and
Raftery, JASA 90, 1995)
"""


def elsewhere(problem: Objective, at: At, jacobian: Array) -> At:
    """A better parameter vector, with one number far from where it is; the same one if there is none.

    The derivative by all free parameters, (P, S, N), says how the others make up for it.
    """
    declared, quantities = problem.case.declared, problem.case.quantities
    unit = np.eye(len(problem.free))
    far = [
        (n, step * unit[n])
        for n, k in enumerate(problem.free.declared)
        if not quantities[k].scale and declared[k].prior >= _MAY_BE_ABSENT
        for step in np.multiply(_WHERE, declared[k].prior) - at.point.declared[k]
        if abs(step) > _APART * declared[k].prior
    ]
    gone = problem.reached([moved(problem.case, at.point, problem.free, step) for _, step in far])
    refitted = []
    for (n, _), there in zip(far, gone, strict=True):
        if np.isfinite(there.cost):
            others = jacobian * (unit[n] == 0)[:, None, None]
            step = problem.linear_step(there, others)
            left = there.residual + np.tensordot(step, others, 1)
            end = moved(problem.case, there.point, problem.free, step)
            refitted.append((problem.cost(left, end), there, step))
    if not refitted:
        return at

    best = sorted(refitted, key=lambda each: each[0])[:_BEST]
    ways = [(at, problem.linear_step(at, jacobian)), *((there, step) for _, there, step in best)]
    points = [
        moved(problem.case, there.point, problem.free, share * step)
        for there, step in ways
        for share in _SHARES
    ]
    reached, near = problem.reached(points), len(_SHARES)
    stays = min((at, *reached[:near]), key=lambda each: each.cost)
    away = [there for there, _ in ways[1:]] + reached[near:]
    goes = min(away, key=lambda each: each.cost)
    return goes if goes.cost < stays.cost - DECISIVE else stays
