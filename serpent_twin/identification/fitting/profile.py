"""Find the interval of a strength near zero from the profile of the cost.

A standard error takes the residual as linear in a strength. Many laws bend there: a threshold is not reached,
hinges stick. So the strength is held at trial values, all else is fitted again with the last derivative, and
the interval ends where the cost has risen by what a standard error would stand for (Venzon and Moolgavkar,
Applied Statistics 37, 1988).
"""

from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.identification.fitting.fitted import NORMAL_95, Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters, curved
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import OnProgress, fit
from serpent_twin.machines.case import Case

NEAR = 4.0
"""Standard errors from zero within which a strength's interval is taken from the profile. They are those that
it had if all else were known: what others could do in its place is no bend of its law
"""
_TRIALS, _FAIR = 4, 0.05
"""Trial values on each side, and how near the rise of the cost must come to what is looked for, as a share of
its root"""


def near_zero(case: Case[Any], found: Fit, name: str, index: int) -> bool:
    """Whether an effect's parameter is so near to zero that its law may bend there."""
    at = len(found.free.declared) + found.free.effects.index((name, index))
    known = Information.of(case, found).matrix
    disagreement = found.error[at] / np.sqrt(np.linalg.inv(known)[at, at])
    alone = disagreement / np.sqrt(known[at, at])
    return bool(abs(found.point.effects[name][index]) < NEAR * alone)


def interval(
    case: Case[Any], pieces: Any, found: Fit, name: str, index: int, on_progress: OnProgress
) -> tuple[float, float]:
    """The 95 % interval of an effect's parameter by the profile of the cost, within its range."""
    on_progress(f"interval of {name}")
    profile = _Profile(case, pieces, found, name, index)
    allowed = list(case.candidates[name].ranges.values())[index]
    return profile.end(allowed.least), profile.end(allowed.high)


class _Profile:
    """The least cost with one parameter held, above that of the fit."""

    def __init__(self, case: Case[Any], pieces: Any, found: Fit, name: str, index: int) -> None:
        self.case, self.pieces, self.name, self.index = case, pieces, name, index
        at = len(found.free.declared) + found.free.effects.index((name, index))
        kept = np.arange(len(found.free)) != at
        rest = tuple(each for each in found.free.effects if each != (name, index))
        self.found, self.value = found, float(found.point.effects[name][index])
        self.held = replace(
            found,
            free=FreeParameters(found.free.declared, rest),
            jacobian=found.jacobian[kept],
            error=found.error[kept],
            correlation=found.correlation[np.ix_(kept, kept)],
        )
        covariance = np.linalg.inv(Information.of(case, found).matrix)
        self.along = covariance[kept, at] / covariance[at, at]
        """How far all else moves with the parameter, to first order"""
        self.error = float(found.error[at])
        self.wanted = NORMAL_95 * self.error / float(np.sqrt(covariance[at, at]))
        """Root of the rise of the cost at the ends: more than 1.96 where segments disagree"""

    def end(self, bound: float) -> float:
        """The end of the interval towards a bound of the range; the bound, if the cost rises too little."""
        side = np.sign(bound - self.value)
        inside, outside = (0.0, 0.0), None
        step = NORMAL_95 * self.error
        for _ in range(_TRIALS):
            step = min(step, abs(bound - self.value))
            rise = self._rise(self.value + side * step)
            if abs(rise - self.wanted) < _FAIR * self.wanted:
                break
            if rise > self.wanted:
                outside = (step, rise)
            elif step >= abs(bound - self.value):
                break
            else:
                inside = (step, rise)
            step = self._next(inside, outside)
        return float(self.value + side * step)

    def _next(self, inside: tuple[float, float], outside: tuple[float, float] | None) -> float:
        """Where the root of the rise, which is straight for a linear residual, reaches what is wanted."""
        if outside is None:
            return inside[0] * float(np.clip(self.wanted / max(inside[1], 1e-9), 1.2, 5.0))
        share = (self.wanted - inside[1]) / (outside[1] - inside[1])
        return inside[0] + share * (outside[0] - inside[0])

    def _rise(self, value: float) -> float:
        """Root of the cost above the fit's with the parameter at a value."""
        values = self.found.point.effects[self.name].copy()
        values[self.index] = value
        point = self.found.point.having(self.name, values)
        point = curved(self.case, point, self.held.free, self.along * (value - self.value))
        most = len(self.found.used)
        again = fit(self.case, self.pieces, point, self.held.free, 0, most, carried=self.held)
        squares = float((again.residual.astype(float) ** 2).sum()) / self.found.variance_inflation
        lean = [again.point.declared[k] / self.case.declared[k].prior for k in again.free.declared]
        return float(np.sqrt(max(0.0, squares + float(np.sum(np.square(lean))) - self.found.cost)))
