"""Hold what was estimated of an effect or of the model, with intervals and units."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ParameterEstimate:
    """One number of an effect with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str
    """`1` for a pure number"""
    determined: bool = True
    """Whether the logs determine it; else it may lie anywhere in the interval, and its value is no finding"""

    @property
    def fitted(self) -> bool:
        """Whether it was fitted to the logs; else it was given."""
        return bool(isfinite(self.low) and isfinite(self.high) and self.low < self.high)

    def __str__(self) -> str:
        """The estimate as text for a sentence."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if not self.determined:
            ends = f"within {self.low:.3g} … {self.high:.3g}{unit}"
            return f"not determined by these logs, {ends}".replace("-", "−")
        ends = f"[{self.low:.3g} … {self.high:.3g}]" if self.fitted else "[given]"
        return f"{self.value:.3g}{unit} {ends}".replace("-", "−")


def length_of(components: Sequence[ParameterEstimate]) -> ParameterEstimate:
    """The length of a vector, with the interval that its components have along it."""
    values = np.array([each.value for each in components])
    length = float(np.linalg.norm(values))
    along = values / max(length, 1e-30)
    half = np.hypot.reduce(
        [a * (e.high - e.low) / 2 for a, e in zip(along, components, strict=True)]
    )
    return ParameterEstimate(length, length - float(half), length + float(half), components[0].unit)


@dataclass(frozen=True)
class Calibrated:
    """A declared parameter before and after the fit."""

    coordinate: ParameterEstimate
    """How far the fit moved it, in the fit's coordinates"""
    name: str
    """What it stands for, such as `strand stiffness 3+`"""
    nominal: float
    """Value declared before any log was read, in the unit of `value`; NaN where nothing is declared"""
    start: float
    """Value at which the fit started, in the unit of `value`"""
    value: ParameterEstimate
    """Where it ended"""

    def numbers(self) -> dict[str, Any]:
        """Entries of diagnosis.json: the coordinate, then the quantity by keys that end with its unit."""
        unit = key(self.value.unit)
        told = {"nominal": self.nominal, "start": self.start, "value": self.value.value}
        told |= {"low": self.value.low, "high": self.value.high}
        named = {f"{name}_{unit}" if unit else f"{name}_ratio": v for name, v in told.items()}
        return vars(self.coordinate) | {"quantity": self.name} | named


def key(unit: str) -> str:
    """A unit as the end of a key in JSON; nothing for a pure number."""
    if unit == "1":
        return ""
    for sign, word in (("/", " per "), ("°", "deg"), ("²", "2"), ("%", "percent")):
        unit = unit.replace(sign, word)
    return "_".join(unit.split())
