"""Delay what the motors report against the markers."""

from dataclasses import dataclass

from serpent_twin.effects.effect import Effect, parameter
from serpent_twin.effects.moment import Moment


@dataclass(frozen=True)
class MotorLatency(Effect):
    """Angles, velocities and loads that the motors report at time t are those of t − delay.

    Where logged angles drive a twin, the markers of a row are therefore those of `delay` after its angles.
    Source: a pure dead time. Ten motors read one after the other, a slow serial bus and a clock read
    after the answer add up to 5 … 50 ms.
    """

    delay: float = parameter("s", high=0.2, typical=0.03)
    """[s]"""

    shows_in = "markers that lead by their speed times the delay, in no load"
    confused_with = ("gear_backlash", "mocap_latency")

    def act(self, moment: Moment, memory: None) -> None:
        """Age the readings."""
        moment.reading_age = moment.reading_age + self.delay
