"""Hold a law at a place with what it would remove, to first order."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from serpent_twin.arrays import Array
from serpent_twin.effects.law import Law
from serpent_twin.effects.law_shape import SHAPES

PER_PARAMETER = 8.0
"""Squared standard errors that a parameter of a law's form must be worth"""
APART = 9.0
"""Two laws are distinguished if one removes more than the other by this many squared standard errors"""
_NEARLY = 0.9
"""Two laws are distinguished to first order only if one removes less than this fraction of the other"""
_STEPS = ("above", "under", "within")


@dataclass(frozen=True)
class Composed:
    """A law at a place, with what it would remove."""

    law: Law
    size: Array
    """Size of each component"""
    first: float
    second: float
    gain: float
    """Twice the logarithm of the likelihood ratio, where the noise is what would be left [1]"""
    share: float
    """Share of the residual's squares [1]"""
    alone: bool = False
    """Whether it shows in one sensor alone"""
    declared: bool = False
    """Whether declared parameters could do the same, were it not for their priors"""
    flat: bool = False
    """Whether a direction of its vector shows nowhere, as a turn about the line from a joint to one marker"""
    shapes: Mapping[str, "Composed"] = field(default_factory=dict)
    """The best of each other shape that changes and follows the same"""

    @property
    def alike(self) -> dict[str, tuple[float, float]]:
        """Numbers of other steps or windows that first order cannot distinguish from this one."""
        if self.law.shape not in _STEPS:
            return {}
        near = {name: one for name, one in self.shapes.items() if name in _STEPS}
        return {n: (one.first, one.second) for n, one in near.items() if self.is_like(one)}

    def is_like(self, other: "Composed") -> bool:
        """Whether first order cannot distinguish another from it."""
        return other.gain > min(self.gain - APART, _NEARLY * self.gain)

    @property
    def worth(self) -> float:
        """The gain less what its parameters are to be worth [1]."""
        return self.gain - PER_PARAMETER * (self.size.size + len(SHAPES[self.law.shape].parameters))


def from_then_on(found: Composed) -> Composed:
    """A law that holds until an instant as one that holds from then on, if that gains nearly as much: what
    was built is what there was first.
    """
    later = found.shapes.get("above")
    if found.law.shape != "under" or found.law.follows_a_thing or later is None:
        return found
    others = {name: each for name, each in found.shapes.items() if name != "above"}
    swapped = replace(later, shapes={**others, "under": replace(found, shapes={})})
    return swapped if later.gain > _NEARLY * found.gain else found
