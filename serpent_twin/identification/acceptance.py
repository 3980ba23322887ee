"""Accept an effect only if its gain on held-out logs is significant and justifies its parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.held_out import CONFIRMED, Errors, Gain, gain
from serpent_twin.identification.rivals import APART, Pair, Rival
from serpent_twin.identification.score_test import (
    EXCITED,
    Score,
    limits,
    strengths,
    too_strong,
)
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case

MIN_GAIN = 0.04
"""Least relative gain on held-out logs of an accepted effect, markers and loads with equal weight"""
MIN_GAIN_IN_A_SENSOR = 0.08
"""Least relative gain, on its own sensor, of an effect that shows in one sensor alone: of 87 arms that lack
nothing, one law of so many at so many sensors gained 0.05; those of five that had such a fault gained 0.26
and more
"""
CHANCE = 0.01
"""Greatest probability that the gain of an accepted effect is due to chance"""
DECISIVE_GAIN = 0.3
"""Relative gain in all that is measured that is no chance as soon as held-out logs alone confirm it: where
one twin is far off, its errors differ so much from block to block that few blocks show no more
"""
EQUIVALENCE_MARGIN = 0.02
"""Laws that look alike count as equivalent if their held-out errors differ by a smaller share than this: as
long as other parameters are not fitted with them, these make such a difference
"""
MIN_STRENGTH = 0.02
"""Least strength of an accepted effect, in typical ones: less corrects the twin's own arithmetic"""
MIN_Z = 3.0
"""Least distance of an accepted strength from zero, in standard errors"""
DECISIVE_P = 1e-4
"""Probability of chance below which a gain shows by itself that a lone strength is not zero, however much the
segments disagree about its size"""

NEGLECTED = "no more than what the effects before it may neglect"
_LEAST_ERROR = 1e-6
"""Share of an error that is left at least"""
_OUTDONE = 2
"""Candidates that are fitted beside the accepted one that outdid them, whatever a score test says"""


@dataclass(frozen=True)
class CandidateTrial:
    """One candidate in one round."""

    score: Score
    fit: Fit | None
    """None if it was not fitted fully"""
    gain: Gain | None
    error: float
    """Held-out, with it if it was fitted, else without"""
    selected: float = 1.0
    """Probability of chance by the training sessions, each predicted by a fit to the others"""
    errors: Errors | None = None
    """Held-out, with it if it was fitted"""
    fits: float = 0.0
    """Logarithm of the ratio of rms residuals on the training segments, without and with it"""
    opened: bool = False
    """Whether it was fitted from where nothing is calibrated"""
    neglected: float = 0.0
    """Share of what the fit without it leaves that the effects before it may neglect [1]"""

    @property
    def evidence(self) -> float:
        """Reduction of the errors on training and on held-out logs alike, in logarithms: the held-out logs
        of one session alone may prefer a candidate although another fits all others better.
        """
        gained = self.gain.whole if self.gain else 0.0
        return (self.fits - float(np.log(max(1 - gained, _LEAST_ERROR)))) / 2

    @property
    def within_neglect(self) -> bool:
        """Whether it explains no more than what the effects before it may neglect."""
        return self.neglected > 0 and 1 - float(np.exp(-2 * self.fits)) <= self.neglected


@dataclass(frozen=True)
class PairTrial:
    """Two candidates that were fitted together."""

    pair: Pair
    trial: CandidateTrial
    """Trial of the law; its score is the first one's"""
    why_not: str
    """Why the pair is not accepted, or nothing"""

    def numbers(self) -> dict[str, Any]:
        """Entries of diagnosis.json."""
        found = self.trial.gain
        return {
            "names": list(self.pair.names),
            "share": self.pair.share,
            "share_alone": self.pair.alone,
            "gain_held_out": found.relative if found else None,
            "probability_of_chance": found.probability_of_chance if found else None,
            "accepted": not self.why_not,
            "why": self.why_not,
        }


