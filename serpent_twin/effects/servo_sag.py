"""Let a servo yield to its load."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import SERVO, Effect, parameter


@dataclass(frozen=True)
class ServoSag(Effect):
    """A servo under proportional control, damped by its back-EMF, settles at goal − compliance × torque.

    θ̇ = (goal − c τ − θ) / lag, where τ is the cables' torque on the horn. The nominal servo stands at
    its goal.
    Source: a DC motor behind a P gain: K (goal − θ) − b θ̇ = τ with c = 1 / K, lag = b / K.
    """

    compliance: float = parameter("rad/(N m)", high=2.0, typical=0.05)
    """c [rad/(N m)]"""
    lag: float = parameter("s", low=0.02, high=0.5, typical=0.05, default=0.05)
    """[s]"""

    shows_in = "servos that stop short of their goals in proportion to the load"
    confused_with = ("command_delay", "gear_backlash")
    remembers = False
    stage = SERVO
    needs = frozenset({"goal"})

    def start(self, moment: Any) -> Array:
        """Angles of the servos [rad]."""
        return moment.motor_angle.copy()

    def act(self, moment: Any, memory: Array) -> None:
        """Move the servos towards where they would settle."""
        moment.stand(np.where(np.equal(self.compliance, 0.0), moment.goal, memory))
        short = moment.goal - self.compliance * moment.cable_torque - memory
        memory += moment.dt / (self.lag + moment.dt) * short
