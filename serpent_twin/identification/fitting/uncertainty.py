"""What a fit leaves uncertain: twins within its uncertainty, and parameters that the logs cannot separate."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import moved
from serpent_twin.identification.fitting.objective import cost_at
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.numerals import listed

_LISTED = 6
_LEAST = 0.01
"""Share of a fitted number that a drawn one has at least"""
_CHANCE, _HALVINGS = 0.01, 10
"""Share of drawn twins that a linear machine's data could distinguish; times that one is brought nearer"""


def drawn(
    case: Case[Any],
    found: Fit,
    training: Any,
    rng: np.random.Generator,
    n: int,
    share: float = 1.0,
    timestep: float | None = None,
) -> list[ParameterVector]:
    """Twins that the data cannot distinguish from the fitted one; with only a share of its standard errors,
    if given. A value that is at its limit stays.

    They are drawn from the fit's covariance, which is right to first order. Where a number is hardly
    determined, its error is large and responses bend: a twin that fits the training segments worse than
    one in a hundred would is brought nearer by halves; as the usual time steps say, or others [s].
    """
    ranges = [list(case.candidates[name].ranges.values())[k] for name, k in found.free.effects]
    values = [found.point.effects[name][k] for name, k in found.free.effects]
    fixed = np.array([v >= r.limit_begins for v, r in zip(values, ranges, strict=True)], bool)
    half = np.linalg.cholesky(found.correlation + 1e-9 * np.eye(len(found.error)))
    steps = (half @ rng.standard_normal((len(found.error), n))).T * (share * found.error)
    steps[:, len(found.free.declared) :][:, fixed] = 0.0
    far_off = [k for k, each in enumerate(found.free.declared) if _is_far_off(case, each)]
    # a number that may be nearly nothing is uncertain by itself, and not by its logarithm
    steps[:, far_off] = np.log1p(np.maximum(steps[:, far_off], _LEAST - 1))
    some = case.take(training, found.used)

    def costs(points: list[ParameterVector]) -> Array:
        left = case.residual(points, some, timestep)
        inflation = found.variance_inflation
        return np.array(
            [cost_at(case, *each, inflation) for each in zip(points, left, strict=True)]
        )

    most = costs([found.point])[0] + share**2 * chdtri(len(found.error), _CHANCE)
    points = [moved(case, found.point, found.free, step) for step in steps]
    far = list(range(n))
    for _ in range(_HALVINGS):
        now = costs([points[k] for k in far])
        far = [k for k, cost in zip(far, now, strict=True) if not cost <= most]
        if not far:
            break
        steps[far] /= 2
        for k in far:
            points[k] = moved(case, found.point, found.free, steps[k])
    return points


def indistinguishable(case: Case[Any], found: Fit, above: float = 0.95) -> list[str]:
    """Parameters that the data cannot distinguish, or do not identify, in sentences."""
    names = [case.quantities[k].name for k in found.free.declared]
    names += [f"{name}'s {list(case.candidates[name].ranges)[k]}" for name, k in found.free.effects]
    alike = np.abs(found.correlation) > above
    ours = np.array([not name.endswith("all joints") for name in names])
    alike &= ours[:, None]  # the single joints' deviations are from it
    told = [
        f"{listed([names[n] for n in group])} cannot be told apart." for group in _groups(alike)
    ]
    prior = np.array([case.declared[k].prior for k in found.free.declared])
    far_off = [_is_far_off(case, k) for k in found.free.declared]
    blind = np.flatnonzero((found.error[: len(prior)] > 0.9 * prior) & ~np.array(far_off, bool))
    if blind.size:
        named = ", ".join(names[n] for n in blind[:_LISTED])
        more = f" and {blind.size - _LISTED} more parameters" if blind.size > _LISTED else ""
        told.append(
            f"The logs do not determine {named}{more}: they hardly depend on it, or segments disagree on it."
        )
    return told


def _is_far_off(case: Case[Any], coordinate: int) -> bool:
    """Whether a declared coordinate has a widened prior, by its number."""
    return case.declared[coordinate].name in case.widened


def _groups(alike: NDArray[np.bool_]) -> list[list[int]]:
    """Groups in which each is like each other, that together have all pairs which are alike, (N, N) above the
    diagonal.
    """
    left, found = np.triu(alike, 1), []
    both = left | left.T
    while left.any():
        group = [int(n) for n in np.argwhere(left)[0]]
        for n in range(len(left)):
            if n not in group and both[n, group].all():
                group.append(n)
        group.sort()
        left[np.ix_(group, group)] = False
        found.append(group)
    return found