@dataclass(frozen=True)
class Round:
    """All candidates on top of what was accepted before."""

    base: Fit
    errors: Errors
    """Held-out errors of the base"""
    trials: dict[str, CandidateTrial]
    accepted: tuple[str, ...]
    """Name of the candidate that was accepted, two of a pair, or none"""
    pairs: tuple[PairTrial, ...] = ()
    """Pairs that were fitted, where no candidate was accepted alone"""
    undone: str = ""
    """What explains more than this round's candidates, where none of them was accepted in the end"""
    together: bool = False
    """Whether each of several that were accepted stands beside the others, which a pair does not"""

    def scores(self, base: Fit) -> list[Score]:
        """Scores of its candidates on top of a fit, where they are of what that leaves."""
        size, here = base.residual.size, self.base is base
        return [t.score for t in self.trials.values() if here and t.score.change.size == size]


def accepting(rounds: Sequence[Round], name: str) -> int:
    """The number, from 0, of the round that accepted an effect; of several, the last: another may have been
    undone in between.
    """
    return max(n for n, each in enumerate(rounds) if name in each.accepted)


@dataclass(frozen=True)
class Selection:
    """All rounds and the resulting twin."""

    case: Case[Any]
    """The case with its last weights"""
    calibrated: Fit
    settled: Fit
    """The fit with the effects that stay, as the rounds left it"""
    final: Fit
    """The accepted fit, fitted to more segments"""
    rounds: tuple[Round, ...]
    rivals: Mapping[str, tuple[Rival, ...]] = field(default_factory=dict)
    """Rivals of each accepted effect"""
    cautions: tuple[str, ...] = ()
    """What was not sought, in sentences"""
    undetermined: Mapping[tuple[str, int], float] = field(default_factory=dict)
    """Half width of the interval about zero of components that the logs do not determine, by effect and
    index
    """


def weakness(found: Gain) -> str:
    """Why a gain is not accepted; empty if it is."""
    if found.relative <= _worth_it(found):
        return ": not worth its parameters"
    most = CONFIRMED if found.whole > DECISIVE_GAIN else CHANCE
    return ", which may be chance" if found.probability_of_chance >= most else ""


def _worth_it(found: Gain) -> float:
    """The relative gain above which it is worth the parameters."""
    return MIN_GAIN_IN_A_SENSOR if found.of_one_sensor else MIN_GAIN


def significant(found: Fit, name: str, candidate: Candidate) -> bool:
    """Whether a strength of an effect differs from zero by more than chance."""
    strong = strengths(candidate)
    if limits(candidate, found.point.effects[name]):
        return True
    ours = [(n, k) for n, (e, k) in enumerate(found.free.effects) if e == name and k in strong]
    error = found.error[len(found.free.declared) :]
    return any(abs(found.point.effects[name][k]) > MIN_Z * error[n] for n, k in ours)


def why_not(name: str, trial: CandidateTrial, candidate: Candidate) -> str:
    """Why a candidate is not accepted; empty if it is."""
    if not trial.fit or not trial.gain:
        return f"to first order it would remove {100 * trial.score.share:.1f} % of the residual"
    if trial.within_neglect:
        return f"{trial.gain}; {NEGLECTED}"
    return weakness_of_fit(trial.fit, trial.gain, {name: candidate})


def doubtful(name: str, trial: CandidateTrial, candidate: Candidate) -> bool:
    """Whether a candidate was rejected for chance alone: a gain or a strength that more logs may show."""
    if not trial.fit or not trial.gain or trial.gain.relative <= _worth_it(trial.gain):
        return False
    ends = too_strong(candidate, trial.fit.point.effects[name]) or trial.within_neglect
    return not ends and bool(why_not(name, trial, candidate))


