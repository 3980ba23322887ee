"""Drive motors as their servos' operating modes, profiles and goals demand."""

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from serpent_twin.emulator import profile
from serpent_twin.emulator.control_table import ControlTable
from serpent_twin.emulator.motors import SimulatedMotors
from serpent_twin.emulator.profile import Profile
from serpent_twin.hardware import xl430
from serpent_twin.hardware.control_table import TABLE


class Mode(IntEnum):
    """Values of Operating Mode (11)."""

    VELOCITY = 1
    POSITION = 3
    EXTENDED_POSITION = 4
    PWM = 16


GOAL_OF = {
    Mode.VELOCITY: "goal_velocity",
    Mode.POSITION: "goal_position",
    Mode.EXTENDED_POSITION: "goal_position",
    Mode.PWM: "goal_pwm",
}
"""The register that a servo follows in each mode."""
TIME_BASED = 1 << 2
"""The bit of Drive Mode (10) that selects time-based profiles."""
_IN_POSITION, _ONGOING, _NOT_FOLLOWING = 1 << 0, 1 << 1, 1 << 3  # of Moving Status (123)
_POSITIONS = (Mode.POSITION, Mode.EXTENDED_POSITION)
_VELOCITY_COUNTS = xl430.VELOCITY_UNIT / xl430.POSITION_UNIT  # [counts/s] of a word of velocity
_ACCELERATION_COUNTS = 214.577 / 3600 * xl430.TURN  # [counts/s²] manual: 1 unit = 214.577 rev/min²
_MILLISECOND = 1e-3  # [s] manual: unit of a time-based profile
_POSITION_RATE = 8.0  # [1/s] A: speed per angle to go, at the default Position P Gain
_NEAR = 20  # [counts] A: the manual gives no figure for In-Position and Following Error
_FULL_SPEED = 40_000  # [0.229 rpm] far beyond what a drive at its limit of voltage can reach
_SLICE = 0.02  # [s] between two corrections of a position


