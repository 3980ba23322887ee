"""Delay the cameras' markers against the motors' angles."""

from dataclasses import dataclass
from math import ceil

import mujoco

from serpent_twin.effects.effect import Effect, parameter, ranges


@dataclass(frozen=True)
class MocapLatency(Effect):
    """Markers read at time t are those of t − delay, linear between time steps.

    MJCF expresses all of it, as a delay of the marker sensors; their history covers the longest delay at
    the spec's time step and at any longer one.
    Source: a pure dead time. Exposure, image processing, the network and waiting for the next frame
    add up to 10 … 60 ms with cameras of 120 Hz.
    """

    delay: float = parameter("s", high=0.2, typical=0.03)
    """[s]"""

    shows_in = "error in proportion to the markers' speed, in no load"
    confused_with = ("gear_backlash", "motor_latency")

    @property
    def sites_later(self) -> float:
        """The markers are older."""
        return -self.delay

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Delay the sensors of where sites are."""
        longest = ranges(type(self))["delay"].high
        for sensor in spec.sensors:
            if sensor.objtype != mujoco.mjtObj.mjOBJ_SITE:
                continue
            sensor.nsample = ceil(longest / spec.option.timestep) + 2
            sensor.interp, sensor.delay = 1, self.delay  # 1 is MJCF's interp="linear"
