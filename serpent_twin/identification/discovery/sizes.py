"""Find the sizes with which changes at a place remove most of a residual, from sums over its rows."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.discovery.followed import Way
from serpent_twin.identification.discovery.sums import Sums

FLAT = 1e-4
"""The free parameters leave at least this share of a change's squares"""


def solved(pulls: Array, grams: Array, raw: Array) -> tuple[Array, Array]:
    """Sizes, (W, d), and by how much each reduces the residual's squares, (W,). A change has no size along a
    direction of which hardly anything is left, as across a machine that moves in a plane, or where the free
    parameters do the same.
    """
    scale = np.einsum("wdd->w", raw)[:, None] / pulls.shape[1]
    value, axes = np.linalg.eigh(grams)
    shows = value > np.maximum(FLAT * scale, 1e-30)
    along = np.einsum("wdk,wd->wk", axes, pulls)
    size = np.where(shows, -along / np.where(shows, value, 1.0), 0.0)
    return np.einsum("wdk,wk->wd", axes, size), -(size * along).sum(axis=1)


def shows_flat(raw: Array) -> bool:
    """Whether a direction shows next to nothing, of the products of components with each other, (d, d)."""
    values = np.linalg.eigvalsh(raw)
    return bool(values[0] < FLAT * values.mean())


def of_one_phase(
    several: Sequence[Way], found: Sums, grams: Array
) -> tuple[list[Way], Array, Array]:
    """Periodic laws with the best phase, from their sines and cosines, with their sizes, (K, d), and by how
    much each reduces the residual's squares, (K,); of a vector, the phase of its strongest component.
    """
    d = grams.shape[1]
    at = [n for n, way in enumerate(several) if way.shape == "periodic" and not way.second]
    sine = np.array(at, np.intp)
    cosine, across = sine + 1, found.beside[sine]
    upper = np.concatenate([grams[sine], across], axis=2)
    lower = np.concatenate([across.swapaxes(1, 2), grams[cosine]], axis=2)
    gram = np.concatenate([upper, lower], axis=1)
    pull = np.concatenate([found.pulls[sine], found.pulls[cosine]], axis=1)
    size, gain = solved(pull, gram, found.raw[sine] + found.raw[cosine])
    kept = gain > 0
    u, _, v = np.linalg.svd(size[kept].reshape(-1, 2, d))  # phases by components
    phase, along = np.arctan2(u[:, 1, 0], u[:, 0, 0]), u[:, :, :1] * v[:, :1]
    along, pull, gram = along.reshape(-1, 2 * d), pull[kept], gram[kept]
    pulled = (along * pull).sum(axis=1)
    length = -pulled / np.einsum("kd,kde,ke->k", along, gram, along)
    ways = [replace(several[n], second=float(by)) for n, by in zip(sine[kept], phase, strict=True)]
    return ways, length[:, None] * v[:, 0], -length * pulled
