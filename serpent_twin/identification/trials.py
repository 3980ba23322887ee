"""Fit candidates fully, alone and in pairs, and judge the fits on logs that they were not fitted to."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.acceptance import (
    CandidateTrial,
)
from serpent_twin.identification.bars import noise_alone
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.fitting.fitted import Fit, fits_better
from serpent_twin.identification.fitting.free_parameters import UnstableStartError
from serpent_twin.identification.fitting.least_squares import OnProgress, derives_cheaply, fit
from serpent_twin.identification.full_fit import best_of, full_fit, hypotheses
from serpent_twin.identification.gained import gained, happens_once
from serpent_twin.identification.held_out import Errors, errors, gave_up
from serpent_twin.identification.laws_to_fit import laws_to_fit, sensor_of
from serpent_twin.identification.left_out import chance_of_selection
from serpent_twin.identification.neglected import neglected
from serpent_twin.identification.score_test import (
    BESIDE_OTHERS,
    WORTH_A_FIT,
    Score,
    placed,
    scores,
    times_strength,
    worth_fitting,
)
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.numerals import counted

_NEAR = 0.3
"""Share of the best candidate's gain in cost from which another is fitted further"""
_NAMED = 3
"""Most effects that a line of progress names"""
_MORE = 3
"""Derivatives of a fit that goes on"""
_WEAK = 0.1
"""Share of the strength that an effect had alone, from which it is fitted beside another"""
_COMPLETE = 1.3
"""Times the error of a twin that lacks nothing, below which an error is hardly more"""
_NOT_NOISE = 20.0
"""Times the measurement's noise, from which that has no part in an error"""
LITTLE = 3.0
"""Times the measurement's noise, below which effects that were found left little"""
_HALF, _BY_A_FIT = 0.5, 4.0
"""Share of what is left that effects may neglect, from which it counts as little; and how many times as much
a full fit removes as its score says, at most
"""
_REWEIGHTED = 4
"""Most fits with new weights"""


