"""Fit the same effects again from other starts, of thresholds and of the calibration before them."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from serpent_twin.identification.acceptance import Round, best_trial
from serpent_twin.identification.checkpoints import mark
from serpent_twin.identification.discovery import better_thresholds
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import UnstableStartError, free_parameters
from serpent_twin.identification.fitting.objective import cost_at
from serpent_twin.identification.from_opening import from_opening, opened
from serpent_twin.identification.steps import BEATS, Tracer
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.machine import ParameterVector

IDEALISED = 0.05
"""A law replaces named effects if it gains at least this fraction more than they do: effects neglect no
more than that, as their `model_error` says
"""


class RefittingTracer(Tracer):
    """The steps of a trace, with fits that begin again where they may have gone astray."""

    def _settled(self, better: Fit, rounds: Sequence[Round]) -> Fit:
        """The fit of an accepted effect; where it leaves much, from a calibration with it, unless it was
        fitted from the opening.
        """
        opened = all(rounds[-1].trials[name].opened for name in rounds[-1].accepted)
        return better if opened or self._little_left(better) else self._anew(better, len(rounds))

    def _little_left(self, found: Fit) -> bool:
        """Whether a fit leaves hardly more of the held-out logs than the measurement's noise."""
        return self.trials.little(self.case, found, self.errors(found.point))

    def _by_name(self, found: Fit, rounds: list[Round]) -> Fit | None:
        """The fit of a named effect in place of the law that the last round accepted, if it explains as much,
        where none was fitted from the opening yet: since something is left, calibration may have absorbed it.
        """
        if any(each.opened for done in rounds for each in done.trials.values()):
            return None
        weighed, law, number = self.case, rounds[-1], len(rounds) + 1
        self.on_progress(f"effects in place of {spaced(law.accepted[0])}")
        self.case = replace(weighed, noise=law.base.noise)
        begun = law.base.point.effects
        named = [n for n, each in self.case.candidates.items() if not each.composed]
        names = [n for n in named if n not in self.case.unseen and n not in begun]
        at = opened(self.trials, self.case, law.base, number) if begun else self._at_opening[:2]
        tried = from_opening(self.trials, names, at, law.base, law.errors, f"{number}_start")
        best = best_trial(tried, self.case.candidates)
        rounds.append(Round(law.base, law.errors, tried, (best,) if best else ()))
        if named_fit := self._stands(rounds):
            evidence = rounds[-1].trials[best].evidence
            if (1 + IDEALISED) * evidence >= law.trials[law.accepted[0]].evidence:
                rounds[-2] = replace(law, accepted=(), undone=spaced(best))
                return named_fit
            rounds[-1] = replace(rounds[-1], accepted=(), undone=spaced(law.accepted[0]))
        self.case = weighed
        return None

    def _with_thresholds(self, found: Fit, name: str, number: int) -> Fit:
        """The fit of an accepted law, from better thresholds if there are any."""
        self.on_progress(f"thresholds of {spaced(name)}")
        point = better_thresholds(self.case, self.training, found, name)
        if point is None:
            return found
        self.case = replace(self.case, noise=found.noise)
        stage = f"moved_{number}_{mark([name])}"
        moved = self._fit(stage, point, found.free, 2, carried=found)
        return moved if self._betters(moved, found) else found

    def _anew(self, found: Fit, number: int) -> Fit:
        """A fit, or a better one of the same effects, for which the nominal twin was calibrated again.

        Without these effects, the calibration before may have gone astray, and its weights with it.
        """
        weighed = self.case
        with suppress(UnstableStartError):  # then there is no such fit
            again = self._calibrated_with(found, number)
            if self._betters(again, found, BEATS):
                return again
        self.case = weighed
        return found

    def _calibrated_with(self, found: Fit, number: int) -> Fit:
        """A fit's effects fitted after the nominal twin with them was calibrated."""
        effects = found.point.effects
        stage = f"anew_{number}_{mark(list(effects))}"
        start = ParameterVector.nominal(self.case.declared, effects)
        self.case = self.case.reweighted(start, self.training)
        first = self._fit(f"{stage}_1", start, free_parameters(self.case, ()), 1)
        held = self._reweighted(stage, first)
        self.case = self._weighed_by(held)
        return self._fit(f"{stage}_4", held.point, found.free, 2)

    def _betters(self, again: Fit, found: Fit, share: float = 1.0) -> bool:
        """Whether a fit leaves less than a share of another's cost, by that one's weights."""
        case = replace(self.case, noise=found.noise)
        some = case.take(self.training, found.used)
        residual = case.residual([again.point], some)[0]
        cost = cost_at(case, again.point, residual, found.variance_inflation)
        return cost < share * found.cost
