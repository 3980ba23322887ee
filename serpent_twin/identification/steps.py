"""Find the missing effect that explains a residual, in the five steps of a trace.

(1) Calibrate the declared parameters on training logs. (2) Look at what is left on held-out logs.
(3) Screen all candidates by a score test; fit the best few fully, with what they can be confused with.
(4) Accept the best only if its gain on held-out logs is significant and justifies its parameters;
repeat with it included. (5) An error above that of a twin that lacks nothing is unexplained.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.absorbed import told_together, without_ends
from serpent_twin.identification.acceptance import (
    HARDLY,
    CandidateTrial,
    Round,
    Selection,
    best_trial,
    matters,
    outdone,
    promising,
    weakness_of_fit,
)
from serpent_twin.identification.checkpoints import Checkpoints, mark
from serpent_twin.identification.components import without_undetermined
from serpent_twin.identification.detection import identifiability, opening_fit
from serpent_twin.identification.exchanged import exchanged
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters, free_parameters
from serpent_twin.identification.fitting.least_squares import OnProgress, derives_cheaply, fit
from serpent_twin.identification.fitting.objective import prior_squares
from serpent_twin.identification.from_opening import Opening, behind, from_opening, opened
from serpent_twin.identification.gained import gained
from serpent_twin.identification.held_out import Errors, gave_up
from serpent_twin.identification.identifiability import Identifiability
from serpent_twin.identification.moved import FAR
from serpent_twin.identification.neglected import neglected
from serpent_twin.identification.proxies import without_proxies
from serpent_twin.identification.relieved import relieved, strained
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.trials import Trials, in_words
from serpent_twin.identification.widened import far_off
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_MOST_EFFECTS = 6
_LAST_STEPS = 2
"""Steps of a last fit where a derivative serves many: it begins near its end, and each simulates all logs"""
BEATS = 0.97
"""Share of a fit's cost that a fit from another start must come below to replace it. A candidate from the
opening must come below that share of a first calibration's cost with its first derivative
"""
_LATE = (
    "The time that was given has passed before the search had ended: further effects were not sought. Give "
    "more with --minutes."
)
_UNDONE = "another, which did not stand when everything was fitted anew"


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
        seconds: float = np.inf,
    ) -> None:
        """With an end after so many `seconds` from now, after which no further effect is sought."""
        self.case, self.training, self.held_out = case, training, held_out
        self.notes, self.on_progress, self.seed = notes, on_progress, seed
        self.trials = Trials(training, held_out, notes, on_progress)
        self.final: ParameterVector | None = None
        self.identifiability: Identifiability | None = None
        self._at_opening: tuple[Case[Any], Fit, list[Score]]
        self.cautions: tuple[str, ...] = ()
        self._end = time.monotonic() + seconds

    @property
    def late(self) -> bool:
        """Whether no further effect is sought, which is a caution."""
        late = time.monotonic() > self._end
        if late and _LATE not in self.cautions:
            self.cautions = (_LATE, *self.cautions)
        return late

    def select(self) -> Selection:
        """Calibrate, then add effects one by one while their gain is significant."""
        calibrated, base, rounds = self.named()
        base = self._more(base, rounds)
        settled = without_proxies(self.trials, self.case, base, rounds)
        settled, undetermined = without_undetermined(self.trials, self.case, settled, rounds)
        final = self._without_idle(self._sharpened(settled))
        self.final = final.point
        named = final.point.effects
        if not final.point.effects:
            calibrated = final
        rivals = {n: self.trials.rivals(self.case, n, named, rounds) for n in named}
        return Selection(
            self.case,
            calibrated,
            settled,
            final,
            tuple(rounds),
            rivals,
            self.cautions,
            undetermined,
        )

    def named(self) -> tuple[Fit, Fit, list[Round]]:
        """The calibrated twin, the fit with the named effects that were added to it, and the rounds."""
        start = ParameterVector.nominal(self.case.declared)
        opening, calibrated = self._calibrate(start)
        base, rounds = calibrated, list[Round]()
        while len(rounds) < _MOST_EFFECTS and not self.late:
            done = self._round(base, rounds, opening)
            sought = not rounds and self._may_be_far_off(base, done)
            if sought and (wide := far_off(self.trials, self.case, opening, base, done)):
                self.case = replace(self.case, widened=wide.case.widened, noise=wide.case.noise)
                stage = f"widened_{mark(list(self.case.widened))}"
                calibrated = base = self._reweighted(stage, wide.fit)
                continue
            rounds.append(done)
            if (better := self._stands(rounds)) is None:
                break
            base = self._settled(better, rounds)
        base = self._relieved(base, rounds) or base
        if better := exchanged(self.trials, self.case, base, rounds):
            self.case, base, rounds[:] = better.case, better.fit, better.rounds
        return calibrated, base, rounds

    def _may_be_far_off(self, calibrated: Fit, done: Round) -> bool:
        """Whether a number may be far from what was built: where calibration left much, or moved one further
        than parts differ.
        """
        squares = prior_squares(self.case, calibrated.point)
        strained = float(squares.max(initial=0.0)) > FAR**2
        return strained or not self.trials.little(self.case, calibrated, done.errors)

    def _relieved(self, base: Fit, rounds: list[Round]) -> Fit | None:
        """The fit with an effect in place of a number that was moved beyond reason, or found far off; or
        nothing.
        """
        if not derives_cheaply(self.case) or not rounds or rounds[-1].accepted:
            return None
        last, wide = rounds[-1], self.case
        case = replace(wide, widened={})
        number, alike = strained(case, base, [each.score for each in last.trials.values()])
        if not alike:
            return None
        self.on_progress(f"effects in place of {number}")
        tried = {name: last.trials[name] for name in alike if last.trials[name].opened}
        if not tried or wide.widened:
            now, stage = opened(self.trials, case, base, len(rounds)), f"{len(rounds)}_moved"
            tried = from_opening(self.trials, alike, now, base, last.errors, stage)
        if (done := relieved(self.trials, case, base, number, tried)) is None:
            return None
        rounds.append(done)
        self.case = case
        if (found := self._stands(rounds)) is None:
            self.case = wide
        return found

    def _settled(self, better: Fit, rounds: Sequence[Round]) -> Fit:
        """The fit of an accepted effect, to which others are added."""
        return better

    def _stands(self, rounds: list[Round]) -> Fit | None:
        """The fit of everything anew with what the last round accepted; None if that reverses it, or nothing
        was accepted.
        """
        if not (names := rounds[-1].accepted):
            return None
        found = rounds[-1].trials[names[0]].fit
        assert found is not None
        weighed = self.case
        stage = f"with_{len(rounds)}_{'_'.join(names)}"
        polished = self._from_within(self._polish(found, stage), names[0], stage)
        rounds[-1] = self._judged_again(rounds[-1], polished)
        if rounds[-1].accepted:
            return polished
        self.case = weighed
        return None

    def _from_within(self, found: Fit, name: str, stage: str) -> Fit:
        """The fit, or the one that begins again with no parameter at its bound if that is as good."""
        start = without_ends(self.case, self.training, found, name)
        if start is None:
            return found
        again = self._fit(f"{stage}_from_within", start, found.free, 3)
        return told_together(self.case, self.training, found, again)

    def _more(self, base: Fit, rounds: list[Round]) -> Fit:
        """The fit with what explains the rest; named effects alone explain no more."""
        return base

    def _judged_again(self, done: Round, polished: Fit) -> Round:
        """A round after its accepted candidates were fitted again, which may reverse the acceptance."""
        after, names = self.errors(polished.point), done.accepted
        trials = {name: done.trials[name] for name in names}
        if gave_up(done.errors, after):
            score = {name: replace(each.score, unstable=True) for name, each in trials.items()}
            lost = {name: CandidateTrial(score[name], None, None, after.marker) for name in names}
            return replace(done, trials={**done.trials, **lost}, accepted=(), undone=_UNDONE)
        first = trials[names[0]]
        fits, errors = (done.base, polished), (done.errors, after)
        better = gained(self.case, first.score, fits, errors, first.selected)
        again = {
            name: replace(each, fit=polished, gain=better, error=after.marker)
            for name, each in trials.items()
        }
        known = {name: self.case.candidates[name] for name in names}
        trials = {**done.trials, **again}
        if weakness_of_fit(polished, better, known):
            return replace(done, trials=trials, accepted=(), undone=_UNDONE)
        return replace(done, trials=trials)

    def errors(self, point: ParameterVector) -> Errors:
        """Held-out errors of a parameter vector."""
        return self.trials.errors(self.case, point)

    def _calibrate(self, start: ParameterVector) -> tuple[Opening, Fit]:
        """Fit the declared parameters, updating weights in between; returns the opening and the calibrated
        twin.
        """
        self.case = self.case.reweighted(start, self.training)
        free = free_parameters(self.case, ())
        self.on_progress("opening")
        begun = self.notes.fit("opening", lambda: opening_fit(self.case, self.training))
        self.identifiability = self._identifiable(begun)
        weighed = self.case
        first = self._fit("calibrated_1", start, free, 1, begun)
        return (weighed, begun), self._reweighted("calibrated", first)

    def _reweighted(self, name: str, first: Fit) -> Fit:
        """A first fit gone on with until its weights settle: where a first guess misses a channel by far, its
        weight hides how much of it a better fit explains.
        """
        case = replace(self.case, noise=first.noise)  # which its residual is weighed by
        self.case, found = self.trials.reweighted(case, first, name, far=True)
        return found

    def _weighed_by(self, found: Fit) -> Case[Any]:
        """The case with the noise that a fit leaves."""
        case = replace(self.case, noise=found.noise)  # which its residual is weighed by
        return case.weighed_by(found.residual, self.case.take(self.training, found.used))

    def _identifiable(self, opening: Fit) -> Identifiability:
        """What these logs can tell at all, to first order."""
        names = [name for name in self.case.candidates if name not in self.case.unseen]
        found = list(self.trials.scores("1_start", self.case, opening, names).values())
        self._at_opening = (self.case, opening, found)
        return identifiability(self.case, self.training, opening, found)

    def exact_limits(self) -> Identifiability:
        """What the logs can tell, with detection limits by a fit for each effect, for a verdict that quotes
        them.
        """
        case, opening, found = self._at_opening

        def limits(name: str, make: Callable[[], Array]) -> Array:
            self.on_progress(f"detection limit of {spaced(name)}")
            return self.notes.numbers(f"limits_{name}", 3, make)

        return identifiability(case, self.training, opening, found, limits)

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
        self.on_progress(f"fitting {in_words(start)}{', the last time' if last else ''}")
        case, most = self.case, self.case.segments[last]
        steps = _LAST_STEPS if last and not derives_cheaply(case) else None
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
                steps,
                rounds=case.weak_rounds if last else 0,
                used=() if last else self._at_opening[1].used,
            ),
        )

    def _polish(self, found: Fit, name: str) -> Fit:
        """Fit an accepted effect again with everything else, with updated weights."""
        self.case = self._weighed_by(found)
        free = free_parameters(self.case, list(found.point.effects))
        return self._fit(name, found.point, free, 2, carried=found)

    def _sharpened(self, found: Fit) -> Fit:
        """The last fit, on more segments if there are, from which numbers are reported."""
        most = min(self.case.segments[True], len(self.training))
        if not found.point.effects and len(found.used) >= most:
            return self.notes.fit("last", lambda: found)
        self.case = self._weighed_by(found)
        return self._fit("last", found.point, found.free, self._last, carried=found, last=True)

    @property
    def _last(self) -> int:
        """Derivatives of a last fit beside the one that it begins with: none where rounds along weak
        directions follow, or where derivatives are dear.
        """
        return int(not self.case.weak_rounds and derives_cheaply(self.case))

    def _without_idle(self, last: Fit) -> Fit:
        """The last fit without effects that it has brought to nothing: what they had gained, it gains too."""
        effects = last.point.effects
        idle = [n for n, v in effects.items() if not matters(self.case.candidates[n], v)]
        if not idle:
            return last
        rest = last.without(idle)
        return self._fit("last_without", rest.point, rest.free, self._last, carried=rest, last=True)

    def _round(self, base: Fit, rounds: Sequence[Round], opening: Opening) -> Round:
        """Try all candidates; those that calibration may have absorbed also where nothing is calibrated yet;
        and pairs, if none is accepted alone. A fit from there that explains less than the base went astray:
        the candidate is then fitted from the base. Without any, a promising candidate stands until it was
        fitted again. None is fitted where effects that were found may neglect all that is left.
        """
        number = len(rounds) + len(self.case.widened) + 1
        names = [
            n
            for n in self.case.candidates
            if n not in base.point.effects and n not in self.case.unseen
        ]
        before = self.errors(base.point)
        if neglected(self.case, base) >= 1:
            stage = f"{number}_base"
            told = self.trials.each(names, self.case, base, base, before, stage, but=names)
            return Round(base, before, told, ())
        much = not self.trials.little(self.case, base, before)
        missed, absorbed = {}, {}
        if number > 1 and not derives_cheaply(self.case):
            missed = outdone(rounds[-1]) if much and rounds else {}
        elif much:
            now = opened(self.trials, self.case, base, number) if number > 1 else opening
            absorbed = from_opening(self.trials, names, now, base, before, f"{number}_start")
        done = [n for n, each in absorbed.items() if each.fit and each.evidence > -HARDLY]
        stage = f"{number}_base"
        late = behind(self.trials, self.case, names, base, absorbed, stage) if done else []
        trials = self.trials.each(
            names,
            self.case,
            base,
            base,
            before,
            stage,
            anyway=missed,
            but=[*done, *late],
        )
        trials |= {name: replace(absorbed[name], score=trials[name].score) for name in done}
        if best := best_trial(trials, self.case.candidates):
            return Round(base, before, trials, (best,))
        tried = self.trials.pairs(
            self.case, base, before, {name: trials[name].score for name in names}, number
        )
        good = [each for each in tried if not each.why_not]
        if not good:
            name = promising(trials)
            return Round(base, before, trials, (name,) if name else (), tried)
        pair = max(good, key=lambda each: each.trial.gain.relative if each.trial.gain else 0.0)
        for name in pair.pair.names:
            trials[name] = replace(pair.trial, score=trials[name].score)
        return Round(base, before, trials, pair.pair.names, tried)
