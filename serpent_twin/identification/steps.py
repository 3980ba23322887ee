"""Find the missing effect that explains a residual, in the five steps of a trace.

(1) Calibrate the declared parameters on training logs. (2) Look at what is left on held-out logs.
(3) Screen all candidates by a score test; fit the best few fully, with what they can be confused with.
(4) Accept the best only if its gain on held-out logs is significant and justifies its parameters;
repeat with it included. (5) An error above that of a twin that lacks nothing is unexplained.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.identification.acceptance import (
    CandidateTrial,
    Round,
    Selection,
    best_trial,
    better_trial,
    weakness,
)
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.free_parameters import FreeParameters, free_parameters
from serpent_twin.identification.held_out import Errors, errors, gain, gave_up
from serpent_twin.identification.least_squares import Fit, OnProgress, fit
from serpent_twin.identification.score_test import (
    Score,
    full_fit,
    scores,
    worth_fitting,
)
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.numerals import counted

_MOST_EFFECTS = 6
_PLAIN = 0.3
"""Relative gain of a candidate above which those that calibration may have absorbed are not tried"""


class Tracer:
    """Runs the steps on one machine's training and held-out segments."""

    def __init__(
        self,
        case: Case[Any],
        training: Any,
        held_out: Any,
        notes: Checkpoints,
        on_progress: OnProgress,
        seed: int,
    ) -> None:
        self.case, self.training, self.held_out = case, training, held_out
        self.notes, self.on_progress, self.seed = notes, on_progress, seed
        self.final: ParameterVector | None = None

    def select(self) -> Selection:
        """Calibrate, then add effects one by one while their gain is significant."""
        start = ParameterVector(np.zeros(len(self.case.declared)))
        opening, calibrated = self._calibrate(start)
        base, rounds = calibrated, []
        while len(rounds) < _MOST_EFFECTS:
            rounds.append(self._round(base, len(rounds) + 1, None if rounds else opening))
            if not (name := rounds[-1].accepted):
                break
            found = rounds[-1].trials[name].fit
            assert found is not None
            weighed = self.case
            polished = self._polish(found, f"with_{len(rounds)}_{name}")
            rounds[-1] = self._judged_again(rounds[-1], polished)
            if not rounds[-1].accepted:
                self.case = weighed
                break
            base = polished
        final = self._sharpened(self._without_proxies(base, rounds))
        self.final = final.point
        return Selection(self.case, calibrated, final, tuple(rounds))

    def _judged_again(self, done: Round, polished: Fit) -> Round:
        """A round after its accepted candidate was fitted again, which may reverse the acceptance."""
        after = self.errors(polished.point)
        if gave_up(done.errors, after):
            trial = CandidateTrial(
                replace(done.trials[done.accepted].score, unstable=True), None, None, after.marker
            )
            return replace(done, trials={**done.trials, done.accepted: trial}, accepted="")
        better = gain(done.errors, after, np.random.default_rng([self.seed, 5]), done.fitted)
        before = done.trials[done.accepted]
        trial = replace(before, fit=polished, gain=better, error=after.marker)
        stands = best_trial({done.accepted: trial}, self.case.candidates)
        return replace(done, trials={**done.trials, done.accepted: trial}, accepted=stands)

    def errors(self, point: ParameterVector) -> Errors:
        """Held-out errors of a parameter vector."""
        return errors(self.case.compare(point, self.held_out))

    def _calibrate(self, start: ParameterVector) -> tuple[Fit, Fit]:
        """Fit the declared parameters, updating weights in between; returns the opening, a fit without
        any step, and the calibrated twin.
        """
        self.case = self.case.reweighted(start, self.training)
        free = free_parameters(self.case, ())
        self.on_progress("opening")
        opening = self.notes.fit(
            "opening",
            lambda: fit(
                self.case,
                self.training,
                start,
                free,
                1,
                self.case.segments[0],
                self.on_progress,
                steps=0,
            ),
        )
        first = self._fit("calibrated_1", start, free, 1, opening)
        self._opening_case = self.case
        self.case = self.case.reweighted(first.point, self.training)
        second = self._fit("calibrated_2", first.point, free, 0, carried=first)
        self.case = self.case.reweighted(second.point, self.training)
        return opening, self._fit("calibrated_3", second.point, free, 3, carried=second)

    def _fit(
        self,
        name: str,
        start: ParameterVector,
        free: FreeParameters,
        derivatives: int,
        known: Fit | None = None,
        carried: Fit | None = None,
        last: bool = False,
    ) -> Fit:
        self.on_progress(f"fit {name.replace('_', ' ')}")
        case, most = self.case, self.case.segments[last]
        return self.notes.fit(
            name,
            lambda: fit(
                case,
                self.training,
                start,
                free,
                derivatives,
                most,
                self.on_progress,
                known,
                carried,
            ),
        )

    def _polish(self, found: Fit, name: str) -> Fit:
        """Fit an accepted effect again with everything else, with updated weights."""
        self.case = self.case.reweighted(found.point, self.training)
        free = free_parameters(self.case, list(found.point.effects))
        return self._fit(name, found.point, free, 2, carried=found)

    def _sharpened(self, found: Fit) -> Fit:
        """The last fit, on more segments, from which the accepted effects are reported."""
        if not found.point.effects:
            return found
        self.case = self.case.reweighted(found.point, self.training)
        return self._fit("last", found.point, found.free, 0, carried=found, last=True)

    def _round(self, base: Fit, number: int, opening: Fit | None) -> Round:
        """Try all candidates; those that calibration may have absorbed also from the opening."""
        names = [
            n
            for n in self.case.candidates
            if n not in base.point.effects and n not in self.case.unseen
        ]
        before = self.errors(base.point)
        trials = self._trials(names, self.case, base, before, f"{number}_base")
        plain = any(trial.gain and trial.gain.relative > _PLAIN for trial in trials.values())
        if opening and not plain:
            again = self._trials(names, self._opening_case, opening, before, f"{number}_start", 2)
            trials = {name: better_trial(trials[name], again[name]) for name in names}
        return Round(base, before, trials, best_trial(trials, self.case.candidates))

    def _trials(
        self,
        names: Sequence[str],
        case: Case[Any],
        begun: Fit,
        before: Errors,
        stage: str,
        most: int | None = None,
    ) -> dict[str, CandidateTrial]:
        """Score tests of candidates on top of a fit, and full fits of the selected ones."""
        found = self._scores(f"scores_{stage}", case, begun, names)
        trials = {name: CandidateTrial(s, None, None, before.marker) for name, s in found.items()}
        chosen = worth_fitting(list(found.values()), case.candidates)[:most]
        for name in chosen:
            self.on_progress(f"{stage.replace('_', ', from the ')}: fitting {name}")
            fitted = self.notes.fit(
                f"fit_{stage}_{name}",
                lambda one=found[name]: full_fit(case, self.training, begun, one, self.on_progress),
            )
            after = self.errors(fitted.point)
            if gave_up(before, after):
                trials[name] = replace(
                    trials[name], score=replace(trials[name].score, unstable=True)
                )
                continue
            rng = np.random.default_rng([self.seed, 1])
            better = gain(before, after, rng, among=len(chosen))
            trials[name] = CandidateTrial(found[name], fitted, better, after.marker)
        return trials

    def _scores(
        self, stage: str, case: Case[Any], base: Fit, names: Sequence[str]
    ) -> dict[str, Score]:
        def test() -> list[Score]:
            self.on_progress(f"score tests of {counted(len(names), 'candidate')}")
            return scores(case, self.training, base, [case.candidates[name] for name in names])

        return {each.name: each for each in self.notes.scores(stage, test)}

    def _without_proxies(self, final: Fit, rounds: Sequence[Round]) -> Fit:
        """Drop effects that were accepted early and gain nothing beside those accepted later."""
        names = list(final.point.effects)
        for name in names[:-1]:
            rest = {n: v for n, v in final.point.effects.items() if n != name}
            point = ParameterVector(final.point.declared, rest)
            free = free_parameters(self.case, list(rest))
            less = self.notes.fit(
                f"without_{len(rounds)}_{name}",
                lambda p=point, m=free, f=final: fit(
                    self.case,
                    self.training,
                    p,
                    m,
                    3,
                    self.case.segments[0],
                    self.on_progress,
                    known=f,
                ),
            )
            rng = np.random.default_rng([self.seed, 99])
            without, beside = self.errors(less.point), self.errors(final.point)
            if gave_up(beside, without):
                continue
            lost = gain(without, beside, rng)
            if weakness(lost):
                self.on_progress(f"{name} is not worth it beside the others")
                final = less
        return final
