"""State effects that are data: what they add to a field of MJCF, or to a quantity of the moment by a law."""

from dataclasses import dataclass

from serpent_twin.effects.effect import LOSS, Effect, parameter


@dataclass(frozen=True)
class HingeFriction(Effect):
    """Coulomb friction F sign(q̇) and viscous friction b q̇ of every hinge.

    Source: Coulomb's and Newton's laws of friction. MJCF expresses all of it, as frictionloss and
    damping; at a joint of any model, it holds within two time steps. Small servos lose 2 … 10 % of their
    stall torque to it.
    """

    coulomb: float = parameter("N m", high=0.5, typical=0.03, adds_to="joint.frictionloss")
    """F [N m]"""
    viscous: float = parameter("N m s/rad", high=0.2, typical=0.005, adds_to="joint.damping.0")
    """b [N m s/rad]"""

    places = ("joint",)
    shows_in = "swings that die away, and lag by the same at every load"
    confused_with = ("gear_friction", "gear_backlash")


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
    model_error = 0.05
    stage = LOSS
    law = "gear_friction: magnitude horn_torque"


@dataclass(frozen=True)
class FrictionWarming(Effect):
    """Coulomb friction is greater by F exp(−t / τ) at a time t in the session: grease thins as it warms.

    Gears cool down between sessions. In prescribed motion it shows in the loads alone.
    Source: Newton's law of heating, with friction linear in the temperature; Bittencourt and Gunnarsson, J.
    Dyn. Sys. Meas. Control 134 (2012) 051013, on the friction of a robot's joint. At a joint of a model, it
    holds within two time steps.
    """

    extra: float = parameter("N m", high=0.3, typical=0.02)
    """F [N m]"""
    time: float = parameter("s", low=5.0, high=600.0, typical=40.0, default=40.0)
    """τ [s]"""

    shows_in = "loads that jump at each reversal by less and less, anew in each session"
    places = ("joint",)
    confused_with = ("gear_friction",)
    model_error = 0.05
    stage = LOSS
    law = "gear_friction: fading time"


@dataclass(frozen=True)
class Stribeck(Effect):
    """Coulomb friction is greater by F exp(−|q̇| / v) near rest: a film of grease wears thin.

    Source: Stribeck, Die wesentlichen Eigenschaften der Gleit- und Rollenlager, 1902; Bo and Pavelescu's
    exponential. At a joint of a model, it holds within two time steps.
    """

    extra: float = parameter("N m", high=0.3, typical=0.02)
    """F [N m]"""
    velocity: float = parameter("rad/s", low=0.01, high=2.0, typical=0.2, default=0.2)
    """v [rad/s]"""

    shows_in = "jerks out of rest, and rest where a slow motion should go on"
    places = ("joint",)
    confused_with = ("gear_friction", "hinge_friction")
    stage = LOSS
    law = "joint_friction: near_rest joint_velocity"


@dataclass(frozen=True)
class TendonFriction(Effect):
    """Dry friction F along a tendon, whatever its tension: a seal, a liner, a sheath that grips.

    What grows with the tension, as at a capstan, is `cable_friction`.
    Source: Coulomb's law of friction. MJCF expresses all of it, as the tendon's frictionloss.
    """

    force: float = parameter("N", high=100.0, typical=0.5, adds_to="tendon.frictionloss")
    """F [N]"""

    places = ("tendon",)
    shows_in = "joints that start late after each reversal of a tendon, at every load"
    confused_with = ("cable_friction", "gear_backlash", "hinge_friction")


@dataclass(frozen=True)
class JointElasticity(Effect):
    """A linear spring beside each hinge, −k q: wires along the arm, a sleeve, cables' bending.

    Source: Hooke's law. MJCF expresses all of it, as the hinge's stiffness. A bundle of wires makes
    0.01 … 0.3 N m/rad; gravity on the whole arm makes 0.8 N m/rad at joint 1.
    """

    stiffness: float = parameter("N m/rad", high=3.0, typical=0.05, adds_to="joint.stiffness.0")
    """k [N m/rad]"""

    places = ("joint",)
    shows_in = "joints that fall short in proportion to their angle, and their loads"
    confused_with = ("cable_stiffening", "payload")


@dataclass(frozen=True)
class JointStiffening(Effect):
    """A moment −k₃ q³ beside each hinge.

    Sleeves, hoses and flexures go tight near the ends of a range.
    Source: the cubic spring of Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, 1918. MJCF
    expresses all of it, as the hinge's stiffness.
    """

    cubic: float = parameter("N m/rad³", high=10.0, typical=0.1, adds_to="joint.stiffness.2")
    """k₃ [N m/rad³]"""

    places = ("joint",)
    shows_in = "joints that fall short far from the middle, and not near it"
    confused_with = ("joint_elasticity",)


@dataclass(frozen=True)
class RotorInertia(Effect):
    """Inertia n² J of a motor's rotor behind a gear of ratio n, which each acceleration of a joint moves.

    Models made from drawings often leave it out. At a ratio of 100, a rotor of 10 g cm² is as much as 1 kg
    at 0.1 m.
    Source: kinetic energy of the rotor. MJCF expresses all of it but its gyroscopic part, as the joint's
    armature.
    """

    inertia: float = parameter("kg m²", high=10.0, typical=0.01, adds_to="joint.armature")
    """n² J [kg m²]"""

    places = ("joint",)
    shows_in = "torques that grow with a joint's acceleration, alike in every pose"
    confused_with = ("payload",)


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
    law = "reading_age: constant time"

    @property
    def sites_later(self) -> float:
        """The angles that drive a twin are older."""
        return self.delay
