"""Compute the motion of a servo under velocity control, and the torque of its drive."""

from collections.abc import Sequence

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array

from . import accidents
from .effects import Effects
from .parameters import BenchArm

STALL, NO_LOAD = ARM.servo.stall_torque, ARM.servo.no_load_speed


class ServoBatch:
    """Ten servos in each of R rows: a lagged PI velocity loop, a torque limit, dry gear friction.

    Friction is Coulomb's law taken at the end of the step, so a servo below its breakaway torque
    stands exactly still, and its drive then gives whatever its integrator holds.
    """

    def __init__(self, arms: Sequence[BenchArm], effects: Sequence[Effects]) -> None:
        self.lag, self.p, self.i, self.armature = (
            np.array([[getattr(arm, name)] for arm in arms])
            for name in ("velocity_lag", "velocity_p", "velocity_i", "armature")
        )
        self.friction = np.array([arm.gear_friction for arm in arms])
        extra = np.array([[e.friction_warming] for e in effects])
        self.warming = extra / self.friction.mean(axis=1, keepdims=True)
        self.warming_time = np.array([[e.warming_time] for e in effects])
        self.cold: Array | float = 1.0
        """Friction of the gears over that of warm ones [1], or (R, 1)."""
        every = np.array([[e.gear_backlash] for e in effects])
        self.half_gap = (every + accidents.gear_play([e.accidents for e in effects])) / 2
        shape = (len(arms), N_MOTORS)
        self.angle, self.speed = np.zeros(shape), np.zeros(shape)
        """Measured side of the play [rad], [rad/s]."""
        self.winch, self.winch_speed = np.zeros((len(arms), 9)), np.zeros((len(arms), 9))
        """Far side of the play, joints' motors alone [rad], [rad/s]."""
        self.drive = np.zeros(shape)
        """What the drive gives [N m]."""
        self.grip = np.zeros(shape)
        """Gear friction's torque as a share of its greatest, −1 … 1, positive against + motion."""
        self.command, self.integral = np.zeros(shape), np.zeros(shape)
        self.slip: Array | float = 0.0
        """Angles by which winches have turned on their horns [rad], or (R, 9)."""
        self.rubbing: Array | float = 0.0
        """Dry friction beside the gears' own [N m], or (R, 10)."""

    def warm(self, elapsed: float) -> None:
        """Set how cold the gears are at a time in the session [s]."""
        if self.warming.any():
            self.cold = 1.0 + self.warming * np.exp(-elapsed / self.warming_time)

    def step(self, command: Array, torque: Array, h: float) -> None:
        """Turn for h [s] at a velocity command [rad/s] against cable torques [N m], (R, 10)."""
        self.command += (command - self.command) * -np.expm1(-h / self.lag)
        asked = self.p * self.command + self.i * self.integral
        momentum = self.armature * self.speed - h * torque
        friction = self.cold * self.friction + self.rubbing
        speed = _shrink(momentum + h * asked, h * friction) / (self.armature + h * self.p)
        free = asked - self.p * speed
        self.drive = np.clip(free, -STALL * (1 + speed / NO_LOAD), STALL * (1 - speed / NO_LOAD))
        held = self.drive == free
        if not held.all():
            bounded = _shrink(momentum + h * self.drive, h * friction) / self.armature
            speed = np.where(held, speed, bounded)
        self.integral += np.where(held, h * (self.command - speed), 0.0)
        push = momentum + h * self.drive - self.armature * speed
        self.grip = push / (h * friction)
        self.angle += h * (self.speed + speed) / 2
        self.speed = speed
        self._turn_winches(h)

    def _turn_winches(self, h: float) -> None:
        """Play operator: a winch moves only where its motor pushes it."""
        angle = self.angle[:, :N_JOINTS] + self.slip
        winch = np.clip(self.winch, angle - self.half_gap, angle + self.half_gap)
        self.winch_speed = (winch - self.winch) / h
        self.winch = winch


def _shrink(x: Array, by: Array) -> Array:
    """Bring x towards zero by an amount, or to zero."""
    return x - np.clip(x, -by, by)
