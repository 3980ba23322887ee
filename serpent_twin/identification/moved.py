"""Find the parameters that calibration had to move further than parts differ as they are built.

A fault can hide in a declared parameter: the fit is then good, and the parameter is not what was built.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.score_test import Score
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import Quantity

_FAR = 3.0
"""Tolerances, and standard errors, beyond which a single parameter is not what was built"""
LIKE = 0.5
"""Least cosine between the changes of a parameter and of an effect, for one to stand for the other"""
_NAMED = 3
ABSENT = 0.01
"""Share of what is expected below which a number is as good as absent"""


@dataclass(frozen=True)
class Moved:
    """A declared parameter that is not what was built."""

    coordinate: str
    """Name of the parameter in the fit"""
    name: str
    """What it stands for, such as `winch radius, motor 3`"""
    value: float
    """Where the fit ended, in the unit"""
    expected: float
    """What was declared, or the median of the parts that are built alike, in the unit"""
    unit: str
    """Such as `mm`"""
    widths: float
    """How far it is from that, in tolerances of parts as built, or in widths of its prior"""
    stands_for: Mapping[str, float]
    """Effects that change the residual likewise, the most alike first, with the cosine"""

    def numbers(self) -> dict[str, Any]:
        """Entries of diagnosis.json."""
        return {
            "name": self.coordinate,
            "quantity": self.name,
            "value": self.value,
            "expected": self.expected,
            "unit": self.unit or "1",
            "widths": self.widths,
            "stands_for": dict(self.stands_for),
        }

    def __str__(self) -> str:
        """The finding as a clause of a sentence."""
        value = f"{self.value:.3g} {self.unit}".rstrip()
        found = f"{self.name} is {value} where {self.expected:.3g} is expected"
        if abs(self.value) < ABSENT * abs(self.expected):
            return f"{found}: as good as absent".replace("-", "−")
        return f"{found}, {abs(self.widths):.1f} × its tolerance".replace("-", "−")


def too_far(several: int) -> float:
    """Widths beyond which the furthest of several numbers is not what was built: of many, one is far off by
    chance.
    """
    return float(np.sqrt(_FAR**2 + 2 * np.log(max(1, several))))


def moved(case: Case[Any], fit: Fit, scores: Sequence[Score]) -> tuple[Moved, ...]:
    """The parameters that a fit moved too far, the furthest first; with scores of candidates on top of it."""
    several, names = case.quantities, [each.name for each in case.declared]
    value, error = np.zeros(len(several)), np.full(len(several), np.inf)
    for k, each in enumerate(several):
        of = [names.index(name) for name in each.of]
        value[k] = each.after(float(fit.point.declared[of].sum()))
        error[k] = fit.standard_error(of) * (abs(each.scale) or 1.0)
    found, most = [], too_far(len(fit.free.declared))
    for k, each in enumerate(several):
        expected, width = _expected(several, value, k), each.tolerance
        if np.isfinite(width * expected):
            off = each.beside(value[k], expected)
        else:
            built = case.machine.declared[k].prior
            off, width, expected = fit.point.declared[k], built, each.after(0.0)
            error[k] = fit.standard_error([k])
        far = abs(off) > most * max(width, error[k])
        if k in fit.free.declared and (far or names[k] in case.widened):
            like = _like(case, fit, scores, k)
            unit = "" if each.unit == "1" else each.unit
            found.append(Moved(names[k], each.name, value[k], expected, unit, off / width, like))
    return tuple(sorted(found, key=lambda each: -abs(each.widths)))


def _expected(several: Sequence[Quantity], value: Array, k: int) -> float:
    """The median of the other parts that are built alike, or what was declared."""
    if not several[k].alike:
        return several[k].nominal
    others = [n for n, each in enumerate(several) if each.alike == several[k].alike and n != k]
    alone = [n for n in others if len(several[n].of) == len(several[k].of)]
    return float(np.median(value[alone])) if alone else float("nan")


def _like(case: Case[Any], fit: Fit, scores: Sequence[Score], k: int) -> dict[str, float]:
    """Effects that change the residual as one declared parameter does, beyond all others."""
    known, at = Information.of(case, fit), fit.free.declared.index(k)
    others = known.without(at)
    ours = others.beyond(known.slopes[at].astype(float))
    cosine = {}
    for each in scores:
        theirs = others.beyond(each.change.astype(float))
        length = np.linalg.norm(ours) * np.linalg.norm(theirs)
        cosine[each.name] = abs(float(ours @ theirs / length)) if length > 0 else 0.0
    best = sorted(cosine, key=lambda name: -cosine[name])[:_NAMED]
    return {name: round(cosine[name], 3) for name in best if cosine[name] > LIKE}
