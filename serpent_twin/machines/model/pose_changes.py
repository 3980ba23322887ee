"""Differentiate what a model shows in poses at rest by what acts at its places."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import FORCES, HANDLES, Law
from serpent_twin.machines.model.poses import PosedRuns, RestingRuns, Rests
from serpent_twin.machines.model.state_laws import StateLaws

_DIFFERENCE = 1e-6
"""Finite difference of a coordinate [rad or m]"""
_PUSH = {"joint_torque": 1e-4, **dict.fromkeys(FORCES, 1e-4), "slack": 1e-6}
"""Change of each quantity [N m or N, N or N/m, m]: so small that hardly a tendon goes slack"""


class PoseChanges:
    """What S segments of T poses show of small changes.

    With g(q, u) the forces that are left in a pose q under a change u, and y(q, u) what is seen, it is
    ∂y/∂u − ∂y/∂q (∂g/∂q)⁻¹ ∂g/∂u, by differences about the poses at rest: nothing is settled again.
    Prescribed motion, limits, contacts and the twin's own laws are in g, dry friction is not.
    """

    def __init__(self, posed: PosedRuns, known: Rests, names: frozenset[str]) -> None:
        """`names` are those of places where something is changed or read."""
        settled, n = posed.settled(known), posed.time.size
        self._shape, self._came = posed.time.shape, settled.came
        self._runs = runs = RestingRuns(posed, n, names)
        runs.place(settled.pose, posed.told.reshape(n, -1), posed.flat_at, posed.time.ravel())
        assert runs.laws is not None
        self._laws = runs.laws
        self._gives = runs.rest.giving_way(self._came).inverse[self._came]
        self._force, self._seen = self._now()
        self._instant = self._laws.first().whole()
        self._slopes = self._by_pose()

    def reading(self, reading: str, place: str) -> Array:
        """What a law would follow, (S, T); zero where the model does not come to rest."""
        law = Law("joint_torque", place, "linear", reading, place)
        return self._of_all(self._instant.reading_of(law)[self._came]).reshape(self._shape)

    def change(self, law: Law) -> Array:
        """Change of what is seen per unit of each component of what a law changes, (d, S, T, C)."""
        d, by = HANDLES[law.handle].components, _PUSH[law.handle]
        found = [self._by(_Pushed(self._laws, law, push), by) for push in by * np.eye(d)]
        self._runs.rest.acting = self._laws
        return np.array([self._of_all(each).reshape(*self._shape, -1) for each in found])

    def _by(self, pushed: "_Pushed", by: float) -> Array:
        self._runs.rest.acting = pushed
        force, seen = self._now()
        moved = np.einsum("nij,nj->ni", self._gives, (force - self._force) / by)
        return (seen - self._seen) / by + np.einsum("nci,ni->nc", self._slopes, moved)

    def _by_pose(self) -> Array:
        """Change of what is seen with each coordinate, (m, C, nv), in the m rows that rest."""
        pose, found = self._runs.pose, []
        for k in range(pose.shape[1]):
            usual = pose[:, k].copy()
            pose[:, k] += _DIFFERENCE
            found.append((self._now()[1] - self._seen) / _DIFFERENCE)
            pose[:, k] = usual
        return np.stack(found, axis=-1)

    def _now(self) -> tuple[Array, Array]:
        """The forces that are left, (m, nv), and what is seen, (m, C), in the m rows that rest."""
        force = self._runs.rest.left_over(self._came)
        return force, self._runs.seen.read(self._runs.batch)[self._came]

    def _of_all(self, found: Array) -> Array:
        """Values of all rows, (S T, …), from those of the m rows that rest, with zeros in the others."""
        out = np.zeros((self._shape[0] * self._shape[1], *found.shape[1:]))
        out[self._came] = found
        return out


@dataclass(frozen=True)
class _Pushed:
    """What acts at rest, with a small change at one place."""

    laws: StateLaws
    law: Law
    push: Sequence[float]
    """Change of each component of what the law changes, (d,)"""

    def start(self) -> None:
        """Write all of it."""
        instant = self.laws.first()
        instant.change(self.law, self.push)
        self.laws.write(instant)
