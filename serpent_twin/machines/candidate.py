"""Hold an effect that a machine may have and its nominal twin lacks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Range, place_of, placed, ranges
from serpent_twin.effects.effect import Effect


@dataclass(frozen=True)
class Candidate:
    """An effect that the machine may have and its nominal twin lacks."""

    name: str
    ranges: Mapping[str, Range]
    """Its parameters, the strength first"""
    variants: tuple[Array, ...]
    """Plausible values of all parameters: where fits start"""
    about: str = ""
    """What it is, in a sentence"""
    shows_in: str = ""
    """How it shows in a log"""
    confused_with: tuple[str, ...] = ()
    """Names of candidates that look like it"""
    remembers: bool = False
    """Whether its memory is longer than a segment"""
    model_error: float = Effect.model_error
    """Relative standard error of its parameters for what its law simplifies, as the effect states it"""
    place_kind: str = ""
    """Kind of the model's element that its name has: joint, tendon, actuator, body, site or sensor; nothing
    for what is everywhere
    """
    whole: bool = False
    """Whether its variants are tried as they are, and not each of their strengths alone"""
    composed: Mapping[str, Any] = field(default_factory=dict)
    """Entries of JSON that say which law it is; empty for an effect that has a name"""
    alike: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Other shapes of its law that fit the logs as well to first order, with their numbers"""
    flat: bool = False
    """Whether a direction of its vector shows nowhere, so that a fit leaves it open"""
    places: tuple[str, ...] = ()
    """Other places at which its law could be"""
    alternatives: tuple["Candidate", ...] = ()
    """Candidates for the same change by other readings or in another shape, which remove nearly as much to
    first order
    """

    @property
    def at(self) -> str:
        """The place that its name has."""
        return place_of(self.name)

    @property
    def place(self) -> dict[str, Any]:
        """The entries of JSON that say where it is, and by which law if it was composed; nothing for what is
        everywhere.
        """
        if self.composed:
            return dict(self.composed)
        return {"place": {"kind": self.place_kind, "name": self.at}} if self.at else {}

    def is_law_beside(self, other: "Candidate", entries: Sequence[str] = ("place",)) -> bool:
        """Whether both are composed laws, and equal in some of their entries of JSON."""
        both = self.composed and other.composed
        return bool(both) and all(self.composed[n] == other.composed[n] for n in entries)


def candidate(name: str, **sized: Range) -> Candidate:
    """An effect, perhaps at a place, with its own ranges or with ranges for a machine of another size than
    the arm's.
    """
    kind, _ = placed(name)
    known = {n: sized.get(n, r) for n, r in ranges(kind).items()}
    variants = dict.fromkeys(
        tuple(sized[n].typical if n in sized else getattr(v, n) for n in known)
        for v in kind.variants()
    )
    return Candidate(
        name,
        known,
        tuple(np.array(values) for values in variants),
        (kind.__doc__ or "").split("\n")[0].strip(),
        kind.shows_in,
        kind.confused_with,
        kind.remembers,
        kind.model_error,
        next(iter(kind.places), "") if place_of(name) else "",
    )
