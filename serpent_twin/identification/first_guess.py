"""Guess where a fit starts, from what a row of a motion says of the next.

A simulation of one row cannot go astray, however far off a model is: multiple shooting with the shortest
segments. Source: Bock, Numerical treatment of inverse problems in chemical reaction kinetics, 1981.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.free_parameters import FreeParameters, free_parameters
from serpent_twin.identification.fitting.least_squares import OnProgress, fit, spread
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.tables.log import Log

STAGE = "first_guess"
"""Name of its stage"""
_ROUNDS, _SETTLED = 10, 0.9
"""Times that channels are weighed anew, at most; share of the squares left before, above which another time
gains little
"""


def guessed(
    case: Case[Any],
    training: Sequence[Log],
    on_progress: OnProgress,
    kept: Callable[[str, int, Callable[[], Array]], Array] = lambda _, __, make: make(),
) -> Case[Any]:
    """The case whose zeros are a first guess, as `kept` has it by a name: where the machine says that fits
    begin; and where it has short segments of the training logs, rigid parts where sites have them and all
    else as the segments say, if that leaves less of some usual ones.
    """
    begin, short = case.begin, case.shortest(training) is not None
    if not short and not begin.any():
        return case

    def made() -> Array:
        if not short:
            return begin
        on_progress("first guess of rigid parts")
        parts = case.by_sites(training)
        begun = case.starting(parts + begin)
        found = _guess(begun, training, begun.shortest(training), parts == 0, on_progress)
        return parts + begin + found

    found = case.starting(kept(STAGE, len(case.declared), made))
    return found.knowing_parts(training) if short else found


def _guess(
    case: Case[Any],
    training: Sequence[Log],
    short: Any,
    loose: NDArray[np.bool_],
    on_progress: OnProgress,
) -> Array:
    """What declared coordinates are more, (P,), of those that are `loose`, (P,): forces that a model lacks
    would bend parts that sites tell. Of all rounds, what leaves least of some usual segments; zeros if the
    case as it is does.
    """
    best = point = ParameterVector.nominal(case.declared)
    guess, free = case, free_parameters(case, ())
    free = replace(free, declared=tuple(k for k in free.declared if loose[k]))
    pieces = case.pieces(training)
    some = case.take(pieces, spread(len(pieces), case.segments[0]))

    def left(point: ParameterVector) -> float:
        return float((case.residual([point], some).astype(float) ** 2).sum())

    least = left(best)
    for n in range(1, _ROUNDS + 1):
        on_progress(f"first guess from row to row, {n}")
        guess = guess.reweighted(point, short)
        some_free = _shared(case, free) if n == 1 else free
        found = fit(guess, short, point, some_free, 1, len(short), used=range(len(short)))
        if not np.isfinite(found.residual).all():  # stable in longer time steps alone
            break
        point, guess = found.point, replace(guess, noise=found.noise)
        before, now = least, left(point)
        if now < before:
            best, least = point, now
        if n > 1 and not now < _SETTLED * before:
            break
    return best.declared


def _shared(case: Case[Any], free: FreeParameters) -> FreeParameters:
    """The free parameters without those by which one of several differs from what all share: far off, all
    are off alike, and a first step would have each one make up for the others.
    """
    return FreeParameters(
        tuple(k for k in free.declared if len(case.quantities[k].of) == 1), free.effects
    )
