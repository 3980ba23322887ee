"""Say in which time steps the springs of tendons pull, and what that changes of a linear motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.recorded_steps import RecordedSteps


@dataclass(frozen=True)
class StretchedSprings:
    """Springs of tendons in N rows, at n free degrees of freedom."""

    which: Sequence[int]
    """The tendons, (L,)"""
    arms: Array
    """Derivatives of the tendons' lengths by the degrees of freedom, (P, N, L, n)"""
    stiffness: Array
    """Stiffness of the tendons' springs in each time step [N/m], (N, K, L)"""
    stiffer: Array
    """Stiffness in each time step less that amid its part of the row [N/m], (N, K, L)"""

    @classmethod
    def of(
        cls, models: Sequence[mujoco.MjModel], steps: RecordedSteps, arms: Array
    ) -> "StretchedSprings":
        """Springs in recorded steps of S runs of some models; arms of all tendons are (P, N, ntendon, n)."""
        S, R, K, _ = steps.length.shape
        which = sprung(models)
        rest = steps.in_steps("tendon_lengthspring", models)[..., which, :]
        slope = steps.in_steps("tendon_stiffness", models)[..., which]
        stiffness = np.array(
            [
                _stiffness(m, which, steps.length[s][..., which], rest[s], slope[s])
                for s, m in enumerate(models)
            ]
        ).reshape(S * R, K, len(which))
        amid = stiffness[:, steps.middle[steps.part]]
        return cls(which, arms[:, :, which], stiffness, stiffness - amid)

    def slack(self, p: int, k: int) -> Array:
        """Forces by the slack of each tendon in a time step, (N, n, L)."""
        return self.arms[p].swapaxes(1, 2) * self.stiffness[:, k, None]

    def change(self, by_position: Array, p: int, k: int, amid: Array) -> None:
        """Write the forces by positions in a time step, (N, n, n), which are others amid the part."""
        which = self.stiffer[:, k].any(axis=1)
        if k:
            which |= self.stiffer[:, k - 1].any(axis=1)
        arms, stiffer = self.arms[p, which], self.stiffer[which, k, :, None]
        by_position[which] = amid[which] - arms.swapaxes(1, 2) @ (stiffer * arms)


def sprung(models: Sequence[mujoco.MjModel]) -> list[int]:
    """Tendons with springs in any of some models."""
    return np.flatnonzero(np.any([m.tendon_stiffness for m in models], axis=0)).tolist()


def _stiffness(
    model: mujoco.MjModel, which: Sequence[int], length: Array, rest: Array, slope: Array
) -> Array:
    """Derivative of tendons' forces by their lengths [N/m], (…, L), of springs between two lengths of rest,
    (…, L, 2), from which their forces begin with a slope [N/m], (…, L).
    """
    low, high = rest[..., 0], rest[..., 1]
    stretch = length - np.clip(length, low, high)
    own = model.tendon_stiffness[list(which)]
    first, second = model.tendon_stiffnesspoly[list(which), :2].T
    share = np.where(own, slope, 1.0) / np.where(own, own, 1.0)
    grows = slope + share * stretch * (2 * first + 3 * stretch * second)
    return np.where((stretch != 0.0) | (low == high), grows, 0.0)
