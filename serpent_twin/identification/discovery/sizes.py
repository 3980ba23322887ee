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
    """Sizes, (W, d), and by how much each reduces the residual's squares, (W,); none where hardly anything
    is left of the change. A component that shows nothing, as across a machine that moves in a plane, is zero.
    """
    d = pulls.shape[1]
    scale = np.maximum(np.einsum("wdd->w", raw) / d, 1e-30)
    shows = np.einsum("wdd->wd", grams) != 0
    grams = grams + np.where(shows, 0.0, scale[:, None])[..., None] * np.eye(d)
    low = np.linalg.eigvalsh(grams)[:, 0]
    usable = low > FLAT * scale
    safe = np.where(usable[:, None, None], grams, np.eye(d))
    size = -np.linalg.solve(safe, pulls[..., None])[..., 0]
    return size, np.where(usable, -(size * pulls).sum(axis=1), 0.0)


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
