"""Find the numbers that logs cannot separate: combinations of small changes that leave every row as it is.

With the derivative J of the residual by the parameters, each in standard deviations of its prior, the null
space of J is spanned by the changes that no row shows; what remains are the identifiable combinations, the
base parameters of inverse dynamics. A basis of few parameters each is sought among the changes with the
least sum of absolute values in which one parameter is 1. Sources: Gautier, Numerical calculation of the base
inertial parameters of robots, J. Robotic Systems 8, 1991; Chen, Donoho and Saunders, Atomic decomposition by
basis pursuit, SIAM J. Sci. Comput. 20, 1998.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.weak_directions import UNTOLD
from serpent_twin.machines.machine import Declared
from serpent_twin.numerals import listed

_LEAST = 0.05
"""Change that is named, of the largest of a combination in standard deviations of priors: as little of a
deviation is left out as a direction may be narrowed that counts as unknown
"""
_DIGITS = 2
"""Decimals to which changes are compared: equal ones are listed in the order of the parameters"""
NOTHING, _SUM = "nothing", "the sum of what they do"
_LOG = "log "
"""Beginning of the unit of a parameter that is the logarithm of a number"""


@dataclass(frozen=True)
class NullCombination:
    """Small changes of parameters that together leave all that logs show as it is."""

    changes: Mapping[str, float]
    """Change of each parameter in its unit, largest first; one is about a standard deviation of its prior"""
    units: Mapping[str, str]
    """`%` where the parameter is a factor"""

    @property
    def told(self) -> str:
        """What logs determine of these parameters."""
        if len(self.changes) == 1:
            return NOTHING
        sizes = np.array([*self.changes.values()])
        factors = set(self.units.values()) == {"%"}
        if not factors or np.ptp(np.abs(sizes)) > _LEAST * sizes[0]:
            return _SUM
        if (sizes > 0).all():
            return "their ratios"
        return "their product" if len(sizes) == 2 else _SUM

    def __str__(self) -> str:
        """The changes in words, such as `mass of upper +10 % and scale of i1 +10 %`."""
        if len(self.changes) == 1:
            return next(iter(self.changes))
        return listed(
            f"{name} {by:+.2g} {self.units[name]}".replace("-", "−")
            for name, by in self.changes.items()
        )

    def numbers(self) -> dict[str, object]:
        """The combination for JSON."""
        return {"changes": self.changes, "units": self.units, "told": self.told, "text": str(self)}


def null_combinations(
    declared: Sequence[Declared], slopes: Array, weight: float
) -> tuple[NullCombination, ...]:
    """A basis of what the derivative, (P, N), of a residual whose numbers have a weight shows nothing of.

    A direction is in the null space if logs narrow the prior along it by less than 5 %, as in
    `weakest_directions`: what a derivative has beyond that is below the noise, and its rounding is as well.
    """
    width = np.array([each.prior for each in declared])
    scaled = np.sqrt(weight) * slopes.astype(float) * width[:, None]
    information, along = np.linalg.eigh(scaled @ scaled.T)
    null = information < 1 / UNTOLD**2 - 1
    if not null.any():
        return ()
    sparse = sorted(_sparse(along[:, null], along[:, ~null]), key=_size)
    basis = _independent([*sparse, *along[:, null].T], int(null.sum()))
    return tuple(_combination(declared, x, width) for x in basis)


def _sparse(hidden: Array, shown: Array) -> Iterator[Array]:
    """Changes in the null space of least sum of absolute values, for each parameter in which it is 1."""
    import scipy.optimize  # slow, and help loads this module

    for k in np.flatnonzero(np.abs(hidden).max(axis=1) > _LEAST):
        one = np.eye(len(shown))[k]
        equal = np.vstack([shown.T, one])
        values = np.r_[np.zeros(shown.shape[1]), 1.0]
        found = scipy.optimize.linprog(
            np.ones(2 * len(one)), A_eq=np.hstack([equal, -equal]), b_eq=values
        )
        if found.success:
            yield found.x[: len(one)] - found.x[len(one) :]


def _size(x: Array) -> tuple[int, float]:
    """How many parameters a change moves, and how far in sum."""
    share = np.abs(x) / np.abs(x).max()
    return int((share > _LEAST).sum()), float(share.sum())


def _independent(candidates: Sequence[Array], count: int) -> list[Array]:
    """The first so many changes of which none is named as those before it together. The last candidates are
    an orthonormal basis, so that there are enough.
    """
    found, basis = list[Array](), np.zeros((0, len(candidates[0])))
    for each in candidates:
        beyond = each - basis.T @ (basis @ each)
        beyond -= basis.T @ (basis @ beyond)
        if (size := np.linalg.norm(beyond)) > _LEAST * np.linalg.norm(each):
            basis = np.vstack([basis, beyond / size])
            found.append(each)
        if len(found) == count:
            break
    return found


def _combination(declared: Sequence[Declared], x: Array, width: Array) -> NullCombination:
    """A change in standard deviations of priors, (P,), by the parameters that it moves."""
    x = x / np.abs(x).max()
    order = np.argsort(-np.round(np.abs(x), _DIGITS), kind="stable")
    large = [k for k in order if abs(x[k]) > _LEAST]
    x *= np.sign(x[large[0]])
    factor = [declared[k].unit.startswith(_LOG) for k in large]
    by = [float(x[k] * width[k]) * (100 if of else 1) for k, of in zip(large, factor, strict=True)]
    units = ["%" if of else declared[k].unit for k, of in zip(large, factor, strict=True)]
    names = [declared[k].name for k in large]
    return NullCombination(dict(zip(names, by, strict=True)), dict(zip(names, units, strict=True)))
