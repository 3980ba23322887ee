"""Find how well a machine's parameters can stand for an effect that it lacks.

To first order, parameters that would have to move far seem to leave more of an effect than they do: where
joints stick, a derivative holds for small steps alone. So a twin with the effect is fitted to that without.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import descend
from serpent_twin.identification.fitting.objective import At, Objective
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_STEPS = 8
_SMALL_SHARE = 0.03
"""A step that reduces the cost by less than this share is the last: a limit then hardly changes"""
_NEAR = 0.05
"""A first step whose cost differs from the predicted one by less than this share is the last, too"""


@dataclass(frozen=True, eq=False)
class Imitated:
    """What is left of an effect's change once the parameters took up what they can."""

    left: Array
    """What is left of the residual, (N,)"""
    cost: float
    """Weighted squares of what is left, and the prior cost of the parameters' steps [1]"""


class Imitation(Objective):
    """The objective of a twin with an effect that is to do what an opening's twin without it does."""

    def __init__(
        self,
        case: Case[Any],
        pieces: Any,
        opening: Fit,
        known: Information,
        scale: Array,
        effect: tuple[str, Array],
        goal: Callable[[float | None], Array],
    ) -> None:
        """`known` is the opening's information by other weights, `scale` what these make of its numbers (N,),
        and the effect a name and values. `goal` gives the opening's residual in time steps of a length [s].
        """
        super().__init__(case, case.take(pieces, opening.used), opening.free, None)
        self.variance_inflation = 1 / known.weight
        self._effect, self._start = effect, opening.point
        self._scale = scale.reshape(opening.residual.shape)
        self._slopes = known.slopes.reshape(len(self.free), *opening.residual.shape)
        self._step = case.coarse_step([opening.point.having(*effect)])
        self._goal = goal(self._step)

    def residuals(self, points: Sequence[ParameterVector]) -> Array:
        """What the effect and the parameters change together, (points, S, n)."""
        with_it = [point.having(*self._effect) for point in points]
        found = self.case.residual(with_it, self.some, self._step)
        return np.asarray((found - self._goal) * self._scale)

    def fitted(self, told: float) -> Imitated | None:
        """A few steps with the opening's derivative; one alone where its cost is the one that first order
        predicts, `told`. None where the effect is unstable.
        """
        residual = self.residuals([self._start])[0]
        at = At(self._start, residual, self.cost(residual, self._start))
        if not np.isfinite(at.cost):
            return None
        start = at

        def small(before: At, after: At) -> bool:
            as_told = before is start and abs(after.cost - told) < _NEAR * told
            return as_told or before.cost - after.cost < _SMALL_SHARE * after.cost

        at, _ = descend(self, at, self._slopes.astype(np.float32), _STEPS, small)
        return Imitated(at.residual.ravel().astype(float), at.cost)
