"""Let a drive give no more force than a limit below its model's."""

from dataclasses import dataclass

import mujoco

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class ForceLimit(Effect):
    """A drive whose force is cut off at ±1/r: a weak servo, a current limit, a low supply voltage.

    Source: the current limit of servos, e.g. Dynamixel's Current Limit(38) and PWM Limit(36). MJCF
    expresses all of it, as the actuator's forcerange.
    """

    reciprocal: float = parameter("1/(N m)", high=100.0, typical=1.0)
    """r, one divided by the limit [1/(N m)]; 0 is no limit but the model's"""

    places = ("actuator",)
    shows_in = "joints that lag or sag where much force is needed, and nowhere else"
    confused_with = ("torque_saturation", "servo_lag")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Narrow the range of the drives' forces."""
        limit = 1 / self.reciprocal
        for each in spec.actuators:
            if each.name == (self.at or each.name):
                low, high = each.forcerange if each.forcerange.any() else (-limit, limit)
                each.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
                each.forcerange = (max(low, -limit), min(high, limit))
