"""Find joints that stand still where the twin's turn.

Dry friction that holds a joint balances whatever pulls, so no first order shows it: it is sought by what it
does. In a window of the joint's angle, the measured joint's moves are then small beside what the twin's moves
differ from them.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import JOINT_FRICTION, Law
from serpent_twin.identification.discovery.screen import Composed
from serpent_twin.identification.fitted import Fit
from serpent_twin.machines.case import Case
from serpent_twin.machines.places import Places, response_at

STANDS = 30.0
"""Twice the logarithm of the likelihood ratio that a joint stands still, from which its friction is tried: of
joints that do not stick, it is at most 18
"""
_MOVES_OVER = 1.0
"""Time over which a joint's moves are compared [s]"""
_LEVELS, _LEAST = 15, 30
"""Angles between which windows are, and moves in one at least"""
_HOLDS = 0.95
"""Share of the rows in a window whose torque the friction holds"""


def stuck(case: Case[Any], pieces: Any, fit: Fit, places: Places) -> list[Composed]:
    """The dry friction that would hold each joint that stands still in a window of its angle, the clearest
    first; its worth is how clearly.
    """
    found = []
    angles = places.twin_angles
    for name in angles:
        reading, law = (
            ("joint_angle", name),
            Law(JOINT_FRICTION, name, "within", "joint_angle", name),
        )
        if reading not in places.readings:
            continue
        measured = places.readings[reading]
        over = _rows(places, measured.shape[1])
        worth, low, high = max(_windows(measured, angles[name], over), default=(0.0, 0.0, 0.0))
        if worth > STANDS:
            inside = (measured > low) & (measured < high)
            torque = _torque(case, pieces, fit, places, name)[inside]
            size = np.array([np.quantile(torque, _HOLDS)])
            found.append(Composed(law, size, low, high - low, worth, 0.0))
    return sorted(found, key=lambda each: -each.worth)


def _rows(places: Places, most: int) -> int:
    """Rows over which moves are compared."""
    time = places.readings.get(("time", "session"))
    step = float(np.median(np.diff(time, axis=1))) if time is not None else _MOVES_OVER
    return int(np.clip(round(_MOVES_OVER / step), 1, most - 1))


def _windows(measured: Array, twin: Array, over: int) -> Iterator[tuple[float, float, float]]:
    """How clearly a joint stands still in each of some windows of its angle, and where these begin and end
    [rad]; angles are (S, T).

    Twice the logarithm of the likelihood ratio of two hypotheses on the n measured moves in a window: the joint
    stands still, or moves as the twin does. Moves that overlap count as one.
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
