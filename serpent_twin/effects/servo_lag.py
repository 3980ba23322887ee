"""Let an actuator follow what it is told with a lag of first order."""

from dataclasses import dataclass

import mujoco

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class ServoLag(Effect):
    """What an actuator is told reaches it through a low-pass filter of first order, τ ẏ = u − y.

    The current loop of a motor, the valve and the chamber of a pneumatic muscle, a profile that a servo makes
    of its goals.
    Source: MuJoCo's documentation, activation dynamics `filterexact`. MJCF expresses all of it. Electric
    servos have 5 … 50 ms, pneumatic muscles 0.1 … 1 s.
    """

    time_constant: float = parameter("s", high=2.0, typical=0.03)
    """τ [s]"""

    places = ("actuator",)
    shows_in = "quick motions that come late and small, slow ones that do not"
    confused_with = ("command_delay",)

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Filter what the actuators without dynamics of their own are told, if it does anything."""
        for each in spec.actuators:
            bare = each.dyntype == mujoco.mjtDyn.mjDYN_NONE and each.gainprm[0] != 0
            if bare and each.name == (self.at or each.name):
                each.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
                each.dynprm[0] = self.time_constant
