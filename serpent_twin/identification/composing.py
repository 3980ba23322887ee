"""Trace with effects that no catalogue lists: laws composed from what the named ones leave."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from serpent_twin.identification.absorbed import by_parameters, without_move
from serpent_twin.identification.acceptance import CandidateTrial, Round, best_trial
from serpent_twin.identification.checkpoints import mark
from serpent_twin.identification.discovery import (
    always,
    composed_law,
    discover,
    elsewhere,
    in_each_shape,
    of_shape,
    turned,
)
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.held_out import Errors, gain
from serpent_twin.identification.moved import moved
from serpent_twin.identification.neglected import neglected
from serpent_twin.identification.proxies import needless, shown_by
from serpent_twin.identification.refitting import IDEALISED, RefittingTracer
from serpent_twin.identification.together import as_accepted, one_by_one
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.candidate import Candidate

_MOST = 3
"""Laws, one after the other"""
_ENOUGH = 16
"""Laws that were fitted, after which no other is sought: where so many did not do, more hardly would"""
_FITTED, _NEAR = 2, 0.8
"""Candidates that are fitted; of what the best removes, what another must"""
_AS_MUCH = 0.9
"""A law is tried in place of a named effect if it removes at least this fraction of what the effect
removed, both to first order
"""
_IN_PLACE = "the effects in whose place it was tried"
_Way = Callable[[Fit, Round], list[str]]
"""Finds laws to try in place of a round, from the fit with all effects and that round; gives their names"""


class ComposingTracer(RefittingTracer):
    """The steps of a trace, and after them laws at places of the machine, while something is left."""

    _laws = 0  # that were fitted

    def _enough(self) -> bool:
        """Whether no other law is sought, as many were fitted or it is late; the diagnosis says so."""
        if self.late:
            return True
        if self._laws < _ENOUGH:
            return False
        self.cautions = (
            f"No other law was sought after {self._laws} had been fitted; what is left may have one.",
        )
        return True

    def _more(self, base: Fit, rounds: list[Round]) -> Fit:
        """The fit with the laws that explain what is left.

        Named effects come first, and one may be a part of a law. So a law that explains alone what a named
        effect and all after it do takes their place, and so does one law for two at one place: as soon as
        there is a law, because laws on top of a wrong effect are wrong, too.
        """
        if self.late or neglected(self.case, base) >= 1:
            return base
        named, settled = len(rounds), base
        if law := self._absorbed(base, rounds):
            base = law
        found, something = self._composed(base, rounds, 1)
        if found is not base and (name := self._by_name(found, rounds)):
            return self._more(name, rounds)
        if not something and not law:
            return found
        if better := self._replaced(found, rounds, named):
            return self._composed(better, rounds)[0]
        if found is not base:
            first, found = found, self._composed(found, rounds, _MOST - 1)[0]
            if found is not first and (better := self._replaced(found, rounds, named)):
                return self._composed(better, rounds)[0]
        if found is settled or self._little_left(found):
            return found
        return self._anew(found, len(rounds))

    def _absorbed(self, base: Fit, rounds: list[Round]) -> Fit | None:
        """The fit of a law instead of the parameter that the calibration moved furthest beyond reason, which
        may stand for it, as friction of a whole joint for friction in a window of its angle. None if there is
        no such parameter, or no law that is better. A law that is the parameter itself is none.
        """
        if not (several := moved(self.case, base, ())):
            return None
        weighed, before = self.case, self.errors(base.point)
        self.on_progress(f"laws in place of {several[0].name}")
        begun, blind = without_move(self.case, self.training, base, several[0].coordinate)
        found = self._known(discover(self.case, self.training, blind, False, self.on_progress))
        if names := self._beyond_parameters(begun, found, len(rounds) + 1):
            stage = f"{len(rounds) + 1}_absorbed_{mark(names)}"
            trials = self.trials.each(
                names, self.case, begun, base, before, stage, _FITTED, beside=_NEAR
            )
            best = best_trial(trials, self.case.candidates)
            rounds.append(Round(base, before, trials, (best,) if best else ()))
            if law := self._stands(rounds):
                return law
        self.case = replace(self.case, noise=weighed.noise)
        return None

    def _beyond_parameters(self, begun: Fit, names: Sequence[str], number: int) -> list[str]:
        """The names of some laws without constants that declared parameters could do."""
        constant = [name for name in names if (law := composed_law(name)) and not law.reading]
        if not constant:
            return list(names)
        stage = f"{number}_constant_{mark(constant)}"
        tested = self.trials.scores(stage, self.case, begun, constant)
        changes = {name: each.change.astype(float) for name, each in tested.items()}
        done = [name for name, each in changes.items() if by_parameters(self.case, begun, each)]
        return [name for name in names if name not in done]

    def _replaced(self, several: Fit, rounds: list[Round], named: int) -> Fit | None:
        """The fit in which one law replaces an accepted effect and all after it; None if none is better."""
        for n, done in enumerate(rounds.copy()):
            if self._enough():
                break
            if not done.accepted:
                continue
            ways = (self._either_way, self._other_laws) if n < named else (self._one_for_two,)
            alone = not any(each.accepted for each in rounds[n + 1 :])
            if n < named and alone and self._unbeaten(done.errors, several):
                continue
            stage = f"{len(rounds)}_alone_{n + 1}"
            for one in one_by_one(self.trials, self.case, several, done, stage):
                if better := self._instead(several, one, rounds, ways):
                    return better
        return None

    def _composed(self, base: Fit, rounds: list[Round], most: int = _MOST) -> tuple[Fit, bool]:
        """The fit with laws that were accepted one by one, and whether anything was left to explain."""
        for n in range(most):
            before = self.errors(base.point)
            if not (names := self._candidates(base, before)) or self._enough():
                return base, n > 0
            stage = f"{len(rounds) + 1}_composed_{mark(names)}"
            rounds.append(self._law(names, base, before, stage))
            if (better := self._stands(rounds)) is None:
                break
            base = self._with_thresholds(better, rounds[-1].accepted[0], len(rounds))
        return base, True

    def _candidates(self, base: Fit, before: Errors) -> list[str]:
        """The names of laws that may explain what a fit leaves, which are candidates from now on."""
        little = self.trials.little(self.case, base, before)
        found = discover(self.case, self.training, base, little, self.on_progress)
        return self._known(found)

    def _law(self, names: Sequence[str], base: Fit, before: Errors, stage: str) -> Round:
        """A round of composed candidates, and of those that resemble the best."""
        trials = self.trials.each(
            names, self.case, base, base, before, stage, _FITTED, beside=_NEAR
        )
        best = best_trial(trials, self.case.candidates)
        if best:
            trials = self._resembling(trials, best, base, before, stage)
            best = best_trial(trials, self.case.candidates)
        self._laws += sum(trial.fit is not None for trial in trials.values())
        return Round(base, before, trials, (best,) if best else ())

    def _instead(
        self, several: Fit, done: Round, rounds: list[Round], ways: Sequence[_Way]
    ) -> Fit | None:
        """The fit of a law in place of what a round accepted and of all that was accepted after it, of those
        that the first of some ways gives; None if `several`, the fit with these, is better.
        """
        weighed, name = self.case, done.accepted[0]
        self.on_progress(f"laws in place of {spaced(name)}")
        self.case = replace(weighed, noise=done.base.noise)
        for way in ways:
            if law := self._in_place(way(several, done), several, done, rounds):
                return law
        known = {**self.case.composed, **weighed.composed}  # a law found before keeps its ranges
        self.case = replace(weighed, composed=known)
        return None

    def _either_way(self, several: Fit, done: Round) -> list[str]:
        """The names of a fit's steps, as fitted, of those that hold where these do not, the other way round,
        and of what always holds: beside something constant they are nearly the same.
        """
        known, found = self.case.candidates, []
        for name, values in several.point.effects.items():
            if other := turned(known[name], values):
                fitted = replace(known[name], variants=(values,), alternatives=())
                found += [fitted, other, always(self.case, name, values)]
        return self._known(found)

    def _other_laws(self, several: Fit, done: Round) -> list[str]:
        """The names of laws that may explain what is left without what a round accepted."""
        return self._candidates(done.base, done.errors)

    def _one_for_two(self, several: Fit, done: Round) -> list[str]:
        """The names of laws of each shape in place of something constant that a round accepted and of a law
        at the same place: a part of a wave is a constant and a ramp, too.
        """
        first = composed_law(done.accepted[0])
        if first is None or first.reading:
            return []
        later = [each for each in several.point.effects if each not in done.base.point.effects]
        for law in map(composed_law, later):
            if law and law.reading and (law.handle, law.place) == (first.handle, first.place):
                return self._known(in_each_shape(self.case, self.training, done.base, law))
        return []

    def _known(self, found: Sequence[Candidate]) -> list[str]:
        """The names of composed laws, which are candidates from now on."""
        self.case = self.case.composing(found)
        return [each.name for each in found]

    def _in_place(
        self, names: Sequence[str], several: Fit, done: Round, rounds: list[Round]
    ) -> Fit | None:
        """The fit of one of some laws in place of what a round accepted and of all after it, if it stands."""
        if not names:
            return None
        stage = f"{len(rounds) + 1}_instead_of_{done.accepted[0]}_{mark(names)}"
        scores = self.trials.scores(stage, self.case, done.base, names)
        removed = max(each.share for each in scores.values())
        if removed <= _AS_MUCH * done.trials[done.accepted[0]].score.share:
            return None
        tried = self._law(names, done.base, done.errors, stage)
        rounds.append(tried)
        if law := self._stands(rounds):
            law = self._anew(law, len(rounds))
            score = shown_by(tried.trials[tried.accepted[0]].score, law, several)
            named: Fit | None = several  # a name is kept unless the law is better
            if len(law.point.effects) < len(several.point.effects):
                stands = needless(self.trials, self.case, score, law, several)
                named = as_accepted(self.trials, self.case, several, done, stage)
            else:
                stands = not needless(self.trials, self.case, score, several, law)
            if stands and (named is None or self._beyond_a_name(done.errors, named, law)):
                return law
        rounds[-1] = replace(rounds[-1], accepted=(), undone=rounds[-1].undone or _IN_PLACE)
        self.case = replace(self.case, noise=done.base.noise)
        return None

    def _beyond_a_name(self, before: Errors, named: Fit, law: Fit) -> bool:
        """Whether a law gains clearly more than named effects in its place: both are idealisations, and where
        a name explains nearly all, what another form of it gains is no reason to give up the name.
        """
        return self._gained(before, law) > (1 + IDEALISED) * self._gained(before, named)

    def _unbeaten(self, before: Errors, named: Fit) -> bool:
        """Whether named effects explain so much that no law in the place of the last can gain clearly more,
        so that none is sought.
        """
        return (1 + IDEALISED) * self._gained(before, named) >= 1

    def _gained(self, before: Errors, found: Fit) -> float:
        """Share of the held-out error that a fit removes."""
        return gain(before, self.errors(found.point)).relative

    def _resembling(
        self,
        trials: Mapping[str, CandidateTrial],
        best: str,
        base: Fit,
        before: Errors,
        stage: str,
    ) -> dict[str, CandidateTrial]:
        """The trials, and those of what resembles the best composed law: the same change by other readings
        and in another shape; if such a one is better, what else removes nearly as much, by that reading in
        that shape; and the best of all these at other places.
        """
        every = dict(trials)

        def fitted(name: str) -> Fit:
            found = every[name].fit
            assert found is not None
            return found

        def tried(several: Sequence[Candidate]) -> None:
            new = [n for n in several if n.name not in every or every[n.name].fit is None]
            if not new:
                return
            self.case, names = self.case.composing(new), [each.name for each in new]
            which = f"{stage}_resembling_{mark(names)}"
            beat = fitted(best).cost_with(base.variance_inflation)  # fits that go on have another
            every.update(
                self.trials.each(
                    names, self.case, base, base, before, which, _FITTED, beat, beside=_NEAR
                )
            )

        known = self.case.candidates
        tried(known[best].alternatives)
        if (better := best_trial(every, self.case.candidates)) != best:
            least, best = _NEAR * trials[best].score.share, better
            near = [known[name] for name, each in trials.items() if each.score.share > least]
            tried(of_shape(best, near))
            best = best_trial(every, self.case.candidates)
        tried(elsewhere(self.case.candidates[best], fitted(best)))
        return every
