"""Select the parts of the residual to analyse, and estimate the noise of each."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.joint_attribution import JointAttribution
from serpent_twin.residual.noise import Noise
from serpent_twin.residual.spectrum import known

MOST_COMPONENTS = 8


@dataclass(frozen=True, eq=False)
class Targets:
    """Channels of the residual, and the sets of them that may depend on something."""

    names: tuple[str, ...]
    """Name of each target in words, within a sentence, (K,)"""
    kinds: tuple[str, ...]
    """markers, joint, size or load, (K,)"""
    values: Array
    """Channels without their means, (S, T, C); markers in mm, loads in % of the stall torque"""
    member: np.ndarray
    """Whether a channel belongs to a target, (K, C)"""
    total: Array
    """Variance by which each target's share is counted, noise included, (K,)"""
    noise: Array
    """Part of it that is noise, 0 where that is unknown, (K,)"""


def marker_targets(c: Comparison, noise: Noise, found: JointAttribution | None) -> Targets:
    """All markers together, then each joint's rotation, then the size of each joint's error.

    A joint's rotation is measured in mm, by how far it moves the markers. All shares are of all markers'
    variance: a part counts by its millimetres, however much of them follows something. Without joint
    geometry the single markers replace the joints.
    """
    scale, K = c.marker.scale, c.marker.dimension
    residual = scale * known(c.marker_residual.reshape(*c.time.shape, -1))
    parts, coloured = _components(residual), scale**2 * K * float(np.nansum(noise.marker**2))
    total = float(np.mean(np.sum(residual**2, axis=-1)))
    if found is not None:
        single = scale * known(found.rotation * found.lever * np.sqrt(c.marker_residual.shape[2]))
        names = tuple(f"the rotation at {name}" for name in c.joint_names)
        size, sizes = (
            known(np.abs(single)),
            tuple(f"how far {name} is off" for name in c.joint_names),
        )
    else:
        single, names = np.zeros((*c.time.shape, 0)), ()
        size = scale * known(c.distance)
        sizes = tuple(f"how far {name} is off" for name in c.marker_names)
    values = np.concatenate([parts, single, size], axis=-1)
    kinds = ("markers",) + ("joint",) * len(names) + ("size",) * len(sizes)
    member = _members([parts.shape[2]] + [1] * (len(names) + len(sizes)))
    totals, quiet = (np.full(len(kinds), each) for each in (total, coloured))
    return Targets((c.marker.what,) + names + sizes, kinds, values, member, totals, quiet)


def load_targets(c: Comparison, noise: Noise) -> Targets:
    """Each load; those without a residual keep a target of zeros."""
    values = c.load.scale * known(c.load_residual)
    names = tuple(f"{name}'s {c.load.one}" for name in c.load_names)
    member = np.eye(len(names), dtype=bool)
    total = np.mean(values**2, axis=(0, 1))
    quiet = (c.load.scale * np.nan_to_num(noise.load)) ** 2
    return Targets(names, ("load",) * len(names), values, member, total, quiet)


def _components(residual: Array) -> Array:
    """Principal components that hold 99 % of the variance, a few at the most, (S, T, C)."""
    flat = residual.reshape(-1, residual.shape[2])
    size, axes = np.linalg.eigh(flat.T @ flat)
    size, axes = size[::-1], axes[:, ::-1]
    enough = int(np.searchsorted(np.cumsum(size), 0.99 * size.sum())) + 1
    return residual @ axes[:, : min(enough, MOST_COMPONENTS)]


def _members(sizes: list[int]) -> np.ndarray:
    """Consecutive channels for each target, (K, C)."""
    owner = np.repeat(np.arange(len(sizes)), sizes)
    return owner[None, :] == np.arange(len(sizes))[:, None]
