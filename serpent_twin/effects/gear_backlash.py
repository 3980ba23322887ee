"""Give a servo's gears backlash."""

from dataclasses import dataclass
from typing import Any

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import WINDING, Effect, parameter
from serpent_twin.effects.play import dragged, dragged_from_afar


@dataclass(frozen=True)
class GearBacklash(Effect):
    """The winch keeps still while the motor's measured angle turns inside a gap, and is dragged along
    otherwise.

    The play operator: w follows m so that |m − w| ≤ gap / 2, and moves no more than it must. It holds
    its output inside the gap, which a dead band does not. Something else than the gear holds the
    winch there, such as friction; the cable's torque reaches the motor all the same.
    Source: Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989. Hobby-class servos have 0.2 …
    2° of play.
    """

    gap: float = parameter("rad", high=0.3, typical=0.02)
    """Gap from one flank to the other [rad]"""

    places = ("actuator", "joint")
    shows_in = "joints that start late after each reversal of a motor, at every load"
    confused_with = ("cable_friction", "mocap_latency", "motor_latency")
    remembers = False
    stage = WINDING

    def start(self, moment: Any) -> Array:
        """Winches dragged along by motors that move, in the middle of the gap by others [rad], (n, 10)."""
        return dragged_from_afar(moment.winch_angle, moment.motor_velocity, self.gap)

    def act(self, moment: Any, memory: Array) -> None:
        """Drag the winches along."""
        memory[...] = dragged(memory, moment.winch_angle, self.gap)
        moment.winch_angle = memory.copy()
