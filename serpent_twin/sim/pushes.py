"""Push the simulated arm's links: known forces, one at a time."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import scipy
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin import tables
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arm.mjcf import JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

COLUMNS = ("push_link", "push_x", "push_y", "push_z")
"""Columns of a log: the link that is pushed, 0 for none, and the force in the base frame [N]"""
SHAPES = ("step", "ramp", "swing")
_NUMBERS = ("link", "begin", "end", "force_x", "force_y", "force_z")
_MOST = 50.0  # [N]: a hundred times what the arm can hold at its tip
_ADVICE = f"A push is a line of {', '.join((*_NUMBERS, 'shape'))} and, for a swing, rate."
_SIZES = 0.1, 1.5  # [N]
_RATES = 0.1, 1.0  # [Hz]
_LEAST_ROOM = 0.4
"""Least share of a random push's part of the session that is left without a force"""


@dataclass(frozen=True)
class Push:
    """A force on one link's centre of mass for a time; the last link's is that without the jaw."""

    link: int
    """1 … 9"""
    force: tuple[float, float, float]
    """Force in the base frame, at its greatest [N]"""
    begin: float
    """Time in the session [s]"""
    end: float
    """[s]"""
    shape: str = "step"
    """step: there at once; ramp: grows evenly until the end; swing: a sine from the beginning on"""
    rate: float = 0.0
    """Frequency of a swing [Hz]"""

    def at(self, time: float) -> Array:
        """The force at a time in the session [s], in the base frame [N], (3,)."""
        if not self.begin <= time < self.end:
            return np.zeros(3)
        since = time - self.begin
        share = {
            "step": 1.0,
            "ramp": since / (self.end - self.begin),
            "swing": np.sin(2 * np.pi * self.rate * since),
        }
        return share[self.shape] * np.array(self.force)


def links_and_base(model: mujoco.MjModel) -> tuple[NDArray[np.intp], int, "Rotation"]:
    """The links' bodies, (9,), the base's, and how the base is turned in the world."""
    links = model.jnt_bodyid[[model.joint(name).id for name in JOINTS]]
    base = int(model.body_parentid[links[0]])
    turned = scipy.spatial.transform.Rotation.from_quat(model.body_quat[base], scalar_first=True)
    return links, base, turned


class LinkForces:
    """The forces on the links of all runs of a batch."""

    def __init__(self, batch: Batch) -> None:
        self._links, _, self._from_base = links_and_base(batch.model)
        self._applied = batch.bind("xfrc_applied")

    def apply(self, pushes: Sequence[Push], time: float) -> None:
        """Push from now on as at a time in the session [s]."""
        if not pushes:
            return
        self._applied[...] = 0.0
        if found := _acting(pushes, time):
            force = self._from_base.apply(found.at(time))
            self._applied[:, self._links[found.link - 1], :3] = force


def columns(pushes: Sequence[Push], time: float) -> dict[str, float]:
    """What a log says of the force at a time in the session [s]: the link, 0 for none, and the force [N]."""
    found = _acting(pushes, time)
    link, force = (found.link, found.at(time)) if found else (0, np.zeros(3))
    return dict(zip(COLUMNS, map(float, (link, *force)), strict=True))


def read(path: Path) -> tuple[Push, ...]:
    """The pushes of a table, in their order; raises a `SerpentError` that names the line that is wrong."""
    table = tables.read(path, _ADVICE).columns
    if lost := [name for name in (*_NUMBERS, "shape") if name not in table]:
        raise SerpentError(f"{path} lacks {listed(lost)}. {_ADVICE}")
    several = [
        _push({name: column[n] for name, column in table.items()}, f"{path}, line {n + 2}")
        for n in range(len(table["link"]))
    ]
    several.sort(key=lambda each: each.begin)
    for one, other in pairwise(several):
        if other.begin < one.end:
            raise SerpentError(
                f"{path}: a push begins at {other.begin:g} s, before that of {one.begin:g} s ends. Only one "
                "force can act at a time: let the second begin later."
            )
    return tuple(several)


def drawn(rng: np.random.Generator, count: int, duration: float) -> tuple[Push, ...]:
    """Draw `count` random pushes, one in each part of a session [s]: half of them at the last link,
    0.1 … 1.5 N in any direction, of all shapes.
    """
    part, several = duration / max(count, 1), []
    for n in range(count):
        link = N_JOINTS if rng.random() < 0.5 else int(rng.integers(1, N_JOINTS + 1))
        size = np.exp(rng.uniform(*np.log(_SIZES)))
        direction = rng.standard_normal(3)
        force = size * direction / np.linalg.norm(direction)
        lasts = rng.uniform(0.2, 1.0 - _LEAST_ROOM) * part
        begin = n * part + rng.uniform(0.0, part - lasts)
        shape = SHAPES[rng.integers(len(SHAPES))]
        rate = np.exp(rng.uniform(*np.log(_RATES)))
        x, y, z = map(float, force)
        swings = float(rate) if shape == "swing" else 0.0
        several.append(Push(link, (x, y, z), float(begin), float(begin + lasts), shape, swings))
    return tuple(several)


def _acting(pushes: Sequence[Push], time: float) -> Push | None:
    return next((each for each in pushes if each.begin <= time < each.end), None)


def _push(row: dict[str, Any], where: str) -> Push:
    try:
        link, begin, end, *force = (float(row[name]) for name in _NUMBERS)
        rate = float(row.get("rate") or 0.0)
    except (TypeError, ValueError):
        raise SerpentError(
            f"{where}: one of {', '.join(_NUMBERS)} is no number. {_ADVICE}"
        ) from None
    shape = str(row["shape"]).strip()
    if link not in range(1, N_JOINTS + 1):
        raise SerpentError(f"{where}: there is no link {link:g}; links are 1 … {N_JOINTS}.")
    if not 0 <= begin < end < np.inf:
        raise SerpentError(
            f"{where}: it lasts from {begin:g} to {end:g} s. Give times of the session in their order."
        )
    if not np.linalg.norm(force) <= _MOST:
        raise SerpentError(f"{where}: the force must be at most {_MOST:g} N.")
    if shape not in SHAPES:
        raise SerpentError(f"{where}: there is no shape {shape!r}; there are: {listed(SHAPES)}.")
    if shape == "swing" and not 0 < rate < np.inf:
        raise SerpentError(f"{where}: a swing needs a rate [Hz] in the column rate.")
    x, y, z = force
    return Push(int(link), (x, y, z), begin, end, shape, rate if shape == "swing" else 0.0)
