"""Simulate trunks whose servos are given goal angles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Instant
from serpent_twin.errors import SerpentError
from serpent_twin.machines.trunk.body import TIME_STEP
from serpent_twin.machines.trunk.shape import ENDS_AT, Shape
from serpent_twin.sim.history import History
from serpent_twin.sim.stepper import Stepper, set_timestep, side_by_side


@dataclass
class TrunkMoment(Instant):
    """One time step of n trunks; arrays are (n, 6), one number a servo. `tell` changes the goal."""

    given: ClassVar[frozenset[str]] = frozenset({"dt", "motor_velocity", "cable_torque", "goal"})

    dt: Array
    """[s], (n, 1)"""
    motor_velocity: Array
    """Rate of the servos' goal angles [rad/s]"""
    cable_torque: Array
    """Torque of the cables on each servo's horn [N m]"""

    goal: Array
    """Goal angles of the servos [rad]; they stand there, unless an effect changes that"""
    motor_angle: Array
    """Where they stand [rad]"""
    winch_angle: Array
    """What winds the cables [rad]"""

    def tell(self, goal: Array) -> None:
        """Give the servos another goal [rad], reached at once unless a later effect makes them yield."""
        object.__setattr__(self, "goal", goal)
        self.stand(goal)

    def stand(self, angle: Array) -> None:
        """Set the angles of the servos, and of what winds the cables [rad]."""
        self.motor_angle, self.winch_angle = angle.copy(), angle.copy()


class Trunks(Stepper[TrunkMoment]):
    """Trunk i of models[i] and shapes[i] with effects[i], side by side."""

    def __init__(
        self,
        models: Sequence[mujoco.MjModel],
        shapes: Sequence[Shape],
        several: Sequence[Sequence[Effect]],
        threads: int,
    ) -> None:
        _refuse_memories(several)
        super().__init__(side_by_side(models, threads), several)
        self._length = self.batch.bind("ten_length")
        self._rest = self.batch.expand("tendon_lengthspring")
        self._straight = self._rest[:, :, 1].copy()
        self._stiffness = self.batch.expand("tendon_stiffness")
        self._bend = self.batch.expand("tendon_stiffnesspoly")
        self._sensors = self.batch.bind("sensordata")
        self._wound = np.array([s["wound"][np.array(ENDS_AT) - 1] for s in shapes])
        self._zero = np.array([s["zero"] for s in shapes])

    def run(self, goal: Array, period: Array) -> tuple[Array, Array]:
        """Where disks (n, T, 9) and servos (n, T, 6) are in each row, for goals (n, T, 6) [rad], rows of
        periods (n,) [s] apart.
        """
        n, T = goal.shape[:2]
        steps = max(1, round(float(period.max()) / TIME_STEP))
        dt = (period / steps)[:, None]
        set_timestep(self.batch, dt)
        ahead = np.diff(goal, axis=1, append=goal[:, -1:])
        disks, servos = np.empty((n, T, 9)), np.empty((n, T, 6))
        moment = self._moment(goal[:, 0], ahead[:, 0] / (steps * dt), dt)
        self.begin(moment)
        self.apply(moment)
        self.batch.forward()
        History(self.batch).fill()
        for t in range(T):
            for k in range(steps):
                told = goal[:, t] + k / steps * ahead[:, t]
                moment = self._moment(told, ahead[:, t] / (steps * dt), dt)
                self.act(moment)
                self.batch.step()
                if k == 0:  # a step reads its sensors before it moves
                    disks[:, t], servos[:, t] = self._sensors, moment.motor_angle
        return disks, servos

    def _moment(self, goal: Array, velocity: Array, dt: Array) -> TrunkMoment:
        over = np.maximum(self._length - self._rest[:, :, 1], 0.0)
        tension = over * (self._stiffness + self._bend[:, :, 0] * over)
        torque = self._wound * (tension[:, 0::2] - tension[:, 1::2])
        return TrunkMoment(dt, velocity, torque, goal, goal.copy(), goal.copy())

    def apply(self, moment: TrunkMoment) -> None:
        """Wind the cables to where the servos stand."""
        wound = self._wound * (moment.winch_angle + self._zero)
        self._rest[:, :, 1] = self._straight - np.repeat(wound, 2, axis=1) * np.tile([1.0, -1.0], 6)


def _refuse_memories(several: Sequence[Sequence[Effect]]) -> None:
    """Refuse effects whose memory each window of a log would reset."""
    for effect in (each for there in several for each in there):
        if effect.remembers:
            raise SerpentError(
                f"the effect {type(effect).__name__} remembers for longer than a window of a log, and this "
                "machine's logs are cut into windows that are run alone. Leave it out of this twin."
            )
