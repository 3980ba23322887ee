"""Choose the effects that the arm may have and its nominal twin lacks.

That is every known effect that acts on what the arm has, except those whose physics is elsewhere in its
twin: an effect's file suffices for the arm's trace to try it.
"""

from collections.abc import Mapping
from dataclasses import fields

from serpent_twin.effects import KNOWN, Effect
from serpent_twin.sim.arm_moment import Moment

LEFT_OUT: Mapping[str, str] = {
    "discovered": "a trace composes it, where named effects leave something",
    "force_limit": "what its motors can give is part of their bus",
    "free_play": "between its motors and hinges are cables, whose slack is their own",
    "gravity": "its size is known, and base_tilt turns it",
    "hinge_friction": "the arm's calibration fits friction and damping of each hinge",
    "joint_stiffening": "a sleeve along the arm is joint_elasticity",
    "sensor_delay": "mocap_latency delays the cameras, motor_latency the motors",
    "servo_lag": "how its motors follow a speed is part of their bus",
    "stribeck": "the arm's gears turn with its motors, which cables part from the hinges",
    "tendon_friction": "its cables rub by their tension: cable_friction",
}
"""Effects that the arm's trace does not try, and why"""
_QUANTITIES = {each.name for each in fields(Moment)}
CATALOGUE: Mapping[str, type[Effect]] = {
    name: kind for name, kind in KNOWN.items() if kind.needs <= _QUANTITIES and name not in LEFT_OUT
}
"""The arm's candidates by name"""
