"""Settle a model in every row of a log, and keep the poses found for the next twin."""

from collections.abc import Hashable

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.measured import Runs
from serpent_twin.machines.model.seen import Seen, segments_of
from serpent_twin.runs.processes import threads
from serpent_twin.sim.equilibrium import Equilibrium
from serpent_twin.sim.stepper import side_by_side

_FELL_BACK = 0.2
"""Share of poses that are far from those known, above which new ones replace them"""


def settled(
    model: mujoco.MjModel,
    told: Array,
    begin: Array,
    seen: Seen,
    known: "Rests",
    pieces: Runs,
) -> Array:
    """What is seen of the poses in which a model rests, (S, T, C), told (S, T, nu); NaN where it does not
    come to rest. The search begins with the poses of another twin that are known, or with one pose, (nq,).
    """
    S, T = told.shape[:2]
    batch = side_by_side([model] * (S * T), threads())
    rest = Equilibrium(batch)
    seen.bind(batch)
    batch.bind("ctrl")[:, : told.shape[2]] = told.reshape(S * T, -1)  # the others are of effects
    pose = batch.bind("qpos")
    near, inverse = known.of(model.nv, pieces)
    pose[...] = begin if near is None else near
    came = rest.settle(inverse)
    if rest.continued > _FELL_BACK * S * T and came.all():
        known.keep(pieces, pose.copy(), rest.inverse_stiffness())
        batch.forward()
    found = seen.read(batch)
    found[~came] = np.nan
    return found.reshape(S, T, -1)


class Rests:
    """Poses of twins at rest, and how they give way, from which those of similar twins are found: of each row
    the last that was kept.
    """

    def __init__(self) -> None:
        self._found: dict[tuple[Hashable, ...], tuple[Array, Array]] = {}

    def of(self, nv: int, pieces: Runs) -> tuple[Array | None, Array | None]:
        """Poses (n, nq) and inverse stiffnesses (n, nv, nv) of all rows in models of so many degrees of
        freedom; None where some are unknown.
        """
        found = [self._found.get((nv, *which)) for which in segments_of(pieces)]
        if any(each is None for each in found):
            return None, None
        poses, inverse = zip(*[each for each in found if each], strict=True)
        return np.concatenate(poses), np.concatenate(inverse)

    def keep(self, pieces: Runs, poses: Array, inverse: Array) -> None:
        """Keep what was found of all rows."""
        rows = pieces.time.shape[1]
        for n, which in enumerate(segments_of(pieces)):
            at = slice(n * rows, (n + 1) * rows)
            key = (inverse.shape[-1], *which)
            self._found[key] = poses[at], inverse[at].astype(np.float32)
