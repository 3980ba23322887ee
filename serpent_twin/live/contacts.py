"""Log the force that an estimator feels, and list what touched the arm."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.estimators.force_filter import FeltForce
from serpent_twin.live.follower import Follower
from serpent_twin.numerals import counted
from serpent_twin.recording.loop import Beside, Row, Step
from serpent_twin.sim.pushes import COLUMNS as KNOWN

FORCE = ("force_x", "force_y", "force_z")
SPREAD, LINK, CONTACT, TOUCHED = "force_spread", "force_link", "force_contact", "force_touched"
COLUMNS = (*FORCE, SPREAD, LINK, CONTACT, TOUCHED)
"""Further columns of a log: the force in the base frame [N], the root mean square of its error to expect [N],
the link that it acts on, the probability that anything touches the arm, and whether contact is reported, 0 or
1"""
_WEIGHT_S = 5.0
"""A force that has pulled down for so long is called a weight [s]"""
_APART_S = 2.0
"""Contacts nearer than this are one: a force that swings is not felt where it passes zero [s]"""
_LEAN = np.deg2rad(15.0)
"""How far its mean may be from straight down [rad]"""
_PARTS, _STEADY = 4, 0.5
"""Parts of the time of a weight, and by which share of its mean what pulls down in each may differ from it"""


@dataclass
class Touch:
    """What touched the arm from one reading on until another."""

    gravity: Array
    """Gravity in the base frame [m/s²], (3,): a weight pulls along it, and a base may lean"""
    time: list[float] = field(default_factory=list)
    felt: list[FeltForce] = field(default_factory=list)

    def found(self) -> dict[str, Any]:
        """Entry for results.json: when, where, how strongly, and whether it may be a weight."""
        links = np.mean([each.links for each in self.felt], axis=0)
        force = np.array([each.force for each in self.felt])
        covariance = np.mean([each.covariance for each in self.felt], axis=0)
        mean, weight = force.mean(axis=0), self._weight(force)
        return {
            "begin_s": self.time[0],
            "end_s": self.time[-1],
            "link": int(np.argmax(links)) + 1,
            "link_probability": links.tolist(),
            "mean_force_N": mean.tolist(),
            "most_N": float(np.linalg.norm(force, axis=1).max()),
            "spread_N": float(np.sqrt(np.trace(covariance))),
            "weight_kg": weight,
        }

    def _weight(self, force: Array) -> float | None:
        """The mass whose weight it would be [kg]: if it lasted, and pulled down by the same in each part of
        that time; else None.
        """
        if self.time[-1] - self.time[0] < _WEIGHT_S or len(force) < _PARTS:
            return None
        mean, size = force.mean(axis=0), float(np.linalg.norm(self.gravity))
        along = self.gravity / size
        down = float(mean @ along)
        parts = [each.mean(axis=0) @ along for each in np.array_split(force, _PARTS)]
        upright = down > np.cos(_LEAN) * float(np.linalg.norm(mean))
        steady = np.abs(np.array(parts) - down).max() < _STEADY * down
        return down / size if upright and steady else None


class Contacts:
    """The contacts of a run, and how far felt forces were from known ones."""

    def __init__(self, gravity: Array) -> None:
        """`gravity` of the arm in the base frame [m/s²], (3,)."""
        self._gravity = gravity
        self._contacts: list[Touch] = []
        self._off: list[Array] = []
        self._pushed: list[bool] = []

    def beside(self, follower: Follower) -> Beside:
        """What adds the force to a run's log, and watches it."""
        return Beside(COLUMNS, _columns(follower), see=lambda row: self._see(row, follower))

    def found(self) -> dict[str, Any]:
        """Contacts for results.json, and errors against known forces if the log has them."""
        out: dict[str, Any] = {"contacts": [each.found() for each in self._contacts]}
        off, pushed = np.array(self._off).reshape(-1, 3), np.array(self._pushed, bool)
        for name, rows in (("pushed", pushed), ("free", ~pushed)):
            known = bool(self._off) and rows.any()
            square = (off[rows] ** 2).sum(axis=1)
            out[f"force_error_{name}_N"] = float(np.sqrt(square.mean())) if known else None
        return out

    def told(self) -> str:
        """The contacts as lines of text."""
        found = self.found()
        lines = [f"Felt {counted(len(self._contacts), 'contact')}."]
        for each in found["contacts"]:
            weight = each["weight_kg"]
            what = f", as a weight of {1e3 * weight:.0f} g would" if weight else ""
            lines.append(
                f"{each['begin_s']:.1f} … {each['end_s']:.1f} s: link {each['link']}, up to "
                f"{each['most_N']:.2f} ± {each['spread_N']:.2f} N{what}."
            )
        if found["force_error_pushed_N"] is not None:
            lines.append(f"Off the known pushes by {found['force_error_pushed_N']:.2f} N rms.")
        return "\n".join(lines)

    def _see(self, row: Row, follower: Follower) -> None:
        felt = follower.force()
        if felt is None:
            return
        now = float(row["time"])
        if felt.touched:
            if not self._contacts or now - self._contacts[-1].time[-1] > _APART_S:
                self._contacts.append(Touch(self._gravity))
            self._contacts[-1].time.append(now)
            self._contacts[-1].felt.append(felt)
        if KNOWN[0] in row:
            self._off.append(felt.force - [row[name] for name in KNOWN[1:]])
            self._pushed.append(row[KNOWN[0]] > 0)


def _columns(follower: Follower) -> Callable[[Step], Mapping[str, float]]:
    def columns(_: Step) -> Mapping[str, float]:
        felt = follower.force()
        if felt is None:
            return dict.fromkeys(COLUMNS, np.nan)
        values = (*felt.force, felt.spread, felt.link, felt.contact, felt.touched)
        return dict(zip(COLUMNS, map(float, values), strict=True))

    return columns
