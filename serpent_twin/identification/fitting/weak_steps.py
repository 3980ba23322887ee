"""Finish a fit along what the data tell least, and find how much they tell there.

Some combinations of parameters change nothing that is measured: where motion alone is measured, all masses,
stiffnesses, frictions and forces times one factor. Each of them alone changes much, so that the error of
its finite difference, a few per cent, passes for information on the combination: the fit then stops where it
happened to come in, and its standard errors are too small. So the residual is differentiated along these
combinations themselves, by central differences, and the fit follows them and its priors to the end.
"""

from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.free_parameters import (
    FreeParameters,
    curved,
    room,
    straight,
)
from serpent_twin.identification.fitting.objective import At, Objective, least
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_MOST = 10
"""Directions, the weakest ones; other slopes stay as they are"""
_CHANGE = 3.0
"""Standard deviations by which a difference changes the residual"""
_SHARE = 0.2
"""Fraction of its value by which an effect's parameter is scaled"""
_LEAST = 0.03
"""Share of a way that is long enough for a difference: bounds may leave none of it, or none across others"""
_STEPS = (1.0, 0.5, 0.2)
"""Shares of a step that are tried side by side"""
_CORRECTIONS = 3
"""Times that what a step's curvature changes is taken back"""


def follow(problem: Objective, at: At, jacobian: Array) -> tuple[At, Array]:
    """A parameter vector to which weak directions lead, of lower cost if there is one, and the Jacobian that
    they were found with. That is in double precision: rounding to single precision would give back part of
    the false information.
    """
    width = _widths(problem.case, problem.free, at.point)
    scaled = jacobian.reshape(len(width), -1).astype(float) * width[:, None]
    weak = _differentiated(problem, at, scaled, width)
    taken = _stepped(problem, at, scaled, width, weak)
    return taken, (scaled / width[:, None]).reshape(jacobian.shape)


def _differentiated(problem: Objective, at: At, scaled: Array, width: Array) -> Array:
    """The weak directions, (len(free), W); the scaled Jacobian is changed in place, as little as can be, to
    what the residual does along them.
    """
    seen = np.flatnonzero(scaled.any(axis=1))  # the others move nothing, also together
    told, along = np.linalg.eigh(scaled[seen] @ scaled[seen].T / problem.variance_inflation)
    weak = np.zeros((len(scaled), min(len(seen), _MOST)))
    weak[seen] = along[:, : weak.shape[1]]
    lengths = np.minimum(1.0, _CHANGE / np.sqrt(np.maximum(told[: weak.shape[1]], 1e-9)))
    ways = [side * way for way in (lengths * weak * width[:, None]).T for side in (1, -1)]
    points = [curved(problem.case, at.point, problem.free, way) for way in ways]
    found = problem.residuals(points) if points else np.empty((0, *at.residual.shape))
    went = np.reshape(
        [straight(at.point, point, problem.free) for point in points], (-1, len(width))
    )
    steps = (went[0::2] - went[1::2]) / width / (2 * lengths)[:, None]
    changes = (found[0::2] - found[1::2]).reshape(len(steps), scaled.shape[1])
    changes /= (2 * lengths)[:, None].astype(changes.dtype)
    known = np.isfinite(changes).all(axis=1) & (np.linalg.norm(steps, axis=1) > _LEAST)
    if known.any():
        some = steps[known]
        scaled += np.linalg.pinv(some, rcond=_LEAST) @ (changes[known] - some @ scaled)
    return weak


def _stepped(problem: Objective, at: At, scaled: Array, width: Array, weak: Array) -> At:
    """The best of some steps within bounds, by the pull in all or in the weak directions; or none.

    Where the residual bends along a step, what it bends by is taken back by what the data tell much of: ways
    along which they tell little are curved, and narrow.
    """
    each, prior = problem.variance_inflation, problem.prior * width**2
    normal = scaled @ scaled.T / each + np.diag(prior)
    pull = -(scaled @ at.residual.ravel()) / each
    pull -= problem.prior_pull(at.point, scaled / width[:, None]) * width
    low, high = (end / width for end in room(problem.case, at.point, problem.free))
    ways = [least(normal, some, low, high) for some in (pull, weak @ (weak.T @ pull))]
    wanted, best = [share * way for way in ways for share in _STEPS], at
    steps = list(wanted)
    for n in range(_CORRECTIONS + 1):
        points = [curved(problem.case, at.point, problem.free, step * width) for step in steps]
        reached = problem.reached(points)
        best = min((best, *reached), key=lambda each: each.cost)
        if n == _CORRECTIONS:
            break
        for k, there in enumerate(reached):
            went = straight(at.point, there.point, problem.free) / width
            bent = (there.residual - at.residual).ravel() - went @ scaled
            if np.isfinite(bent).all():
                back = -(scaled @ bent) / each
                steps[k] = wanted[k] + least(normal, back, low - wanted[k], high - wanted[k])
    return best


def _widths(case: Case[Any], free: FreeParameters, point: ParameterVector) -> Array:
    """A scale for each free parameter: its prior's width; of an effect's, a share of its value."""
    ranges = [list(case.candidates[name].ranges.values())[k] for name, k in free.effects]
    values = [abs(float(point.effects[name][k])) for name, k in free.effects]
    sizes = [
        _SHARE * max(value, allowed.typical) for value, allowed in zip(values, ranges, strict=True)
    ]
    return np.r_[[case.declared[k].prior for k in free.declared], sizes]
