"""Find the missing effect that explains a residual, in the five steps of a trace.

(1) Calibrate the declared parameters on training logs. (2) Look at what is left on held-out logs.
(3) Screen all candidates by a score test; fit the best few fully, with what they can be confused with.
(4) Accept the best only if its gain on held-out logs is significant and justifies its parameters;
repeat with it included. (5) An error above that of a twin that lacks nothing is unexplained.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

from serpent_twin.identification.absorbed import prefer_interior, without_ends
from serpent_twin.identification.acceptance import (
    CandidateTrial,
    Round,
    Selection,
    best_trial,
    outdone,
    promising,
    weakness_of_fit,
)
from serpent_twin.identification.checkpoints import mark
from serpent_twin.identification.components import without_undetermined
from serpent_twin.identification.confirmed import ToldByRows, confirmed
from serpent_twin.identification.exchanged import exchanged
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.least_squares import derives_cheaply
from serpent_twin.identification.fitting.objective import prior_squares
from serpent_twin.identification.from_opening import Opening, from_opening, opened
from serpent_twin.identification.gained import gained
from serpent_twin.identification.held_out import Errors, gave_up
from serpent_twin.identification.moved import too_far
from serpent_twin.identification.neglected import neglected
from serpent_twin.identification.pair_fits import pair_fits
from serpent_twin.identification.proxies import without_proxies
from serpent_twin.identification.relieved import relieved, strained
from serpent_twin.identification.rival_fits import rival_fits
from serpent_twin.identification.together import all_at_once, standing
from serpent_twin.identification.tracer_fits import TracerFits
from serpent_twin.identification.widened import far_off
from serpent_twin.machines.machine import ParameterVector

_MOST_EFFECTS = 6
BEATS = 0.97
"""Share of a fit's cost that a fit from another start must come below to replace it. A candidate from the
opening must come below that share of a first calibration's cost with its first derivative
"""
_LATE = (
    "The time that was given has passed before the search had ended: further effects were not sought. Give "
    "more with --minutes."
)
_UNDONE = "another, which did not stand when everything was fitted anew"


class Tracer(TracerFits):
    """Runs the steps on one machine's training and held-out segments."""

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
        rivals = {n: rival_fits(self.trials, self.case, n, named, rounds) for n in named}
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
        told = self._told_by_rows() if self._told_by_rows else None
        opening, calibrated = self._calibrate(start)
        base, rounds = calibrated, list[Round]()
        if told and told.slots:
            base = self._confirmed(told, calibrated, rounds) or calibrated
        began = len(rounds)
        while len(rounds) < _MOST_EFFECTS and not self.late:
            done = self._round(base, rounds, opening)
            much = len(rounds) == began and self._much(base, done.errors)
            sought = much and not self._explained(done.trials)
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

    def _confirmed(self, told: ToldByRows, base: Fit, rounds: list[Round]) -> Fit | None:
        """The fit with those effects that rows say which each gain in a motion, too, or nothing; the round
        that tried them comes first.
        """
        weighed = self.case
        self.case, done = confirmed(self.trials, weighed, told, base, self.errors(base.point))
        rounds.append(done)
        if (found := self._stands(rounds)) is None:
            self.case = weighed
        return found

    def _much(self, found: Fit, left: Errors) -> bool:
        """Whether a fit left much, or moved a number further than parts differ, and than the furthest of as
        many does by chance, so that something may be absorbed.
        """
        squares = prior_squares(self.case, found.point)
        strained = float(squares.max(initial=0.0)) > too_far(len(squares)) ** 2
        return strained or not self.trials.little(self.case, found, left)

    def _relieved(self, base: Fit, rounds: list[Round]) -> Fit | None:
        """The fit with an effect in place of a number that was moved beyond reason, or found far off; or
        nothing.
        """
        if not derives_cheaply(self.case) or not rounds or rounds[-1].accepted:
            return None
        last, wide = rounds[-1], self.case
        case = replace(wide, widened={})
        number, alike = strained(case, base, last.scores(base))
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
        rounds[-1], polished = self._judged_again(rounds[-1], polished, stage)
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
        return prefer_interior(self.case, self.training, found, again)

    def _more(self, base: Fit, rounds: list[Round]) -> Fit:
        """The fit with what explains the rest; named effects alone explain no more."""
        return base

    def _judged_again(self, done: Round, polished: Fit, stage: str) -> tuple[Round, Fit]:
        """A round after its accepted candidates were fitted again, which may reverse the acceptance, of all
        or of some of several that each must stand; and the fit of those that stay.
        """
        if done.together:
            scores = {name: done.trials[name].score for name in done.accepted}
            several = standing(self.trials, self.case, polished, scores, stage)
            undone = "" if several.names else _UNDONE
            every = done.trials | several.trials
            return replace(done, trials=every, accepted=several.names, undone=undone), several.fit
        return self._still_accepted(done, polished), polished

    def _still_accepted(self, done: Round, polished: Fit) -> Round:
        """A round after what it accepted was fitted again, as a whole."""
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

    def _explained(self, trials: Mapping[str, CandidateTrial]) -> bool:
        """Whether a candidate leaves little of what a calibration left, with no number moved far."""
        best = trials.get(best_trial(trials, self.case.candidates))
        if best is None or best.fit is None or best.errors is None:
            return False
        return not self._much(best.fit, best.errors)

    def _round(self, base: Fit, rounds: Sequence[Round], opening: Opening) -> Round:
        """Try all candidates, and pairs, if none is accepted alone. Where the best leaves much, or numbers
        far off, calibration may have absorbed another: the best few are then fitted where nothing is
        calibrated yet, too. Where none is accepted, a promising candidate stands until it was fitted again.
        None is fitted where effects that were found may neglect all that is left.
        """
        number = len(rounds) + len(self.case.widened) + 1
        names = [
            n
            for n in self.case.candidates
            if n not in base.point.effects and n not in self.case.unseen
        ]
        before, stage = self.errors(base.point), f"{number}_base"
        if self.case.adds_up and neglected(self.case, base) < 1:
            return all_at_once(self.trials, self.case, base, before, names, number)
        if neglected(self.case, base) >= 1:
            told = self.trials.each(names, self.case, base, base, before, stage, but=names)
            return Round(base, before, told, ())
        much, late = self._much(base, before), number > 1 and not derives_cheaply(self.case)
        missed = outdone(rounds[-1]) if late and much and rounds else {}
        trials = self.trials.each(names, self.case, base, base, before, stage, anyway=missed)
        if much and not late and not self._explained(trials):
            now = opened(self.trials, self.case, base, number) if number > 1 else opening
            found = from_opening(self.trials, names, now, base, before, f"{number}_start")
            trials |= {
                name: replace(each, score=trials[name].score)
                for name, each in found.items()
                if each.evidence > trials[name].evidence
            }
        if best := best_trial(trials, self.case.candidates):
            return Round(base, before, trials, (best,))
        tried = pair_fits(
            self.trials,
            self.case,
            base,
            before,
            {name: trials[name].score for name in names},
            number,
        )
        good = [each for each in tried if not each.why_not]
        if not good:
            name = promising(trials)
            return Round(base, before, trials, (name,) if name else (), tried)
        pair = max(good, key=lambda each: each.trial.gain.relative if each.trial.gain else 0.0)
        for name in pair.pair.names:
            trials[name] = replace(pair.trial, score=trials[name].score)
        return Round(base, before, trials, pair.pair.names, tried)
