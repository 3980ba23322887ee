"""Say what rows of a motion tell by themselves, before anything is simulated: what may be missing.

In each row a model says how joints accelerate, and so what each effect would change there. A regression on
all rows ranks the effects, one after the other, in seconds; simulated motions, which filter nothing, decide.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.confirmed import ToldByRows
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import OnProgress
from serpent_twin.identification.score_test import times_strength
from serpent_twin.identification.together import alternatives, spans
from serpent_twin.identification.tracer_fits import TracerFits
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector, effect_at
from serpent_twin.tables.log import Log

_LEAST = 0.08
"""Share of what is left of accelerations that an effect must remove, since what noise of the state does
passes for small effects; and half of it at its strength, where many laws bend
"""
_SHARES = (1.0, 0.5, 0.25)
"""Shares of the strength that first order says, at which it is tried"""


class RowFits(TracerFits):
    """The fits of accelerations in all rows."""

    def _identifiable(self, opening: Fit) -> None:
        """Nothing: a filter hides small effects, of which motions tell several times as much."""
        self._at_opening = self.case, opening, []

    def told(self) -> ToldByRows:
        """What the rows say may be missing."""
        _, base = self._calibrate(ParameterVector.nominal(self.case.declared))
        case, known = self.case, self.case.candidates
        names = [name for name in known if name not in case.unseen]
        scores = self.trials.scores("1_base", case, base, names)
        found = self.trials.placed("1_base", case, base, scores)
        several = alternatives(case, base, spans(self.trials, case, base, found), _LEAST)
        slots, point = list[dict[str, Array]](), base.point
        for one in several:
            slot = dict[str, Array]()
            for name in sorted(one, key=self._in_python):
                whole = found[name].sized(known[name], one[name])
                tried = [times_strength(known[name], whole, share) for share in _SHARES]
                before, after = self._left(base, point, [point.having(name, v) for v in tried])
                best = int(np.argmin(after))
                if after[best] < (1 - _LEAST / 2) * before:
                    slot[name] = tried[best]
            if slot:
                slots.append(slot)
                point = point.having(*next(iter(slot.items())))
        return ToldByRows(found, slots)

    def _left(
        self, base: Fit, point: ParameterVector, others: Sequence[ParameterVector]
    ) -> tuple[float, list[float]]:
        """Squares that a twin leaves, and each of some others, once numbers took up what they can."""
        known, some = Information.of(self.case, base), self.case.take(self.training, base.used)
        every = self.case.residual([point, *others], some).astype(float)
        left = [known.left(each.ravel()) if np.isfinite(each).all() else np.inf for each in every]
        return left[0], left[1:]

    def _in_python(self, name: str) -> bool:
        """Whether a candidate acts in each time step, so that a motion takes several times as long."""
        return effect_at(name, self.case.candidates[name].variants[0]).acts()


def in_rows(
    case: Case[Any] | None, training: Sequence[Log], notes: Checkpoints, on_progress: OnProgress
) -> Callable[[], ToldByRows] | None:
    """Tells what rows of training logs say by themselves; None where they say too little."""
    if case is None:
        return None
    pieces = case.pieces(training)
    return RowFits(case, pieces, pieces, notes.within("rows_"), on_progress, 0).told
