"""Let a motor's torque per ampere fall as the torque grows."""

from dataclasses import dataclass
from typing import Any

from serpent_twin.effects.effect import WINDING, Effect, parameter


@dataclass(frozen=True)
class TorqueSaturation(Effect):
    """A drive that should give τ gives τ / (1 + s |τ|): the armature's field weakens the magnet's.

    Source: Froehlich's law of saturation, 1881, for cored motors. Data sheets show it as a stall torque
    that grows less than the voltage: the XL330-M288's 0.42, 0.52, 0.60 N m at 3.7, 5.0, 6.0 V make
    s = 0.5/(N m) at its horn.
    """

    rate: float = parameter("1/(N m)", high=5.0, typical=0.5)
    """s [1/(N m)]"""

    places = ("actuator",)
    shows_in = "heavy loads that sag more than the motor's voltage predicts"
    confused_with = ("gear_friction",)
    stage = WINDING
    needs = frozenset({"drive_torque"})

    def act(self, moment: Any, memory: None) -> None:
        """Weaken the drive."""
        drive = moment.drive_torque
        moment.drive_torque = drive / (1 + self.rate * abs(drive))
