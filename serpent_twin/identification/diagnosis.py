"""Hold what a trace finds: the figures of diagnosis.json and of the report."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from serpent_twin.arrays import Array
from serpent_twin.effects import law_of, place_of
from serpent_twin.effects.discovered import DISCOVERED
from serpent_twin.effects.law import parse
from serpent_twin.effects.law_causes import look_for
from serpent_twin.identification.acceptance import PairTrial
from serpent_twin.identification.bars import Bars
from serpent_twin.identification.discovery.free_curve import FreeCurve
from serpent_twin.identification.estimates import Calibrated, ParameterEstimate
from serpent_twin.identification.identifiability import Identifiability
from serpent_twin.identification.moved import Moved
from serpent_twin.identification.next_motion import NOT_EXCITED, next_motion
from serpent_twin.identification.rivals import Rival
from serpent_twin.identification.unexplained import SUSPECT, Unexplained
from serpent_twin.identification.wording import spaced
from serpent_twin.residual import LOADS, MARKERS, Comparison, Findings, Measure
from serpent_twin.residual.learned import Learned
from serpent_twin.residual.whiteness import Whiteness

_LISTED = 3
ACCEPTED, REJECTED = "accepted", "rejected"
UNSTABLE = "unstable"
STANDS_IN = "stands in"
UNTESTED = (NOT_EXCITED, UNSTABLE)
"""Verdicts on candidates that these logs, or the simulation, leave undecided"""


@dataclass(frozen=True)
class Named:
    """An effect that the twin lacked."""

    name: str
    parameters: Mapping[str, ParameterEstimate]
    gain: float
    """Reduction of the held-out marker error"""
    gain_load: float
    """Reduction of the held-out load error"""
    probability_of_chance: float
    """Probability of no gain at all [1]"""
    judged_on: str
    """The logs by which it was accepted, in words"""

    def numbers(self, unit: str, load: Measure) -> dict[str, Any]:
        """Entries of diagnosis.json."""
        return {
            "name": self.name,
            "parameters": {name: vars(each) for name, each in self.parameters.items()},
            f"gain_{unit}": self.gain,
            f"gain_{load.field}_{load.key}": self.gain_load,
            "probability_of_chance": self.probability_of_chance,
            "judged_on": self.judged_on,
        }


@dataclass(frozen=True)
class Tried:
    """A candidate and its verdict."""

    name: str
    error: float
    """Held-out marker error with it; of the twin without it, where it was not fitted fully"""
    verdict: str
    """accepted, rejected, not excited or unstable"""
    score: float
    """Share of the residual's squares that it would remove, to first order [1]"""
    gain_by_segment: Array | None
    """Gain on each held-out segment, if it was fitted"""
    why: str
    """Reason for the verdict, in words"""
    doubt: float | None = None
    """Probability of chance, where these logs were better described with it, and more may show it [1]"""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that a trace finds; errors are in the units of `marker` and `load`."""

    arm: str
    held_out: tuple[str, ...]
    """Files of the sessions that nothing was fitted to"""
    effects: tuple[Named, ...]
    candidates: tuple[Tried, ...]
    unexplained: Unexplained
    error: Mapping[str, float]
    """nominal, calibrated, corrected, noise_floor; and expected: of a twin that lacks nothing"""
    load_error: Mapping[str, float]
    """nominal, calibrated, corrected, noise_floor"""
    cautions: tuple[str, ...]
    """What the data cannot identify, in sentences"""
    calibration: Mapping[str, Calibrated]
    """Declared parameters by their names in the fit"""
    comparisons: Mapping[str, Comparison]
    """nominal, calibrated, corrected: measured beside predicted on held-out segments"""
    findings: Mapping[str, Findings]
    """calibrated, corrected: what the residual depends on"""
    learned: Learned
    """The last resort, apart from physics"""
    bars: Bars
    """How large the pose's error may be before it is unexplained"""
    moved: tuple[Moved, ...] = ()
    """Declared parameters that are not what was built, the furthest first"""
    stand_ins: tuple[Named, ...] = ()
    """Effects of the corrected twin that come nearest to what it lacks, but are not its cause"""
    rivals: Mapping[str, tuple[Rival, ...]] = field(default_factory=dict)
    """Other effects that look like each effect, by its name"""
    pairs: tuple[PairTrial, ...] = ()
    """Pairs of candidates that were tried together"""
    marker: Measure = MARKERS
    """What the error is of"""
    load: Measure = LOADS
    """What the load error is of"""
    identifiability: Identifiability | None = None
    """What the logs can tell at all"""
    whiteness: Whiteness | None = None
    """Whiteness of the corrected twin's residual"""
    places: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """The entry that says where a candidate acts, by its name: empty for one that acts everywhere"""
    curves: Mapping[str, FreeCurve] = field(default_factory=dict)
    """Composed laws beside free curves, by the effect's name"""
    shapes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of each composed effect with other shapes of its law that fit the logs as well, by its name"""
    shown: Comparison | None = None
    """All sessions beside the nominal twin, of which a first picture shows one"""

    def numbers(self, seconds: float, simulated: float) -> dict[str, Any]:
        """diagnosis.json."""

        def placed(entry: dict[str, Any]) -> dict[str, Any]:
            return entry | dict(self.places.get(entry["name"], {}))

        def found(each: Named) -> dict[str, Any]:
            entry = placed(each.numbers(mm, self.load))
            if entry["name"] == each.name:
                return entry
            tested = self.curves[each.name].numbers() if each.name in self.curves else {}
            tested["look_for"] = look_for(parse(place_of(each.name)))
            alike = [placed({"name": name}) for name in self._alike(each.name)]
            return entry | tested | {"equivalent": alike}

        mm, loads = self.marker.key, f"{self.load.field}_error_{self.load.key}"
        return {
            "arm": self.arm,
            "held_out": list(self.held_out),
            "effects": [found(each) for each in self.effects],
            "stand_ins": [found(each) for each in self.stand_ins],
            "candidates": [
                placed(
                    {
                        "name": each.name,
                        f"error_{mm}": each.error,
                        "verdict": each.verdict,
                        "score": each.score,
                        "why": each.why,
                    }
                )
                for each in self.candidates
            ],
            "unexplained": {
                "is": self.unexplained.is_,
                "share": self.unexplained.share,
                "depends_on": self.unexplained.depends_on,
            },
            f"error_{mm}": dict(self.error),
            loads: dict(self.load_error),
            "learned": {
                "share": self.learned.share,
                "on": self.learned.on,
                f"before_{mm}": self.learned.before,
                f"after_{mm}": self.learned.after,
            },
            "cautions": list(self.cautions),
            "power": self.power,
            "bars": self.bars.numbers(self.marker.key),
            "moved": [each.numbers() for each in self.moved],
            "rivals": {
                name: [placed(each.numbers(mm)) for each in several]
                for name, several in self.rivals.items()
            },
            "next_motion": next_motion(
                self.rivals,
                {each.name: each.verdict for each in self.candidates},
                {
                    each.name: each.doubt
                    for each in sorted(self.candidates, key=lambda each: each.error)
                    if each.doubt is not None
                },
            ),
            "pairs": [each.numbers() for each in self.pairs],
            "calibration": {name: each.numbers() for name, each in self.calibration.items()},
            "residual": {name: each.numbers() for name, each in self.findings.items()},
            "identifiability": self.identifiability.numbers() if self.identifiability else {},
            "whiteness": self.whiteness.numbers() if self.whiteness else {},
            "seconds": seconds,
            "share_of_time_in_simulation": simulated / seconds if seconds else 0.0,
        }

    @property
    def blind(self) -> bool:
        """Whether the logs cannot show any candidate."""
        return bool(self.candidates) and all(each.verdict in UNTESTED for each in self.candidates)

    @property
    def doubt(self) -> str:
        """A sentence on an error that is too large for a twin that lacks nothing, yet not called
        unexplained because it depends on nothing; else empty.
        """
        left, expected = self.error["corrected"], self.error.get("expected", float("nan"))
        if self.unexplained.is_ or not left > SUSPECT * expected:
            return ""
        return (
            f"What is left is {left / expected:.1f} × what a twin that lacks nothing leaves "
            f"({expected:.2f} {self.marker.unit}), but follows nothing that was looked at: something small "
            "may be missing."
        )

    @property
    def power(self) -> str:
        """Where nothing was found: how strong an effect would have had to be; else empty."""
        if self.effects or self.unexplained.is_ or self.identifiability is None:
            return ""
        return self.identifiability.power()

    @property
    def not_as_built(self) -> str:
        """A sentence on declared parameters that are not what was built; else empty."""
        if not self.moved:
            return ""
        more = f"; {len(self.moved) - _LISTED} more likewise" if len(self.moved) > _LISTED else ""
        like = [_short(name) for each in self.moved[:1] for name in each.stands_for]
        may = (
            f" It may stand for {' or '.join(like)}, which changes the logs likewise."
            if like
            else ""
        )
        return f"Not as built: {'; '.join(map(str, self.moved[:_LISTED]))}{more}.{may}"

    def _alike(self, name: str) -> list[str]:
        """The effects that these logs cannot distinguish from one."""
        rivals = [each.name for each in self.rivals.get(name, ()) if not each.told_apart]
        return [*rivals, *self.shapes.get(name, ())]


def _short(name: str) -> str:
    return spaced(name) if law_of(name) == DISCOVERED else name
