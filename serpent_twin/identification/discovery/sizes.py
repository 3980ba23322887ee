"""Find the sizes with which changes at a place remove most of a residual, from sums over its rows."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.discovery.followed import Way
from serpent_twin.identification.discovery.sums import Sums

FLAT = 1e-4
"""Of a change's squares, what the free parameters leave at least"""


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
) -> list[tuple[Way, Array, float]]:
    """Periodic laws with the best phase, from their sines and cosines; of a vector, that of its strongest
    component.
    """
    out, d = [], grams.shape[1]
    for n, each in enumerate(several):
        if each.shape != "periodic" or each.second:
            continue
        across = found.beside[n]
        gram = np.block([[grams[n], across], [across.T, grams[n + 1]]])
        raw, pull = found.raw[n : n + 2], found.pulls[n : n + 2].ravel()
        size, gain = solved(pull[None], gram[None], raw.sum(axis=0)[None])
        if gain[0] <= 0:
            continue
        u, _, v = np.linalg.svd(size.reshape(2, d))  # phases by components
        phase, along = float(np.arctan2(u[1, 0], u[0, 0])), np.outer(u[:, 0], v[0]).ravel()
        length = -float(along @ pull) / float(along @ gram @ along)
        out.append((replace(each, second=phase), length * v[0], -length * float(along @ pull)))
    return out
