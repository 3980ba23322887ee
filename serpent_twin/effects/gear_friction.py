"""Let a gearbox's friction grow with the torque that it carries."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.effects.effect import LOSS, Effect, parameter
from serpent_twin.effects.links import let_hold
from serpent_twin.effects.moment import Geared


@dataclass(frozen=True)
class GearFriction(Effect):
    """A gearbox's Coulomb friction grows by c |τ|, τ the torque at its horn.

    Tooth and bearing friction grow with the force that they carry. In prescribed motion it shows in
    the loads alone; else the servo lags more, too.
    Source: the load-dependent friction models of Duclusaud et al., Extended Friction Models for the
    Physics Simulation of Servo Actuators, arXiv:2410.08650 (Rhoban BAM). Five stages of plastic and
    metal spur gears lose 10 … 40 %. At a joint of a model, it holds within two time steps.
    """

    coefficient: float = parameter("1", high=1.0, typical=0.2)
    """c [1]"""

    places: ClassVar[tuple[str, ...]] = ("joint",)
    shows_in: ClassVar[str] = "loads that jump at each reversal by more, the more a motor carries"
    confused_with: ClassVar[tuple[str, ...]] = ("cable_friction", "friction_warming")
    simplified: ClassVar[float] = 0.05
    stage: ClassVar[int] = LOSS

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Let a joint of a model stick."""
        if self.at:
            let_hold(spec, self.at)

    def act(self, moment: Geared, memory: None) -> None:
        """Raise the gearboxes' friction by what their horns carry."""
        moment.gear_friction = moment.gear_friction + self.coefficient * abs(moment.horn_torque)