@dataclass(frozen=True)
class Trials:
    """Full fits to one machine's training segments, judged by its held-out ones."""

    training: Any
    held_out: Any
    notes: Checkpoints
    on_progress: OnProgress

    def errors(self, case: Case[Any], point: ParameterVector) -> Errors:
        """Held-out errors of a parameter vector."""
        return errors(case.compare(point, self.held_out))

    def each(
        self,
        names: Sequence[str],
        case: Case[Any],
        begun: Fit,
        base: Fit,
        before: Errors,
        stage: str,
        most: int | None = None,
        beat: float = np.inf,
        beside: float = 0.0,
        anyway: Mapping[str, Array] = MappingProxyType({}),
        but: Collection[str] = (),
    ) -> dict[str, CandidateTrial]:
        """Score tests of candidates on top of a fit, and full fits of the selected ones, judged against the
        base. One that is not below the cost `beat` after its first derivative is fitted no further. With a
        share `beside` of what the best removes, others must remove that much, and fits go on only where much
        is left; beside the `most` best, the best of those that change something else is fitted, too. Those in
        `anyway` are fitted whatever their scores, from the parameters given but weaker; all `but` those are
        fitted that were.
        """
        found = self.placed(stage, case, begun, self.scores(stage, case, begun, names))
        chosen = self._chosen(case, begun, before, found, most, beside)
        chosen = [name for name in chosen if name not in but]
        missed = [name for name in anyway if name in found and name not in (*chosen, *but)]
        for name in missed:
            weak = times_strength(case.candidates[name], anyway[name], _WEAK)
            found[name] = replace(found[name], start=weak)
        chosen += missed
        trials = {name: CandidateTrial(s, None, None, before.marker) for name, s in found.items()}
        best = begun.cost
        for n, name in enumerate(chosen, 1):
            number, begins = stage.split("_")[:2]
            which = f"candidate {n} of {len(chosen)}, {spaced(name)}"
            self.on_progress(f"round {number}, from the {begins}: fitting {which}")
            near = min(beat, begun.cost - _NEAR * (begun.cost - best))
            several = list[Fit]()
            for k, one in enumerate(hypotheses(found[name])):
                fitted = self.stable(
                    f"fit_{stage}_{name}{'_within' * k}",
                    lambda one=one, near=near: full_fit(
                        case, self.training, begun, one, self.on_progress, near
                    ),
                )
                several += [fitted] if fitted else []
            if not several:
                trials[name] = replace(trials[name], score=replace(found[name], unstable=True))
                continue
            fitted = best_of(several)
            if name in missed:  # what has taken up its part must give way
                fitted = self.further(case, fitted, f"fit_{stage}_{name}_beside", fresh=True)
            best = min(best, fitted.cost)
            trials[name] = self.judged(case, found[name], base, fitted, before, len(chosen))
        near = min(beat, begun.cost - _NEAR * (begun.cost - best))
        for name in () if beside and self.little(case, base, before) else chosen:
            fitted = trials[name].fit
            if fitted and not fitted.converged and fitted.cost < near:
                further = self.further(case, fitted, f"fit_{stage}_{name}_further", fresh=True)
                trials[name] = self.judged(case, found[name], base, further, before, len(chosen))
        return trials

    def _chosen(
        self,
        case: Case[Any],
        begun: Fit,
        before: Errors,
        found: Mapping[str, Score],
        most: int | None,
        beside: float,
    ) -> list[str]:
        """The candidates to be fitted, as in `each`."""
        least = self._worth_a_fit(case, begun, before)
        if not beside:
            return worth_fitting(list(found.values()), case.candidates, least)[:most]
        return laws_to_fit(case, found, least, most, beside)

    def stable(self, stage: str, make: Callable[[], Fit]) -> Fit | None:
        """A fit by its name; None where no simulation is stable in which it could begin."""
        try:
            return self.notes.fit(stage, make)
        except UnstableStartError:
            return None

    def further(
        self,
        case: Case[Any],
        begun: Fit,
        stage: str,
        derivatives: int = _MORE,
        far: bool = False,
        fresh: bool = False,
    ) -> Fit:
        """A fit that its last derivative still bettered, gone on with derivatives by all parameters: what is
        compared with others should not be half-way. It may go `far` with one number. Its last derivative
        serves again first, unless only `fresh` ones have more to give.
        """
        self.on_progress(f"fitting {in_words(begun.point)} further")
        most, free = len(begun.used), begun.free
        return self.notes.fit(
            stage,
            lambda: fit(
                case,
                self.training,
                begun.point,
                free,
                derivatives,
                most,
                self.on_progress,
                carried=None if fresh else begun,
                used=begun.used,
                far=far,
            ),
        )

    def reweighted(
        self, case: Case[Any], begun: Fit, stage: str, once: bool = False, far: bool = False
    ) -> tuple[Case[Any], Fit]:
        """A fit gone on with until its weights settle, with its case; `once` is enough to compare it.

        The first new weights are rough, and where a derivative is dear they get none. Each fit may go `far`.
        """
        rough = not once and not derives_cheaply(case)
        for n in range(1 if once else _REWEIGHTED):
            settled = case.weighed_by(begun.residual, case.take(self.training, begun.used))
            if n > rough and settled.weighs_like(case):
                break
            derivatives = 0 if rough and n == 0 else _MORE
            after = self.further(settled, begun, f"{stage}_again_{n}", derivatives, far)
            if not self.holds(settled, begun, after):
                break
            case, begun = settled, after
        return case, begun

    def holds(self, case: Case[Any], before: Fit, after: Fit) -> bool:
        """Whether a fit that went on explains all training segments no worse than before: what it gained of
        those that it used is else of these alone, such as when a joint slipped.
        """
        if len(after.used) == len(self.training):
            return True
        left = case.residual([before.point, after.point], self.training).astype(float)
        squares = (left**2).sum(axis=(1, 2))
        return bool(np.isfinite(squares[1]) and not squares[1] > squares[0])

    def _worth_a_fit(self, case: Case[Any], begun: Fit, before: Errors) -> float:
        """Share of the residual that a candidate must remove to first order: more, where the effects found
        left little, or may neglect much of it.
        """
        beside = begun.point.effects and self.little(case, begun, before)
        least = BESIDE_OTHERS if beside else WORTH_A_FIT
        return max(least, neglected(case, begun) / _BY_A_FIT)

    def little(self, case: Case[Any], found: Fit, left: Errors) -> bool:
        """Whether a fit's held-out errors are hardly more than the measurement's noise, or than its own if it
        lacked nothing; or whether its effects may neglect half of what is left.
        """
        if neglected(case, found) >= _HALF:
            return True
        noise = noise_alone(case, self.held_out)
        if not LITTLE * noise < left.marker < _NOT_NOISE * noise:
            return left.marker <= LITTLE * noise
        return left.marker < _COMPLETE * self.complete(case, found)

    def complete(self, case: Case[Any], found: Fit) -> float:
        """Held-out error of a twin that lacks nothing, from the measurement's noise and where that lets runs
        begin; of the first fit that is asked for, as it hardly depends on the fit.
        """

        def make() -> Array:
            rng = np.random.default_rng(0)
            return np.array([case.expected(found.point, [found.point], self.held_out, rng)])

        return float(self.notes.numbers("complete", 1, make)[0])

    def judged(
        self, case: Case[Any], score: Score, base: Fit, fitted: Fit, before: Errors, among: int
    ) -> CandidateTrial:
        """A full fit judged against the base: selected by training sessions, or segments if it happens once,
        and confirmed by held-out ones.
        """
        after = self.errors(case, fitted.point)
        if gave_up(before, after):
            return CandidateTrial(replace(score, unstable=True), None, None, before.marker)
        once = happens_once(score.name)
        parts = range(len(self.training)) if once else self.training.session
        sensor = sensor_of(case, score)
        selected = chance_of_selection(case, base, fitted, parts, among, sensor, once)
        better = gained(case, score, (base, fitted), (before, after), selected)
        fits = fits_better(base, fitted, case.channels)
        beside = neglected(case, base)
        return CandidateTrial(
            score, fitted, better, after.marker, selected, after, fits, neglected=beside
        )

    def scores(
        self, stage: str, case: Case[Any], base: Fit, names: Sequence[str]
    ) -> dict[str, Score]:
        """Score tests of candidates on top of a fit, by their names."""

        def test() -> list[Score]:
            self.on_progress(f"screening {counted(len(names), 'candidate')}")
            return scores(case, self.training, base, [case.candidates[name] for name in names])

        return {each.name: each for each in self.notes.scores(f"scores_{stage}", test)}

    def placed(
        self, stage: str, case: Case[Any], base: Fit, found: Mapping[str, Score]
    ) -> dict[str, Score]:
        """The scores with the best place of each candidate that shows and may be at several places."""

        def test() -> list[Score]:
            self.on_progress("screening places")
            return placed(case, self.training, base, found)

        better = self.notes.scores(f"places_{stage}", test)
        return {**found, **{each.name: each for each in better}}


def in_words(point: ParameterVector) -> str:
    """What is fitted: a point's effects, or how many they are, or the model's numbers alone."""
    if len(point.effects) > _NAMED:
        return f"{len(point.effects)} effects together"
    return " and ".join(map(spaced, point.effects)) or "the model's numbers"
