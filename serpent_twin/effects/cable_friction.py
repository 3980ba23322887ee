"""Let cables rub on the pulleys that they pass."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import LOSS, Several, parameter, ranges
from serpent_twin.effects.links import HELD, let_rub
from serpent_twin.effects.presliding import give_way
from serpent_twin.effects.strands import OnStrands, on_strands

_STICKS = 1e-9
"""Velocity that is as good as at rest [rad/s]"""


@dataclass(frozen=True)
class CableFriction(OnStrands):
    """Cables resist a hinge that they wrap: it gets Coulomb friction s Σ r_j T_j over its cables.

    T_j is the sum of the tensions of cable j's strands that rub, r_j its pulleys' radius. The share s is c
    where the wrap that matters is the same at every angle: pulley bearings that carry the cables' pull, or
    strands that wrap a pulley all the time. It is exp(c |q|) − 1, after Euler and Eytelwein, where a
    strand bends on the groove by the hinge's angle q alone. A hinge that so much friction holds gives way
    elastically before it slides. At a place of a model, a tendon of tension T gets
    the friction c |T| along its whole length, and sticks at rest.
    Source: Amontons' and Coulomb's laws; capstan equation. c is 0.05 … 0.3 for polyethylene on nylon.
    """

    coefficient: float = parameter("1", high=2.0, typical=0.1)
    """c [1]"""
    transition_velocity: float = parameter("rad/s", high=0.5, typical=0.03)
    """Speed of a hinge below which this friction is in proportion to the speed; at zero it sticks"""
    by_bend: float = parameter("1", high=1.0, typical=0.0, fitted=False)
    """0: the same at every angle; 1: by the hinge's angle"""
    presliding: float = parameter("rad/(N m)", high=0.5, typical=0.005, before=0.0)
    """Compliance of a hinge that this friction and its own hold [rad/(N m)]; at zero it holds rigidly"""
    strand: float = on_strands()
    """Number of the strand or cable that rubs, as `on_strands` counts them; −1 for all"""

    shows_in = "lag behind the motors that grows with the cables' tension, and loads"
    places = ("tendon",)
    confused_with = ("gear_backlash", "gear_friction")
    model_error = 0.05
    remembers = False
    stage = LOSS

    @classmethod
    def variants(cls) -> Several:
        """Typical instances: friction by the tension alone, and by the bend."""
        known = ranges(cls)
        creeps, gives = (known[n].typical for n in ("transition_velocity", "presliding"))
        return (
            cls(0.1, creeps, presliding=gives),
            cls(0.4, creeps, by_bend=1.0, presliding=gives),
        )

    @cached_property
    def _bends(self) -> NDArray[np.bool_]:
        return np.equal(self.by_bend, 1.0)

    @cached_property
    def _gives_way(self) -> bool:
        return bool(np.any(self.presliding))

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Let a tendon of a model stick."""
        if self.at:
            spec.tendon(self.at).solref_friction[0] = HELD
            let_rub(spec)

    def start(self, moment: Any) -> Array | None:
        """Hinges that nothing has moved yet: no torque [N m], (n, 9)."""
        return None if self.at else np.zeros_like(moment.joint_friction)

    def act(self, moment: Any, memory: Array | None) -> None:
        """Raise the hinges' friction by what their cables' tensions make, or that of a tendon by its own."""
        if self.at:
            moment.tendon_friction = moment.tendon_friction + self.coefficient * abs(moment.tension)
            return
        pressed = moment.pressed(self.chosen(moment.strands) * moment.tension)
        share = self.coefficient
        if self._bends.any():
            bent = np.expm1(self.coefficient * np.abs(moment.joint_angle))
            share = np.where(self._bends, bent, share)
        rub(moment, share * pressed, self.transition_velocity)
        if self._gives_way:
            assert memory is not None
            give_way(moment, memory, self.presliding)


def rub(moment: Any, torque: Array, transition_velocity: Array | float) -> None:
    """Add friction to hinges [N m], regularised below a velocity of its own [rad/s]: near rest, the slopes of
    both frictions add.
    """
    friction, creeps = moment.joint_friction, moment.transition_velocity
    slope = friction / np.maximum(creeps, _STICKS)
    slope += torque / np.maximum(transition_velocity, _STICKS)
    moment.joint_friction = rubs = friction + torque
    near = rubs / np.maximum(slope, _STICKS)
    moment.transition_velocity = np.where(np.greater(torque, 0), near, creeps)
