"""Hold which parameters and effects logs can tell: the key `identifiability` of diagnosis.json."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from serpent_twin.identification.excitation import InputExcitation
from serpent_twin.identification.fitting.null_space import NullCombination
from serpent_twin.identification.fitting.weak_directions import WeakDirection
from serpent_twin.identification.wording import spaced
from serpent_twin.numerals import counted, listed
from serpent_twin.residual import SessionChange, settling_text

ALIKE = 0.8
"""Cosine of what two effects change beyond the parameters, above which the logs confound them"""


@dataclass(frozen=True)
class ParameterIdentifiability:
    """What the logs tell of one declared parameter."""

    name: str
    """The quantity, such as `strand stiffness 3+`"""
    unit: str
    """Unit of both standard deviations"""
    prior: float
    """Standard deviation before the logs"""
    posterior: float
    """Standard deviation with the logs"""
    variance_inflation: float
    """Posterior variance over the variance with all other parameters known [1]"""
    confounded_with: str
    """The parameter or effect whose error its own is most correlated with"""
    correlation: float
    """Correlation of the two errors [1]"""

    @property
    def ratio(self) -> float:
        """Ratio of posterior to prior [1]."""
        return self.posterior / self.prior

    def numbers(self) -> dict[str, Any]:
        """The figures for JSON; standard deviations are in the unit beside them."""
        return vars(self) | {"ratio": self.ratio}


@dataclass(frozen=True)
class EffectIdentifiability:
    """How weak an effect these logs can tell, in the unit of its strength."""

    name: str
    parameter: str
    """The name of its strength"""
    unit: str
    typical: float
    """A strength that the machine may well have"""
    by_scatter: float
    """Strength that is three standard errors from zero; infinite where none within its range is"""
    by_gain: float
    """Strength that betters the error by as much as an accepted effect must; infinite where none does"""
    taken_up: float
    """Share of what it changes, in squares, that the declared parameters take up [1]"""
    confounded_with: Mapping[str, float]
    """Effects that change the same beyond the parameters, with the cosine"""
    why: str = ""
    """Why these logs cannot show it at all; else empty"""
    beside: str = ""
    """Its other parameters, for which the limit holds, such as `grip of 3 N`"""

    @property
    def limit(self) -> float:
        """The least strength that a trace of these logs would accept."""
        return max(self.by_scatter, self.by_gain)

    @property
    def told(self) -> bool:
        """Whether a typical strength would be found."""
        return self.limit <= self.typical

    @property
    def delay(self) -> bool:
        """Whether it is a delay, which makes everything else look like something else."""
        return self.unit == "s"

    def numbers(self) -> dict[str, Any]:
        """The figures for JSON; strengths are in the unit beside them."""
        return vars(self) | {"limit": self.limit, "can_be_told": self.told}


@dataclass(frozen=True)
class Identifiability:
    """What logs can tell at all."""

    parameters: tuple[ParameterIdentifiability, ...]
    effects: tuple[EffectIdentifiability, ...]
    """Delays first, then the others, those that are hardest to tell first"""
    directions: tuple[WeakDirection, ...]
    """The weakest combinations of parameters"""
    inputs: tuple[InputExcitation, ...]
    """Motors and joints"""
    advice: str
    """What motion would help, in a sentence; empty where all can be told"""
    rows: int
    """Rows of the logs that a fit uses"""
    variance_inflation: float
    """Numbers of a calibrated residual that weigh as one"""
    notes: tuple[str, ...] = ()
    """What was put right in the logs, and how runs begin where the logs do not say it"""
    not_sought: tuple[str, ...] = ()
    """Sentences on effects that are not sought, and on what nothing measures"""
    settled: tuple[SessionChange, ...] = ()
    """What changes with the time since each session began, before any fit"""
    combined: tuple[NullCombination, ...] = ()
    """Changes of parameters that no row shows, and which logs therefore leave as they were"""

    @property
    def hidden(self) -> list[str]:
        """Effects that cannot be told."""
        return [each.name for each in self.effects if not each.told]

    def sentence(self) -> str:
        """What can be told and what cannot, and what changes with the time in a session."""
        return " ".join([self._told(), *map(settling_text, self.settled)])

    def _told(self) -> str:
        still = [each.name for each in self.inputs if each.still]
        held = f" {listed(still).capitalize()} never {_verb(still)}." if still else ""
        count = counted(len(self.effects), "effect")
        if not self.hidden:
            return f"These logs can show all {count} at a typical strength.{held}"
        names = listed(spaced(name) for name in self.hidden)
        said = f"Of {count}, these logs cannot show {names} at a typical strength."
        return " ".join(filter(None, [f"{said}{held}", self.advice]))

    def power(self) -> str:
        """Strengths from which on effects would have been found, in a sentence or two."""
        found = [each for each in self.effects if isfinite(each.limit)]
        limits = listed(f"{spaced(each.name)} of {_amount(each)}" for each in found)
        lost = listed(spaced(each.name) for each in self.effects if not isfinite(each.limit))
        told = [f"Would have been found, from that strength on: {limits}."] if found else []
        told += [f"At no strength within its range: {lost}."] if lost else []
        return " ".join(told)

    def numbers(self) -> dict[str, Any]:
        """The key `identifiability` of diagnosis.json, and identifiability.json."""
        return {
            "can_be_told": not self.hidden,
            "sentence": self.sentence(),
            "parameters": [each.numbers() for each in self.parameters],
            "effects": [each.numbers() for each in self.effects],
            "weakest_directions": [
                vars(each) | {"ratio": each.ratio, "text": str(each)} for each in self.directions
            ],
            "not_separated": [each.numbers() for each in self.combined],
            "inputs": [each.numbers() for each in self.inputs],
            "settles_in_session": [vars(each) for each in self.settled],
            "rows": self.rows,
            "variance_inflation": self.variance_inflation,
            "not_sought": list(self.not_sought),
        } | ({"notes": list(self.notes)} if self.notes else {})


def _amount(effect: EffectIdentifiability) -> str:
    unit = "" if effect.unit == "1" else f" {effect.unit}"
    return f"{effect.limit:.2g}{unit}" + (f" ({effect.beside})" if effect.beside else "")


def _verb(names: Sequence[str]) -> str:
    return "moves" if len(names) == 1 else "move"
