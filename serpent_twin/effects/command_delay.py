"""Delay the goals that servos receive."""

from dataclasses import dataclass
from math import ceil
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects.delayed import delay_by
from serpent_twin.effects.effect import COMMAND, Effect, parameter, ranges


@dataclass(frozen=True)
class CommandDelay(Effect):
    """Servos receive at time t the goals of t − delay, linear between time steps.

    Source: a pure dead time. A bus that is read motor by motor between two writes, queues of messages, and
    a log written before its commands are sent add up to 20 … 300 ms.
    """

    delay: float = parameter("s", high=0.5, typical=0.1)
    """[s]"""

    shows_in = "all that servos move comes late by the same, at every speed and load"
    confused_with = ("mocap_latency", "servo_lag")
    remembers = False
    stage = COMMAND
    needs = frozenset({"goal"})

    def export(self, spec: mujoco.MjSpec) -> bool:
        """Delay the actuators' commands."""
        for each in spec.actuators:
            if self.at in ("", each.name):
                delay_by(spec, each, self.delay)
        return True

    def start(self, moment: Any) -> "Past":
        """Goals of the last time steps, as if they had always been these."""
        steps = ceil(ranges(type(self))["delay"].high / float(np.min(moment.dt))) + 2
        return Past(np.tile(moment.goal, (steps, 1, 1)))

    def act(self, moment: Any, memory: "Past") -> None:
        """Give the servos a delayed goal."""
        memory.keep(moment.goal)
        ago = np.broadcast_to(self.delay / moment.dt, (len(moment.goal), 1))
        whole = np.floor(ago).astype(np.intp)
        newer, older = (memory.ago(whole[:, 0] + k) for k in (0, 1))
        moment.goal = newer + (ago - whole) * (older - newer)


@dataclass
class Past:
    """Goals of the last time steps, in a ring."""

    goals: Array
    """(steps, n, 6)"""
    newest: int = 0
    """Row of the present ones"""

    def keep(self, goal: Array) -> None:
        """Store the present goals, (n, 6), in place of the oldest."""
        self.newest = (self.newest + 1) % len(self.goals)
        self.goals[self.newest] = goal

    def ago(self, steps: NDArray[np.intp]) -> Array:
        """Goals so many time steps ago, (n,) of them, (n, 6)."""
        return self.goals[(self.newest - steps) % len(self.goals), np.arange(len(steps))]
