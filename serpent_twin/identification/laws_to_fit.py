"""Choose which composed laws are fitted: each fit takes as long as screening a hundred places."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.identification.acceptance import parameters
from serpent_twin.identification.rivals import along_one_line
from serpent_twin.identification.score_test import Score, worth_fitting
from serpent_twin.machines.case import Case
from serpent_twin.machines.places import in_one_sensor

_ALIKE = 0.95
"""A simpler law is fitted first if it removes at least this fraction of what the best law removes"""
_BESIDE = 0.02
"""Share of its squares that a law may show in other sensors: segments start from measured poses, which a
marker that is shifted changes a little
"""
_SAME = 0.999
"""Cosine of two changes from which they are one"""
_OTHER = 0.6
"""The best law that changes something else is fitted, too, if it removes at least this fraction of what the
best law removes
"""


def laws_to_fit(
    case: Case[Any], found: Mapping[str, Score], least: float, most: int | None, beside: float
) -> list[str]:
    """The `most` best of some composed laws that remove the share `least` of the residual, and a share
    `beside` of what the best does; and the best of those that change something else.

    What shows in one sensor is small in all that is measured, and is not asked for `least`. Which is right, a
    force in the base's frame or in its link's, only fits can tell. Of those that remove as much as the best,
    the simplest come first, and last those of which a direction shows nowhere.
    """
    known = case.candidates
    several = [s for s in found.values() if s.share > least or sensor_of(case, s) is not None]
    best = max((each.share for each in several), default=0.0)
    worth = worth_fitting(several, known, _OTHER * best, len(several))
    worth.sort(
        key=lambda n: (
            (parameters(known[n]), known[n].flat) if found[n].share > _ALIKE * best else (np.inf,)
        )
    )  # stable: others stay in the order of what they remove
    worth = _of_each_change([found[name] for name in worth])
    first = [name for name in worth if found[name].share > beside * best][:most]
    changes = {name: known[name].composed.get("changes") for name in worth}
    others = [n for n in worth if changes[n] not in {changes[name] for name in first}]
    return [*first, *others[:1]]


def _of_each_change(several: Sequence[Score]) -> list[str]:
    """The names without those whose change one before them makes, too, as a load that is misread makes that
    of a torque: such a one is a rival, and needs no fit unless the other is accepted. What is the same only
    beside the free parameters, as a step and what holds where that does not, is not one change.
    """
    kept: list[Score] = []
    for each in several:
        if all(along_one_line(each.change, one.change) < _SAME for one in kept):
            kept.append(each)
    return [each.name for each in kept]


def sensor_of(case: Case[Any], score: Score) -> NDArray[np.bool_] | None:
    """The channels of the one sensor in which a composed law shows, as a mask (C,); None for others. Where
    each torque is measured by itself, effects that have a name show in one sensor as laws do.
    """
    if not (case.candidates[score.name].composed or case.adds_up):
        return None
    shown = (score.change.reshape(-1, case.channels).astype(float) ** 2).sum(axis=0)
    changed = shown > _BESIDE * shown.max()
    return changed if in_one_sensor(int(changed.sum()), case.channels) else None
