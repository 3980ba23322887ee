"""Take from a diagnosis how weak an effect of each kind it would have found: its stated detection limits."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from serpent_twin.effects import Effect, ranges, strengths
from serpent_twin.machines.arm.catalogue import CATALOGUE


def stated_limits(diagnosis: Mapping[str, Any]) -> dict[str, float]:
    """The detection limit of each effect of the catalogue that the logs can show at all, in the unit of its
    strength; of an effect with several strengths, their length.
    """
    stated = diagnosis["identifiability"].get("effects", [])
    return {
        each["name"]: each["limit"] * _length(CATALOGUE[each["name"]])
        for each in stated
        if each["name"] in CATALOGUE and each["limit"] is not None and np.isfinite(each["limit"])
    }


def times_limit(effect: Mapping[str, Any], limits: Mapping[str, float]) -> float:
    """How many times its stated detection limit a true effect has; NaN where none is stated."""
    values = [effect["parameters"][name] for name in effect["strong"]]
    return float(np.linalg.norm(values) / limits.get(effect["name"], np.nan))


def _length(kind: type[Effect]) -> float:
    """Of all strengths of an effect, over the largest of them, for which a limit is stated."""
    variant = kind.variants()[0]
    each = np.array([getattr(variant, name) for name in strengths(ranges(kind))])
    return float(np.linalg.norm(each) / np.abs(each).max())
