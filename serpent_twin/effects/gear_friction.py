"""Let a gearbox's friction grow with the torque that it carries."""

from dataclasses import dataclass

from serpent_twin.effects.effect import LOSS, Effect, parameter


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

    places = ("joint",)
    shows_in = "loads that jump at each reversal by more, the more a motor carries"
    confused_with = ("cable_friction", "friction_warming")
    simplified = 0.05
    stage = LOSS
    law = "gear_friction: magnitude horn_torque"