class Drives:
    """What servos demand of their motors, indexed from 0.

    Position modes follow the profile's velocity, corrected by a P loop on its position. PWM mode applies the
    voltage of Goal PWM, which limits it in the other modes.
    """

    def __init__(self, motors: SimulatedMotors, tables: Sequence[ControlTable]) -> None:
        self._motors, self._tables = motors, tables
        self._profile: list[Profile | None] = [None] * len(tables)
        self._began = np.zeros(len(tables))

    def release(self, index: int) -> None:
        """Drop a servo's trajectory: it holds still where its goals say, without a profile."""
        self._profile[index] = None
        self._motors.goal[index] = 0

    def take_up(self, index: int) -> None:
        """Start the profile to a servo's goal, which was just written."""
        mode = self._mode(index)
        if mode == Mode.VELOCITY:
            made = self._to_velocity(index)
        elif mode in _POSITIONS:
            made = self._to_position(index)
        else:
            return
        self._profile[index], self._began[index] = made, self._motors.time
        if mode == Mode.VELOCITY and not made.duration:
            self._motors.goal[index] = self._tables[index]["goal_velocity"]

    def shift(self, index: int, counts: int) -> None:
        """Move a servo's goal and trajectory along, for its position is counted from elsewhere now."""
        self._tables[index]["goal_position"] += counts
        if (made := self._profile[index]) is not None:
            self._profile[index] = made.shifted(counts)

    def advance(self, duration: float) -> None:
        """Let time pass [s]: in one go, or in slices while a servo follows a trajectory."""
        step = self._motors.twin.model.opt.timestep
        left = self._motors.twin.substeps(duration)
        while left:
            sliced = any(self._is_steered(index) for index in range(len(self._tables)))
            steps = min(left, max(1, round(_SLICE / step))) if sliced else left
            self._steer_all(steps * step)
            self._motors.advance(steps * step)
            left -= steps

    def trajectory(self, index: int, present: int) -> tuple[int, int]:
        """Velocity Trajectory (136) and Position Trajectory (140) as words, at a present position."""
        if self._holds_position(index):
            at, velocity = self._reference(index, 0.0)
            return round(velocity / _VELOCITY_COUNTS), round(at)
        turns = self._motors.torque[index] and self._mode(index) == Mode.VELOCITY
        return int(self._motors.goal[index]) if turns else 0, present

    def is_ongoing(self, index: int) -> bool:
        """Whether a profile to a goal position is in progress."""
        made = self._profile[index]
        return self._holds_position(index) and (
            made is not None and self._elapsed(index) < made.duration
        )

    def status(self, index: int, present: int) -> int:
        """Moving Status (123) at a present position."""
        if not self._holds_position(index):
            return 0
        made = self._profile[index]
        near = abs(self._tables[index]["goal_position"] - present) <= _NEAR
        follows = abs(self._reference(index, 0.0)[0] - present) <= _NEAR
        return (
            (made.shape << 4 if made else 0)
            | (0 if follows else _NOT_FOLLOWING)
            | (_ONGOING if self.is_ongoing(index) else 0)
            | (_IN_POSITION if near else 0)
        )

    def _to_position(self, index: int) -> Profile:
        table = self._tables[index]
        fastest, quickest = table["profile_velocity"], table["profile_acceleration"]
        start, velocity = float(self._present(index)), 0.0
        if self.is_ongoing(index):
            start, velocity = self._reference(index, 0.0)
        goal = table["goal_position"]
        if table["drive_mode"] & TIME_BASED:
            total, rise = fastest * _MILLISECOND, quickest * _MILLISECOND
            return profile.by_time(start, velocity, goal, total, rise)
        acceleration = quickest * _ACCELERATION_COUNTS
        return profile.by_velocity(start, velocity, goal, fastest * _VELOCITY_COUNTS, acceleration)

    def _to_velocity(self, index: int) -> Profile:
        """A profile of velocity words, whose positions mean nothing."""
        table = self._tables[index]
        goal, quickest = table["goal_velocity"], table["profile_acceleration"]
        velocity = float(self._motors.goal[index])
        if self._profile[index] is not None:
            velocity = self._reference(index, 0.0)[1]
        if table["drive_mode"] & TIME_BASED:
            return profile.ramp(0.0, velocity, goal, quickest * _MILLISECOND)
        rate = quickest * _ACCELERATION_COUNTS / _VELOCITY_COUNTS
        return profile.ramp(0.0, velocity, goal, abs(goal - velocity) / rate if quickest else 0.0)

    def _steer_all(self, duration: float) -> None:
        """Set what the motors are told for the coming duration [s]."""
        present = self._motors.registers().present_position
        for index in range(len(self._tables)):
            self._steer(index, duration, int(present[index]))

    def _steer(self, index: int, duration: float, present: int) -> None:
        table, motors = self._tables[index], self._motors
        limit = min(abs(table["goal_pwm"]), table["pwm_limit"])
        motors.duty[index] = min(1.0, limit * xl430.PWM_UNIT)
        if not motors.torque[index]:
            return
        mode = self._mode(index)
        if mode == Mode.PWM:
            motors.goal[index] = np.sign(table["goal_pwm"]) * _FULL_SPEED
        elif mode in _POSITIONS:
            motors.goal[index] = self._speed_to_goal(index, duration, present)
        elif self._profile[index] is not None:
            (now, _), (later, _) = (self._reference(index, after) for after in (0.0, duration))
            motors.goal[index] = round((later - now) / duration)

    def _speed_to_goal(self, index: int, duration: float, present: int) -> int:
        table = self._tables[index]
        gain = _POSITION_RATE * table["position_p_gain"] / TABLE["position_p_gain"].default
        (now, _), (later, _) = (self._reference(index, after) for after in (0.0, duration))
        forward = min(1.0, gain / _POSITION_RATE) * (later - now) / duration  # none without a gain
        speed = forward + gain * (now - present)
        fastest = self._motors.twin.arm.servo.no_load_speed / xl430.VELOCITY_UNIT
        return int(np.clip(np.rint(speed / _VELOCITY_COUNTS), -fastest, fastest))

    def _reference(self, index: int, after: float) -> tuple[float, float]:
        """The trajectory's position and velocity a time from now [s]."""
        made = self._profile[index]
        if made is None:
            return self._tables[index]["goal_position"], 0.0
        return made.at(self._elapsed(index) + after)

    def _is_steered(self, index: int) -> bool:
        made = self._profile[index]
        ramped = made is not None and self._elapsed(index) < made.duration
        return bool(self._motors.torque[index]) and (ramped or self._holds_position(index))

    def _holds_position(self, index: int) -> bool:
        return self._mode(index) in _POSITIONS and bool(self._motors.torque[index])

    def _mode(self, index: int) -> int:
        return self._tables[index]["operating_mode"]

    def _elapsed(self, index: int) -> float:
        return self._motors.time - self._began[index]

    def _present(self, index: int) -> int:
        return int(self._motors.registers().present_position[index])
