"""Define faults that no file of `serpent_twin.effects` describes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.effects import Effect, Moment, parameter
from serpent_twin.effects.arm_places import levers

NUMBER = np.arange(1, N_JOINTS + 1)
"""Of joints and links"""


@dataclass(frozen=True)
class OutsideForce(Effect):
    """A constant force across the arm pulls on a link while a joint is beyond an angle."""

    force: float = parameter("N", high=5.0, typical=0.4)
    """[N]"""
    direction: float = parameter("rad", low=-4.0, high=4.0, typical=0.0, fitted=False)
    """From the base's y towards its z [rad]"""
    link: float = parameter("1", low=1.0, high=9.0, typical=8.0, default=8.0, fitted=False)
    """Which link is pulled at its centre of mass"""
    joint: float = parameter("1", low=1.0, high=9.0, typical=4.0, default=4.0, fitted=False)
    """Which joint's angle decides"""
    beyond: float = parameter("rad", low=-1.0, high=1.0, typical=0.1, default=0.1, fitted=False)
    """Above which angle it pulls [rad]"""

    def act(self, moment: Moment, memory: None) -> None:
        """Add J(q)ᵀ F to the hinges."""
        pulls = ((NUMBER == self.joint) & (moment.joint_angle > self.beyond)).any(
            axis=1, keepdims=True
        )
        if pulls.any():
            across = np.stack(
                np.broadcast_arrays(0.0, np.cos(self.direction), np.sin(self.direction)), -1
            )
            here = (NUMBER == self.link)[..., None, None]
            lever = (here * levers(moment.joint_angle)).sum(axis=-3)
            push = self.force * (lever * across).sum(axis=-1)
            moment.joint_torque = moment.joint_torque + pulls * push


@dataclass(frozen=True)
class StickingJoint(Effect):
    """One hinge's dry friction is raised inside a window of its angle, as by a burr or dirt."""

    times: float = parameter("1", high=50.0, typical=6.0)
    """By how many times its friction [1]"""
    joint: float = parameter("1", low=1.0, high=9.0, typical=4.0, default=4.0, fitted=False)
    """Which hinge"""
    begin: float = parameter("rad", low=-1.0, high=1.0, typical=0.1, default=0.1, fitted=False)
    """[rad]"""
    width: float = parameter("rad", high=1.0, typical=0.15, default=0.15, fitted=False)
    """[rad]"""

    def act(self, moment: Moment, memory: None) -> None:
        """Raise the friction."""
        q = moment.joint_angle
        inside = (NUMBER == self.joint) & (q > self.begin) & (q < self.begin + self.width)
        moment.joint_friction = moment.joint_friction * (1.0 + self.times * inside)


@dataclass(frozen=True)
class PeriodicPush(Effect):
    """A hinge is pushed to and fro by the clock, as by a fan or a machine beside the arm."""

    torque: float = parameter("N m", high=1.0, typical=0.03)
    """[N m]"""
    period: float = parameter("s", low=0.5, high=100.0, typical=7.0, default=7.0, fitted=False)
    """[s]"""
    joint: float = parameter("1", low=1.0, high=9.0, typical=3.0, default=3.0, fitted=False)
    """Which hinge"""

    def act(self, moment: Moment, memory: None) -> None:
        """Push."""
        here = NUMBER == self.joint
        push = self.torque * np.sin(2 * np.pi * moment.time / self.period)
        moment.joint_torque = moment.joint_torque + here * push


@dataclass(frozen=True)
class LoadRipple(Effect):
    """A gearbox turns harder and easier by its angle, as with a bent shaft or a damaged tooth."""

    torque: float = parameter("N m", high=0.5, typical=0.045)
    """[N m]"""
    waves: float = parameter("1", low=1.0, high=20.0, typical=2.0, default=2.0, fitted=False)
    """In a turn of the horn"""
    motor: float = parameter("1", low=1.0, high=10.0, typical=3.0, default=3.0, fitted=False)
    """Which motor"""
    phase: float = parameter("rad", low=-4.0, high=4.0, typical=0.0, fitted=False)
    """[rad]"""

    def act(self, moment: Moment, memory: None) -> None:
        """Push the horn."""
        here = np.arange(1, N_MOTORS + 1) == self.motor
        wave = np.sin(self.waves * moment.motor_angle + self.phase)
        moment.motor_torque = moment.motor_torque + here * self.torque * wave


OUTSIDE: dict[str, type[Effect]] = {
    "outside_force": OutsideForce,
    "sticking_joint": StickingJoint,
    "periodic_push": PeriodicPush,
    "load_ripple": LoadRipple,
}


def place(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Where an effect outside the catalogue sits: all but its strength."""
    places: dict[str, dict[str, Any]] = {
        "outside_force": {
            "direction": rng.uniform(-np.pi, np.pi),
            "link": rng.integers(6, 10),
            "joint": rng.integers(1, 10),
            "beyond": rng.uniform(0.05, 0.15),
        },
        "sticking_joint": {"joint": rng.integers(1, 10), "begin": rng.uniform(0.02, 0.15)},
        "periodic_push": {"joint": rng.integers(1, 7), "period": rng.uniform(3.0, 20.0)},
        "load_ripple": {
            "motor": rng.integers(3, 10),
            "waves": rng.integers(1, 7),
            "phase": rng.uniform(-np.pi, np.pi),
        },
    }
    return {key: float(value) for key, value in places[name].items()}
