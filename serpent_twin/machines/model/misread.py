"""Let laws change what is seen of a model: of a site, of all that cameras see, of what a column reads."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array, cross
from serpent_twin.effects import Effect
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import HANDLES, READING_SHIFT
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.state_moment import BODY, FRAME, StateMoment, fixed
from serpent_twin.units import TO_SI

SITE, COLUMN = "site", "column"
"""Kinds of places"""
SEEN = tuple(name for name, each in HANDLES.items() if each.only_seen and name != READING_SHIFT)
"""What laws change of what is seen"""


def only_seen(effect: Effect) -> bool:
    """Whether an effect changes what is seen, and nothing else."""
    return isinstance(effect, Discovered) and effect.law.handle in SEEN


class Views:
    """What n runs show of a machine's sites and columns, and how that changes with these."""

    def __init__(self, machine: Described, batch: Batch, site_at: Callable[[str], Array]) -> None:
        """`site_at` says where a site is in the world [m], (n, 3)."""
        self._site_at = site_at
        model, measured = batch.model, machine.about.measured
        columns = [(each, name) for each in measured for name in each.columns]
        self._columns = {name: n for n, (_, name) in enumerate(columns)}
        self._units = [each.scale * TO_SI[each.unit][0] for each, _ in columns]
        self._sites = {each.site: each for each in measured if each.site}
        self._model = model
        fields = "xpos", "xmat", "site_xmat", "cvel", "subtree_com"
        self._of = {name: batch.bind(name) for name in fields}
        frames = [each.frame for each in measured]
        self.names: Mapping[str, Sequence[str]] = {
            SITE: [*self._sites],
            COLUMN: [*self._columns],
            FRAME: [name for name in dict.fromkeys([*fixed(model), *frames]) if name],
            BODY: [name for n in range(1, model.nbody) if (name := model.body(n).name)],
        }
        """Names of the places of each kind"""

    def change(self, handle: str, place: str, size: Array, shown: Array) -> Array:
        """Change of what is shown, (n, C), by sizes, (n, components), of a quantity at a place."""
        out = np.zeros_like(shown)
        if handle in ("load_shift", "load_scale"):
            n = self._columns[place]
            by = self._units[n] if handle == "load_shift" else shown[:, n]
            out[:, n] = size[:, 0] * by
            return out
        for name, each in self._sites.items():
            first = self._columns[each.columns[0]]
            at = slice(first, first + 3)
            moved = self._moved(handle, place, size, name, shown[:, at])
            if moved is not None:
                out[:, at] = moved
        return out

    def _moved(self, handle: str, place: str, size: Array, site: str, shown: Array) -> Array | None:
        """Apparent displacement of a site in the frame of its columns, (n, 3); None without any."""
        model, n = self._model, self._model.site(site).id
        body = int(model.site_bodyid[n])
        if handle == "camera_shift":
            return size
        if handle == "camera_turn":
            return cross(size, shown)
        at = self._site_at(site)
        if handle == "camera_delay":
            motion = self._of["cvel"][:, body]
            about = self._of["subtree_com"][:, model.body_rootid[body]]
            return -size * self._in_frame(site, motion[:, 3:] + cross(motion[:, :3], at - about))
        if handle == "marker_shift":
            return self._in_frame(site, self._turned(body, size)) if place == site else None
        turned = model.body(place).id
        if turned not in _carrying(model, body):
            return None
        return self._in_frame(
            site, cross(self._turned(turned, size), at - self._of["xpos"][:, turned])
        )

    def _turned(self, body: int, vector: Array) -> Array:
        """A vector in a body's frame in that of the world, (n, 3)."""
        return np.einsum("nij,nj->ni", self._of["xmat"][:, body].reshape(-1, 3, 3), vector)

    def _in_frame(self, site: str, vector: Array) -> Array:
        """A vector of the world in the frame in which a site is measured, (n, 3)."""
        if not (frame := self._sites[site].frame):
            return vector
        turn = self._of["site_xmat"][:, self._model.site(frame).id].reshape(-1, 3, 3)
        return np.einsum("nji,nj->ni", turn, vector)


def _carrying(model: mujoco.MjModel, body: int) -> list[int]:
    """A body, and those that carry it."""
    found = [body]
    while found[-1]:
        found.append(int(model.body_parentid[found[-1]]))
    return found


@dataclass(kw_only=True)
class SeenMoment(StateMoment):
    """A row of n runs as laws read it that change what is seen there."""

    given: ClassVar[frozenset[str]] = StateMoment.given | {"views", "shown"}
    changed: ClassVar[tuple[str, ...]] = SEEN
    kinds: ClassVar[Mapping[str, str]] = {
        **StateMoment.kinds,
        "marker_shift": SITE,
        "link_turn": BODY,
        **dict.fromkeys(("load_shift", "load_scale"), COLUMN),
        **dict.fromkeys(("camera_shift", "camera_turn", "camera_delay"), FRAME),
    }

    views: Views
    shown: Array
    """(n, C)"""
    shift: Array
    """Change of the values that are shown, (n, C)"""

    def add(self, handle: str, place: str, size: Array) -> None:
        """Add a size, (n, components), to a quantity of what is seen."""
        self.column(handle, place)
        self.shift = self.shift + self.views.change(handle, place, size, self.shown)