def weakness_of_fit(fit: Fit, found: Gain, several: Mapping[str, Candidate]) -> str:
    """Why effects that were fitted together are not accepted, or nothing."""
    for name, candidate in several.items():
        if ends := too_strong(candidate, fit.point.effects[name]):
            return f"{found}; its {', '.join(ends)} runs to the end of the range"
        if not matters(candidate, fit.point.effects[name]):
            return f"{found}; its strength is less than {MIN_STRENGTH:.0%} of what is typical"
    if too_weak := weakness(found):
        return f"{found}{too_weak}"
    shown = len(several) == 1 and found.probability_of_chance < DECISIVE_P
    sure = all(significant(fit, name, candidate) for name, candidate in several.items())
    return "" if shown or sure else f"{found}; its strength may be zero"


def matters(candidate: Candidate, values: Array) -> bool:
    """Whether one of an effect's strengths is worth a name."""
    ranges = list(candidate.ranges.values())
    return any(
        abs(values[k]) >= MIN_STRENGTH * abs(ranges[k].typical) for k in strengths(candidate)
    )


def best_trial(trials: Mapping[str, CandidateTrial], candidates: Mapping[str, Candidate]) -> str:
    """The candidate that leaves least of training and held-out logs, if its gain is large enough, significant
    and within its range; of those that logs do not tell from it, the one with the fewest parameters.
    """
    good = {
        name: trial.evidence
        for name, trial in trials.items()
        if trial.gain and not why_not(name, trial, candidates[name])
    }
    if not good:
        return ""
    best = max(good, key=lambda name: good[name])
    others = [name for name in good if name != best]
    alike = [best, *(name for name in others if _as_good(trials[name], trials[best]))]
    own, form = candidates[best], ("place", "law", "depends_on")
    same = [name for name in others if own.is_law_beside(candidates[name], form)]
    alike += [name for name in same if _hardly_worse(trials[name], trials[best])]
    return min(alike, key=lambda name: (parameters(candidates[name]), -good[name]))


def promising(trials: Mapping[str, CandidateTrial]) -> str:
    """The best candidate whose gain is no chance and half of what is asked for, or none: a fit of everything
    anew may make it enough.
    """
    good = {
        name: trial.gain.relative
        for name, trial in trials.items()
        if trial.gain
        and not trial.within_neglect
        and MIN_GAIN / 2 < trial.gain.relative <= MIN_GAIN
        and trial.gain.probability_of_chance < CHANCE
    }
    return max(good, key=lambda name: good[name], default="")


def outdone(done: Round) -> dict[str, Array]:
    """The best few candidates whose gain in a round would have been worth it, had another's not been greater,
    with the parameters of their fits. Where the accepted one has taken up their part, as a payload too heavy
    does that of links that bend, a score test at no strength misses them beside it.
    """
    gains = {
        name: trial.gain.relative
        for name, trial in done.trials.items()
        if name not in done.accepted and trial.gain and trial.gain.relative > MIN_GAIN
    }
    found = {}
    for name in sorted(gains, key=lambda name: -gains[name])[:_OUTDONE]:
        alone = done.trials[name].fit
        assert alone is not None
        found[name] = alone.point.effects[name]
    return found


def _as_good(one: CandidateTrial, best: CandidateTrial) -> bool:
    """Whether held-out logs do not tell one candidate's fit from the best one's, and training logs hardly."""
    if one.errors is None or best.errors is None or best.fits - one.fits > MIN_GAIN:
        return False
    return gain(one.errors, best.errors).probability_of_chance > APART


def _hardly_worse(one: CandidateTrial, best: CandidateTrial) -> bool:
    """Whether one candidate's fit leaves hardly more of the held-out logs than the best one's."""
    if one.errors is None or best.errors is None:
        return False
    return gain(one.errors, best.errors).relative < EQUIVALENCE_MARGIN


def parameters(candidate: Candidate) -> int:
    """How many parameters of a candidate logs identify, one of several places included."""
    return sum(allowed.fitted for allowed in candidate.ranges.values()) + bool(candidate.at)


def seen(trial: CandidateTrial) -> bool:
    """Whether the logs would show this candidate at all."""
    return trial.score.excitation > EXCITED
