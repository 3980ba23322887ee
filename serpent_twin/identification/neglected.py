"""Say how much of what a fit leaves its effects may leave by themselves, as each simplifies what is there.

A law of friction is not quite the friction of a joint: what it neglects is a share of what it changes. Where
effects explain by far the most of an error, that share is as large as all that is left, and another effect
would be named for it.
"""

from typing import Any

from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.machines.case import Case


def neglected(case: Case[Any], found: Fit) -> float:
    """Share of the squares that a fit leaves which its effects may neglect [1]: of each strength, the part
    that its kind of effect states, to first order.
    """
    first, squares = len(found.free.declared), 0.0
    for n, (name, k) in enumerate(found.free.effects, first):
        by = case.candidates[name].model_error * float(found.point.effects[name][k])
        squares += by**2 * float((found.jacobian[n].astype(float) ** 2).sum())
    left = float((found.residual.astype(float) ** 2).sum())
    return squares / left if left else 0.0
