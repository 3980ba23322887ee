"""What if servos hear of their goals late?"""

from dataclasses import dataclass
from math import ceil
from typing import ClassVar

import numpy as np

from serpent_twin.arm import Array
from serpent_twin.effects.effect import COMMAND, Effect, parameter, ranges
from serpent_twin.effects.moment import Told


@dataclass(frozen=True)
class CommandDelay(Effect):
    """Servos are told at time t the goals of t − delay, linear between time steps.

    Source: a pure dead time. A bus that is read motor by motor between two writes, queues of messages, and
    a log written before its commands are sent add up to 20 … 300 ms.
    """

    delay: float = parameter("s", high=0.5, typical=0.1)
    """[s]"""

    shows_in: ClassVar[str] = "all that servos move comes late by the same, at every speed and load"
    confused_with: ClassVar[tuple[str, ...]] = ("mocap_latency", "servo_sag")
    stage: ClassVar[int] = COMMAND
    of_arm: ClassVar[bool] = False

    def start(self, moment: Told) -> list[Array]:
        """Goals of the last time steps, the newest first, as if they had always been these."""
        steps = ceil(ranges(type(self))["delay"].high / float(np.min(moment.dt))) + 2
        return [moment.goal.copy() for _ in range(steps)]

    def act(self, moment: Told, memory: list[Array]) -> None:
        """Tell the servos an old goal."""
        memory.insert(0, moment.goal)
        memory.pop()
        ago = np.broadcast_to(self.delay / moment.dt, (len(moment.goal), 1))
        whole = np.floor(ago).astype(int)
        past = np.stack(memory)
        row = np.arange(len(past[0]))
        newer, older = past[whole[:, 0], row], past[whole[:, 0] + 1, row]
        moment.goal = newer + (ago - whole) * (older - newer)
        moment.stand(moment.goal)
