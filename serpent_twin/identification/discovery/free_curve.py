"""Test the form of a composed law: beside a free curve of eight knots in its place."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import place_of
from serpent_twin.effects.law import HANDLES, Law, parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.candidates import FORM
from serpent_twin.identification.discovery.screen import Search
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.machines.case import Case
from serpent_twin.machines.places import response_at

_KNOTS = 8
_UNSETTLED = 30.0
"""Squared standard errors by which the free curve must be better for the law to be unsettled"""
_ALIKE = 0.03
"""The free curve confirms a law within this fraction of it: first order is not more exact"""
_FINE = 200


@dataclass(frozen=True, eq=False)
class FreeCurve:
    """A composed law and what logs say of it, along its direction, over the reading that it follows."""

    law: Law
    units: Mapping[str, str]
    """Units of the law's numbers"""
    knots: Array
    """Values of the reading; of a periodic law, of its phase [rad]; of play and lag, of how far what the
    reading drags along is behind, (8,)
    """
    free: Array
    """The free curve there, in the unit of what is changed, (8,)"""
    error: Array
    """Standard errors of the free curve, (8,)"""
    reading: Array
    """Finer values of the reading, (K,)"""
    fitted: Array
    """The law there, (K,)"""
    gain: float
    """Squared standard errors by which the free curve is better [1]"""
    apart: float
    """How far it is from the law at the knots, to the law there [1]"""

    @property
    def settled(self) -> bool:
        """Whether no other curve describes the training logs better."""
        return self.gain < _UNSETTLED or self.apart < _ALIKE

    @property
    def folded(self) -> bool:
        """Whether the reading is a phase."""
        return self.law.shape == "periodic"

    def numbers(self) -> dict[str, Any]:
        """Entries of diagnosis.json."""
        curve = {"reading": self.knots, "size": self.free, "error": self.error}
        return {
            "law_is_settled": self.settled,
            "curve": {name: values.tolist() for name, values in curve.items()},
        }


def free_curve(case: Case[Any], training: Any, fit: Fit, name: str) -> FreeCurve | None:
    """The law of a fitted effect beside a free curve; None for a constant, which follows nothing."""
    law, values = parse(place_of(name)), fit.point.effects[name]
    some = case.take(training, fit.used)
    places = case.places(fit.point, some)
    if not law.reading or places is None:
        return None
    first, second = values[FORM : FORM + 2]
    components = HANDLES[law.handle].components
    size = values[:components]
    length = float(np.linalg.norm(size)) if components > 1 else float(size[0])
    along = size / (length or 1.0)
    response = response_at(places, law)
    x = places.readings[law.reading, law.where]
    search = Search.of(case, some, fit, places)
    x = search.in_time.seen(SHAPES[law.shape], x, float(first)).ravel()
    phase = law.shape == "periodic"
    seen = np.mod(first * x + second, 2 * np.pi) if phase else x
    ends = (0.0, 2 * np.pi) if phase else (float(x.min()), float(x.max()))
    knots = np.linspace(*ends, _KNOTS + phase)[:_KNOTS] if phase else _spread(x)
    off, error, gain = search.together(
        response.along(along),
        _hats(seen, knots, 2 * np.pi if phase else None),
    )
    fine = np.linspace(*ends, _FINE)
    form = SHAPES[law.shape].form
    at, there = (
        length * (np.sin(each) if phase else form(each, first, second)) for each in (knots, fine)
    )
    apart = float(np.linalg.norm(off) / max(float(np.linalg.norm(at)), 1e-30))
    return FreeCurve(law, case.units_of_law(law), knots, at + off, error, fine, there, gain, apart)


def _spread(x: Array) -> Array:
    """Knots at even ranks of a reading."""
    knots = np.unique(np.quantile(x, np.linspace(0, 1, _KNOTS)))
    return knots if len(knots) == _KNOTS else np.linspace(x.min(), x.max(), _KNOTS)


def _hats(x: Array, knots: Array, period: float | None) -> Array:
    """Piecewise linear functions that are 1 at one knot each, (8, N)."""
    return np.array([np.interp(x, knots, one, period=period) for one in np.eye(len(knots))])
