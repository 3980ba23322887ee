"""Find joints that stand still where the twin's turn.

Dry friction that holds a joint balances whatever pulls, so no first order shows it: it is sought by what it
does. In a window of the joint's angle, the measured joint's moves are then small beside what the twin's moves
differ from them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import JOINT_FRICTION, Law
from serpent_twin.identification.discovery.composed import Composed
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.machines.case import Case
from serpent_twin.machines.places import Places, response_at

STANDS = 30.0
"""Twice the logarithm of the likelihood ratio that a joint stands still, from which its friction is tried: of
21 arms without a joint that sticks, it is at most 25
"""
_MOVES_OVER = 1.0
"""Time over which a joint's moves are compared [s]"""
_LEVELS, _LEAST = 15, 30
"""Angles between which windows are, and moves in one at least"""
_HOLDS = 0.95
"""Share of the rows in a window whose torque the friction holds"""


@dataclass(frozen=True)
class StuckJoint:
    """A joint that stands still in a window of its angle."""

    joint: str
    low: float
    """[rad]"""
    high: float
    """[rad]"""
    worth: float
    """Twice the logarithm of the likelihood ratio that it stands still there [1]"""

    @property
    def told(self) -> str:
        """Describe the joint that stands still in a sentence."""
        return (
            f"{self.joint} often stands still between {self.low:.2f} and {self.high:.2f} rad, where the "
            "twin's turns: something holds it there.".replace("-", "−")
        )


def stuck(case: Case[Any], training: Any, fit: Fit) -> list[StuckJoint]:
    """The joints that stand still where those of a fitted twin turn, the clearest first; none of a machine
    that says nothing of its places.
    """
    places = case.places(fit.point, case.take(training, fit.used))
    return _standing(places) if places else []


def held_by_friction(case: Case[Any], pieces: Any, fit: Fit, places: Places) -> Iterator[Composed]:
    """The dry friction that would hold each joint that stands still; its worth is how clearly."""
    for each in _standing(places):
        measured = places.readings["joint_angle", each.joint]
        inside = (measured > each.low) & (measured < each.high)
        torque = _torque(case, pieces, fit, places, each.joint)[inside]
        law = Law(JOINT_FRICTION, each.joint, "within", "joint_angle", each.joint)
        size = np.array([np.quantile(torque, _HOLDS)])
        yield Composed(law, size, each.low, each.high - each.low, each.worth, 0.0)


def _standing(places: Places) -> list[StuckJoint]:
    found = []
    for joint, twin in places.twin_angles.items():
        measured = places.readings["joint_angle", joint]
        over = _rows(places, measured.shape[1])
        worth, low, high = max(_windows(measured, twin, over), default=(0.0, 0.0, 0.0))
        if worth > STANDS:
            found.append(StuckJoint(joint, low, high, worth))
    return sorted(found, key=lambda each: -each.worth)


def _rows(places: Places, most: int) -> int:
    """Rows over which moves are compared."""
    time = places.readings.get(("time", "session"))
    step = float(np.median(np.diff(time, axis=1))) if time is not None else _MOVES_OVER
    return int(np.clip(round(_MOVES_OVER / step), 1, most - 1))


def _windows(measured: Array, twin: Array, over: int) -> Iterator[tuple[float, float, float]]:
    """How clearly a joint stands still in each of some windows of its angle, and where these begin and end
    [rad]; angles are (S, T).

    How clearly is twice the logarithm of the likelihood ratio of the n measured moves in a window, where the
    joint stands still or moves as the twin does. Moves that overlap count as one.
    """
    moved, twin_moved = (each[:, over:] - each[:, :-over] for each in (measured, twin))
    levels = np.quantile(measured, np.linspace(0.02, 0.98, _LEVELS))
    for low, high in combinations(map(float, levels), 2):
        inside = (measured > low) & (measured < high)
        both = inside[:, over:] & inside[:, :-over]
        if (n := int(both.sum())) >= _LEAST:
            as_twin, still = ((each[both] ** 2).sum() for each in (moved - twin_moved, moved))
            yield n / over * float(np.log(as_twin / max(still, 1e-30))), low, high


def _torque(case: Case[Any], pieces: Any, fit: Fit, places: Places, joint: str) -> Array:
    """Size of the torque at a joint that explains most of each row's residual [N m], (S, T)."""
    measured = pieces.measured
    scale = np.where(np.isfinite(measured), 1 / case.noise, 0.0)
    shows = response_at(places, Law("joint_torque", joint)).change[0] * scale
    left = fit.residual.reshape(measured.shape)
    return np.abs((shows * left).sum(axis=-1)) / np.maximum((shows**2).sum(axis=-1), 1e-30)
