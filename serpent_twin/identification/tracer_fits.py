"""Fit the numbers of a machine, and those with effects: a calibration, a polish, a last fit."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.acceptance import matters
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.confirmed import ToldByRows
from serpent_twin.identification.detection import identifiability, opening_fit
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters, free_parameters
from serpent_twin.identification.fitting.least_squares import OnProgress, derives_cheaply, fit
from serpent_twin.identification.from_opening import Opening
from serpent_twin.identification.held_out import Errors
from serpent_twin.identification.identifiability import Identifiability
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.trials import Trials, in_words
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_LAST_STEPS = 2
"""Steps of a last fit where a derivative serves many: it begins near its end, and each simulates all logs"""


class TracerFits:
    """The fits of a trace of one machine's training segments, judged by its held-out ones."""

    def __init__(
        self,
        case: Case[Any],
        training: Any,
        held_out: Any,
        notes: Checkpoints,
        on_progress: OnProgress,
        seed: int,
        seconds: float = np.inf,
        told_by_rows: Callable[[], ToldByRows] | None = None,
    ) -> None:
        """Set up the fits of a trace; no further effect is sought once `seconds` from now have passed. Where
        rows of a motion say something by themselves, `told_by_rows` tells it.
        """
        self._told_by_rows = told_by_rows
        self.case, self.training, self.held_out = case, training, held_out
        self.notes, self.on_progress, self.seed = notes, on_progress, seed
        self.trials = Trials(training, held_out, notes, on_progress)
        self.final: ParameterVector | None = None
        self.identifiability: Identifiability | None = None
        self._at_opening: tuple[Case[Any], Fit, list[Score]]
        self.cautions: tuple[str, ...] = ()
        self._end = time.monotonic() + seconds

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

    def _identifiable(self, opening: Fit) -> Identifiability | None:
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
        """Fit an accepted effect again with everything else, with updated weights; as it was, if that only
        gains on the segments that the fit uses.
        """
        self.case = self._weighed_by(found)
        free = free_parameters(self.case, list(found.point.effects))
        after = self._fit(name, found.point, free, 2, carried=found)
        if self.trials.holds(self.case, found, after):
            return after
        self.case = replace(self.case, noise=found.noise)
        return found

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
