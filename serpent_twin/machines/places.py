"""Hold what a machine shows, to first order, of a change at each of its places."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from serpent_twin.arrays import Array


@dataclass(frozen=True)
class PlaceResponse:
    """What a change of one quantity at one place does to the prediction in the same row."""

    handle: str
    """The quantity, of `effects.law.HANDLES`"""
    place: str
    """MuJoCo's name"""
    change: Array
    """Of the prediction per unit, of each component, (d, S, T, C)"""


class Places(Protocol):
    """Where reality may differ from a machine's twin, and on what that may depend."""

    @property
    def readings(self) -> Mapping[tuple[str, str], Array]:
        """What laws may follow, (S, T), by the reading and its place."""
        ...

    @property
    def responses(self) -> Sequence[PlaceResponse]:
        """Of every quantity at every place."""
        ...
