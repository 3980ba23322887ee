"""Say in which time steps dry friction sticks, and what that adds to a linear motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.friction_softness import friction_inertia
from serpent_twin.engine.recorded_steps import RecordedSteps

_SLIDES = 1 - 1e-6
"""Share of its limit from which friction slides"""
_SHORTEST = 2.0
"""Time steps that MuJoCo's time constants of constraints have at least"""


@dataclass(frozen=True)
class Constants:
    """MuJoCo's friction constraints λ = −D (J a + B J v) up to a limit, F of each of S runs."""

    limit: Array
    """[N m or N], (S, F)"""
    inertia: Array
    """D [kg m² or kg], (S, F)"""
    rate: Array
    """B [1/s], (S, F)"""

    @classmethod
    def of(
        cls,
        models: Sequence[mujoco.MjModel],
        dofs: Sequence[int],
        tendons: Sequence[int],
        dt: Array,
    ) -> "Constants":
        """Constants of degrees of freedom, and of tendons after them, in time steps [s], (S,)."""
        each = [
            np.concatenate([_fields(m, "dof", dofs), _fields(m, "tendon", tendons)], axis=1)
            for m in models
        ]
        limit, weight, time, damping, rest, most = np.moveaxis(np.array(each), 1, 0)
        brisk = np.maximum(time, _SHORTEST * dt[:, None])
        rate = np.where(time > 0, 2 / (most * brisk), -damping / most)
        return cls(limit, friction_inertia(rest, weight), rate)

    def repeated(self, rows: int) -> "Constants":
        """Constants of each of so many rows of each run, (S R, F)."""
        return Constants(*(of.repeat(rows, axis=0) for of in (self.limit, self.inertia, self.rate)))

    @staticmethod
    def stacked(several: Sequence["Constants"], like: Array) -> "Constants":
        """Constants of Q twins, (…, F, Q), shaped as an array (…, F) if there are none."""
        if not several:
            return Constants(*[np.zeros((*like.shape, 0))] * 3)
        names = ("limit", "inertia", "rate")
        return Constants(
            *(np.stack([getattr(c, name) for c in several], axis=-1) for name in names)
        )

    def differ(self, other: "Constants") -> bool:
        """Whether any of another twin's is another."""
        return any(
            not np.array_equal(getattr(self, name), getattr(other, name))
            for name in ("limit", "inertia", "rate")
        )


def _fields(model: mujoco.MjModel, kind: str, which: Sequence[int]) -> Array:
    """Limit, inverse inertia, two of solref and two of solimp, (6, F)."""
    prefix = "tendon_sol" if kind == "tendon" else "dof_sol"
    suffix = "_fri" if kind == "tendon" else ""
    reference, impedance = (
        getattr(model, f"{prefix}{of}{suffix}")[list(which)] for of in ("ref", "imp")
    )
    least, most = mujoco.mjMINIMP, mujoco.mjMAXIMP
    return np.array(
        [
            getattr(model, f"{kind}_frictionloss")[list(which)],
            np.maximum(getattr(model, f"{kind}_invweight0")[list(which)], mujoco.mjMINVAL),
            *reference.T,
            *np.clip(impedance[:, :2], least, most).T,
        ]
    ).reshape(6, -1)


@dataclass(frozen=True)
class Rubbing:
    """Dry friction of N rows in each of their K time steps: F constraints of n free degrees of freedom."""

    arms: Array
    """What constraints move by the degrees of freedom, J, (P, N, F, n)"""
    constants: Constants
    """(N, F)"""
    speed: Array
    """J v, (N, K, F)"""
    faster: Array
    """J a, (N, K, F)"""
    own: Sequence[int]
    """The degree of freedom of each of the first constraints; the others are of tendons"""

    @classmethod
    def of(
        cls,
        models: Sequence[mujoco.MjModel],
        steps: RecordedSteps,
        tendons: Array,
        dt: Array,
        free: NDArray[np.intp],
    ) -> "Rubbing":
        """Friction in recorded time steps [s], (S,), of S runs; tendons' arms are (P, S R, ntendon, nv)."""
        S, R, K, nv = steps.position.shape
        rubs, pulls = rubbing(models, free)
        P, N = len(steps.middle), S * R
        joints = np.broadcast_to(np.eye(nv)[rubs], (P, N, len(rubs), nv))
        arms = np.concatenate([joints, tendons[:, :, pulls]], axis=2)
        speed, faster = np.zeros((2, N, K, arms.shape[2]))
        for k, p in enumerate(steps.part):
            for out, of in ((speed, steps.velocity), (faster, steps.acceleration)):
                out[:, k] = (arms[p] @ of[:, :, k].reshape(N, nv, 1))[..., 0]
        constants = Constants.of(models, rubs, pulls, dt).repeated(R)
        return cls(arms[..., free], constants, speed, faster, [list(free).index(n) for n in rubs])

    @cached_property
    def wanted(self) -> Array:
        """Forces of friction that had no limit, (N, K, F)."""
        of = self.constants
        return -of.inertia[:, None] * (self.faster + of.rate[:, None] * self.speed)

    @cached_property
    def sticks(self) -> NDArray[np.bool_]:
        """Which constraints stick, (N, K, F)."""
        return np.abs(self.wanted) < self.constants.limit[:, None] * _SLIDES

    def of_sticking(
        self, p: int, which: NDArray[np.bool_], sticks: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Inertia and damping of what sticks in a part of some rows, (m, n, n) each."""
        arms = self.arms[p, which]
        held = np.where(sticks, self.constants.inertia[which], 0.0)[..., None]
        across = arms.swapaxes(1, 2)
        return across @ (held * arms), across @ (held * self.constants.rate[which, :, None] * arms)

    def more(self, k: int, new: Array) -> Array:
        """Force of more dry friction of each degree of freedom in a time step per unit, (N, n): against its
        motion, `new`, (N, n), where it had none, and nothing while it sticks.
        """
        out, joints = new.copy(), slice(0, len(self.own))
        side = np.where(self.sticks[:, k, joints], 0.0, np.sign(self.wanted[:, k, joints]))
        out[:, self.own] = side
        return out

    def otherwise(self, p: int, k: int, others: Constants) -> Array:
        """Forces on the degrees of freedom in a time step, (N, n, Q), by Q others' constants, which differ a
        little, (N, F, Q).
        """
        of, speed = self.constants, self.speed[:, k, :, None]
        apart = self.faster[:, k, :, None] + of.rate[..., None] * speed
        sticking = -(others.inertia - of.inertia[..., None]) * apart
        sticking -= of.inertia[..., None] * (others.rate - of.rate[..., None]) * speed
        sliding = np.sign(self.wanted[:, k, :, None]) * (others.limit - of.limit[..., None])
        force = np.where(self.sticks[:, k, :, None], sticking, sliding)
        return self.arms[p].swapaxes(1, 2) @ force


def rubbing(
    models: Sequence[mujoco.MjModel], free: Sequence[int] | NDArray[np.intp]
) -> tuple[list[int], list[int]]:
    """The free degrees of freedom and the tendons that have dry friction in any of some models."""
    joints, tendons = (
        np.any([getattr(m, f"{kind}_frictionloss") for m in models], axis=0)
        for kind in ("dof", "tendon")
    )
    return [int(n) for n in free if joints[n]], np.flatnonzero(tendons).tolist()
