"""Transform the cameras' coordinates into the base frame."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.runs.files import write_json
from serpent_twin.stored import many, within

COLLINEAR = 0.02  # second over first singular value below which points lie on a line
ORTHOGONAL = 1e-6  # error of RᵀR that is rounding in a file
_AGAIN = "Make the file with `python -m serpent_twin.mocap frame`."
_Row = Annotated[tuple[Annotated[float, within(-1.001, 1.001)], ...], many(3)]


@dataclass(frozen=True, eq=False)
class Rigid:
    """A rotation and a translation: cameras' frame to base frame, or any frame to another."""

    rotation: Array
    """(3, 3), determinant +1."""
    translation: Array
    """[m], (3,)."""
    residual: float = 0.0
    """Root mean square of what the fit left [m]; 0 for a given transform."""
    count: int = 0
    """Number of point pairs in the fit; 0 for a given transform."""

    def apply(self, points: ArrayLike) -> Array:
        """Points [m], (..., 3), in the target frame."""
        return np.asarray(points, float) @ self.rotation.T + self.translation

    def inverse(self) -> "Rigid":
        """The transform back."""
        rotation = self.rotation.T
        return Rigid(rotation, -rotation @ self.translation, self.residual, self.count)

    def save(self, path: Path, notes: Mapping[str, Any] | None = None) -> None:
        """Write as JSON, with further keys."""
        content = {key: np.asarray(value).tolist() for key, value in asdict(self).items()}
        named = {"rotation": content["rotation"], "translation_m": content["translation"]}
        named |= {"residual_rms_m": content["residual"], "count": content["count"]}
        write_json(path, named | dict(notes or {}))

    @classmethod
    def load(cls, path: Path) -> "Rigid":
        """Read what `save` wrote, or raise a `SerpentError` that states what is wrong with it."""
        found = stored.read_json(path, FrameFile, _AGAIN)
        rotation = np.array(found.rotation)
        if not _is_rotation(rotation):
            raise SerpentError(f"{path}: rotation is no rotation matrix. {_AGAIN}")
        return cls(rotation, np.array(found.translation_m), found.residual_rms_m, found.count)


class FrameFile(stored.OpenForm, frozen=True):
    """The content of a frame's file, with further keys."""

    rotation: Annotated[tuple[_Row, ...], many(3)]
    translation_m: Annotated[tuple[Annotated[float, within(-1000.0, 1000.0, "m")], ...], many(3)]
    residual_rms_m: Annotated[float, within(0.0, 1000.0, "m")] = 0.0
    count: Annotated[int, within(0, 10**9)] = 0


IDENTITY = Rigid(np.eye(3), np.zeros(3))


def fit_rigid(source: ArrayLike, target: ArrayLike) -> Rigid:
    """Least-squares rotation and translation of points source (N, 3) onto target (N, 3) [m].

    Pairs with a NaN are left out; a reflection is never returned. Raises a `SerpentError` when
    fewer than three pairs, or points on a line, leave a rotation open. Source: Kabsch 1976.
    """
    source, target = np.asarray(source, float), np.asarray(target, float)
    seen = np.isfinite(source).all(axis=-1) & np.isfinite(target).all(axis=-1)
    source, target = source[seen], target[seen]
    if len(source) < 3:
        raise SerpentError(
            f"a rigid fit needs three points that are seen in both frames; there are {len(source)}. "
            "Make more markers visible."
        )
    centre, goal = source.mean(axis=0), target.mean(axis=0)
    for points in (source - centre, target - goal):
        spread = np.linalg.svd(points, compute_uv=False)
        if spread[1] <= COLLINEAR * spread[0]:
            raise SerpentError(
                f"the {counted(len(source), 'point')} of a rigid fit lie on a line, so the "
                f"rotation about it is "
                "open. Add a marker beside the line."
            )
    rotation = _nearest_rotation((target - goal).T @ (source - centre))
    left = target - goal - (source - centre) @ rotation.T
    residual = float(np.sqrt((left**2).sum(axis=-1).mean()))
    return Rigid(rotation, goal - rotation @ centre, residual, len(source))


def _nearest_rotation(covariance: Array) -> Array:
    u, _, vt = np.linalg.svd(covariance)
    sign = np.sign(np.linalg.det(u @ vt))
    return u @ np.diag([1.0, 1.0, sign]) @ vt


def _is_rotation(matrix: Array) -> bool:
    error = np.abs(matrix.T @ matrix - np.eye(3)).max()
    return bool(error < ORTHOGONAL and np.linalg.det(matrix) > 0)
