"""Make watertight solids from a few loops of points.

Every solid here is a loft: closed loops with the same number of points, one after the other. Its
two ends are capped, or, for a ring, the last loop meets the first. Lengths in metres.
"""

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from serpent_twin.arrays import Array

_CORNER = 3  # points on each rounded corner


def loft(loops: ArrayLike, ring: bool = False) -> trimesh.Trimesh:
    """Solid through closed loops (k, n, 3), each seen from its own middle; a `ring` has no ends."""
    loops = np.asarray(loops, float)
    k, n = loops.shape[:2]
    at = np.arange(k * n).reshape(k, n)
    low, high = (at, np.roll(at, -1, 0)) if ring else (at[:-1], at[1:])
    quads = [low, np.roll(low, -1, 1), np.roll(high, -1, 1), high]
    a, b, c, d = (corner.ravel() for corner in quads)
    faces, points = [np.c_[a, b, c], np.c_[a, c, d]], loops.reshape(-1, 3)
    if not ring:
        points = np.vstack([points, loops[0].mean(0), loops[-1].mean(0)])
        first, last = np.full(n, k * n), np.full(n, k * n + 1)
        faces += [np.c_[np.roll(at[0], -1), at[0], first], np.c_[at[-1], np.roll(at[-1], -1), last]]
    mesh = trimesh.Trimesh(points, np.vstack(faces), process=False)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def circle(radius: float, n: int) -> Array:
    """Points of a circle, (n, 2)."""
    turn = np.arange(n) * 2 * np.pi / n
    return radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def rounded(width: float, height: float, corner: float) -> Array:
    """Points of a rectangle with rounded corners, (12, 2), its middle at the origin."""
    corner = max(min(corner, 0.499 * width, 0.499 * height), 1e-5)
    arc = np.linspace(0, np.pi / 2, _CORNER)[None, :] + np.arange(4)[:, None] * np.pi / 2
    middle = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (
        width / 2 - corner,
        height / 2 - corner,
    )
    return (middle[:, None] + corner * np.stack([np.cos(arc), np.sin(arc)], -1)).reshape(-1, 2)


def across(loop: Array, x: float, middle: Sequence[float] = (0.0, 0.0)) -> Array:
    """A loop (n, 2) of y and z, put across the x axis at x, (n, 3)."""
    return np.column_stack([np.full(len(loop), x), loop + np.asarray(middle)])


def lathe(profile: ArrayLike, n: int) -> trimesh.Trimesh:
    """Solid of revolution about z of a closed profile of radius > 0 and height, (k, 2)."""
    radius, height = np.asarray(profile, float).T
    turn = circle(1.0, n)
    loops = [
        np.column_stack([r * turn, np.full(n, h)]) for r, h in zip(radius, height, strict=True)
    ]
    return loft(loops, ring=True)


def disc(
    radius: float, low: float, high: float, n: int = 24, chamfer: float = 4e-4
) -> trimesh.Trimesh:
    """Cylinder about z from height `low` to `high` with chamfered edges."""
    edge = [(radius - chamfer, low), (radius, low + chamfer)]
    edge += [(radius, high - chamfer), (radius - chamfer, high)]
    return loft(np.array([np.column_stack([circle(r, n), np.full(n, h)]) for r, h in edge]))


def strut(sections: ArrayLike, corner: float = 1e-3) -> trimesh.Trimesh:
    """Bar along x through sections x, y, z, width along y, height along z, (k, 5)."""
    rows = np.asarray(sections, float)
    return loft(np.array([across(rounded(w, h, corner), x, (y, z)) for x, y, z, w, h in rows]))


def block(low: ArrayLike, high: ArrayLike, corner: float = 1e-3) -> trimesh.Trimesh:
    """Box between two corners; its edges along x are rounded, those across chamfered."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    (x0, x1), (_, w, h), (_, y, z) = (low[0], high[0]), high - low, (low + high) / 2
    cut = min(corner, 0.2 * (x1 - x0)) * 0.6
    ends = [(x0, cut), (x0 + cut, 0.0), (x1 - cut, 0.0), (x1, cut)]
    return strut(np.array([(x, y, z, w - 2 * inset, h - 2 * inset) for x, inset in ends]), corner)


def hoop(
    x0: float,
    x1: float,
    outer: tuple[float, float],
    inner: tuple[float, float],
    lift: float = 0.0,
) -> trimesh.Trimesh:
    """Rectangular ring about the x axis; `outer` is y and z size, set off by `lift` along z."""
    cut = 0.12 * (x1 - x0)
    full, small = rounded(*outer, 0.006), rounded(outer[0] - 2 * cut, outer[1] - 2 * cut, 0.006)
    hole = rounded(*inner, 0.005)
    loops = [across(small, x0, (0, lift)), across(full, x0 + cut, (0, lift))]
    loops += [across(full, x1 - cut, (0, lift)), across(small, x1, (0, lift))]
    return loft(np.array([*loops, across(hole, x1), across(hole, x0)]), ring=True)


def beam(start: ArrayLike, end: ArrayLike, width: float) -> trimesh.Trimesh:
    """Square bar between two points, with rounded edges."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    sideways = np.cross([0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [0.0, 1.0, 0.0], along)
    sideways /= np.linalg.norm(sideways)
    bar = strut([(0.0, 0, 0, width, width), (length, 0, 0, width, width)], width / 4)
    turn = np.column_stack([along, sideways, np.cross(along, sideways)])
    return placed(bar, turn, start)


def placed(
    mesh: trimesh.Trimesh, turn: ArrayLike | None = None, to: ArrayLike = (0.0, 0.0, 0.0)
) -> trimesh.Trimesh:
    """A copy of a mesh, turned by a rotation (3, 3), then moved."""
    points = mesh.vertices if turn is None else mesh.vertices @ np.asarray(turn).T
    return trimesh.Trimesh(points + np.asarray(to), mesh.faces, process=False)


def joined(*solids: trimesh.Trimesh) -> trimesh.Trimesh:
    """One mesh of several solids, which may overlap."""
    first = np.cumsum([0, *[len(solid.vertices) for solid in solids[:-1]]])
    faces = [solid.faces + start for solid, start in zip(solids, first, strict=True)]
    points = np.vstack([solid.vertices for solid in solids])
    return trimesh.Trimesh(points, np.vstack(faces), process=False)
