"""Say what numbers of a model change of what is measured in the same states.

Numbers that show in different channels are changed together in one twin. Source: Curtis, Powell and Reid, On
the estimation of sparse Jacobian matrices, IMA Journal of Applied Mathematics 13, 1974.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.machines.model.motion import RowStates
from serpent_twin.machines.model.seen import Seen
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.model.variants import Variants

Changed = Callable[[Sequence[Sequence[int]]], tuple[list[DrivenRuns], Seen]]
"""Runs of twins in which groups of numbers are changed, and what is seen of the twin and then of these"""
_PROBED = 8
"""Rows in which each number is changed alone, for the channels in which it shows"""
_NOTHING = 1e-6
"""Fraction of the largest change of a channel, below which a change is rounding"""


def shown_by(
    driven: DrivenRuns, states: RowStates, kinds: Sequence[str], changed: Changed
) -> Array:
    """What is measured more in S runs if one of P numbers of some kinds is changed, (P, S, T, C). One that
    does nothing in a few rows, such as the slack of a slack cable, is still sought where others of its kind
    do something.
    """
    rows, count = states.pose.shape[1], len(kinds)
    few = np.unique(np.linspace(0, rows - 1, _PROBED).astype(int)).tolist()
    alone = _differences(driven, states, few, *changed([[p] for p in range(count)]))
    size = np.abs(alone).max(axis=(1, 2))
    shows = size > _NOTHING * size.max(axis=0, initial=0.0)
    some = {kind for kind, of in zip(kinds, shows, strict=True) if of.any()}
    shows |= (~shows.any(axis=1) & [kind in some for kind in kinds])[:, None]
    groups = _disjoint(shows)
    out = np.zeros((count, *states.pose.shape[:2], size.shape[1]))
    if groups:
        for which, of in zip(
            groups, _differences(driven, states, range(rows), *changed(groups)), strict=True
        ):
            out[which] = of * shows[which, None, None]
    return out


def _disjoint(shows: NDArray[np.bool_]) -> list[list[int]]:
    """Groups of numbers that show in no channel together, of what each shows in, (P, C)."""
    groups: list[list[int]] = []
    taken: list[NDArray[np.bool_]] = []
    for p in np.flatnonzero(shows.any(axis=1)).tolist():
        free = (n for n, of in enumerate(taken) if not (of & shows[p]).any())
        if (n := next(free, len(groups))) == len(groups):
            groups.append([])
            taken.append(np.zeros_like(shows[p]))
        groups[n].append(p)
        taken[n] |= shows[p]
    return groups


def _differences(
    driven: DrivenRuns,
    states: RowStates,
    rows: Sequence[int],
    others: Sequence[DrivenRuns],
    seen: Seen,
) -> Array:
    """What is measured of other twins beyond that of a twin in the same states of some rows, (Q, S, R, C)."""
    models = [model for of in (driven, *others) for model in of.models]
    runs, found = Variants(driven, models, states.step), []
    seen.bind(runs.batch, models)
    for t in rows:
        runs.put(
            t,
            qpos=states.pose[:, t],
            qvel=states.rate[:, t],
            act=states.activation[:, t],
            ctrl=np.stack([of.told_at(t) for of in (driven, *others)]),
            qfrc_applied=states.applied[:, t],
        )
        runs.act(states.fields, (t,))
        runs.batch.forward(stage=seen.stage)
        shown = runs.apart(seen.read(runs.batch, runs.older))
        found.append(shown[1:] - shown[0])
    return np.stack(found, axis=2)
