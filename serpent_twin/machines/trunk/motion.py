"""Simulate trunks whose servos are given goal angles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Instant
from serpent_twin.effects.law import ACTUATOR_COMMAND, HANDLES, POSITIONS, READINGS, Law
from serpent_twin.engine.history import History
from serpent_twin.engine.stepper import Stepper, set_timestep, side_by_side
from serpent_twin.errors import SerpentError
from serpent_twin.machines.trunk.body import TIME_STEP
from serpent_twin.machines.trunk.shape import DISKS, ENDS_AT, MOTORS, Shape
from serpent_twin.numerals import listed
from serpent_twin.sim.arm_places import column

PLACES = {
    "actuator": tuple(f"motor{m}" for m in MOTORS),
    "body": tuple(f"disk{k}" for k in DISKS),
    "sensor": tuple(f"marker{k}" for k in DISKS),
}
"""Names of the places of each kind at which laws read and change"""
CHANGED = ("winch_angle", ACTUATOR_COMMAND, "marker_shift")
"""What laws change"""
FOLLOWED = ("motor_angle", "motor_velocity", "horn_torque", ACTUATOR_COMMAND)
"""What laws follow of a motor, besides positions of disks and the time"""
SIMULATED = 27
"""Numbers of a row: of three disks x, y and z; of six servos their angles, the cables' torques, the goals"""


@dataclass
class TrunkMoment(Instant):
    """One time step of n trunks; arrays are (n, 6), one number a servo."""

    given: ClassVar[frozenset[str]] = frozenset(
        {"dt", "time", "motor_velocity", "cable_torque", "disk", "stood"}
    )

    dt: Array
    """[s], (n, 1)"""
    time: Array
    """Since the session began [s], (n, 1)"""
    motor_velocity: Array
    """Rate of the servos' goal angles [rad/s]"""
    cable_torque: Array
    """Torque of the cables on each servo's horn [N m]"""
    disk: Array
    """Where the disks' sensors were a time step before, in the logs' frame [m], (n, 9)"""
    stood: Array
    """Where the servos stood a time step before [rad]"""

    goal: Array
    """Goal angles of the servos [rad]; they stand there, unless an effect changes that"""
    motor_angle: Array
    """Where they stand [rad]"""
    winch_angle: Array
    """What winds the cables [rad]"""
    marker_shift: Array
    """By which disks' markers are elsewhere, in the disks' frames [m], (n, 9)"""

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        if name == "goal":  # is reached at once, unless a later effect makes the servos yield
            self.stand(value)

    def stand(self, angle: Array) -> None:
        """Set the angles of the servos, and of what winds the cables [rad]."""
        self.motor_angle, self.winch_angle = angle.copy(), angle.copy()

    def reading_of(self, law: Law) -> Array:
        """What a law follows, (n, 1): of motors, where they stand after delay and sag, at which rate, the
        cables' torque, and the goal that reaches them; of disks, their positions in the logs' frame, y up.
        """
        if law.reading in ("", "time"):
            return self.time
        if law.reading not in (*FOLLOWED, *POSITIONS):
            there = listed([*FOLLOWED, *POSITIONS, "time"])
            raise SerpentError(f"no law follows the {law.depends_on} here; there are: {there}.")
        at = column(PLACES[READINGS[law.reading].kind], law.where)
        if law.reading in POSITIONS:
            at = 3 * at + POSITIONS.index(law.reading)
            return self.disk[:, at : at + 1]
        if law.reading == "motor_velocity":
            return (self.motor_angle - self.stood)[:, at : at + 1] / self.dt
        names = {"horn_torque": "cable_torque", ACTUATOR_COMMAND: "goal"}
        return getattr(self, names.get(law.reading, law.reading))[:, at : at + 1]

    def change(self, law: Law, sizes: Sequence[Array | float]) -> None:
        """Turn a winch by a size (n, 1) [rad], with another command its servo as well, or shift a marker by
        three [m].
        """
        if law.handle not in CHANGED:
            raise SerpentError(f"no law changes {law.handle} here; there are: {listed(CHANGED)}.")
        at, d = column(PLACES[HANDLES[law.handle].kind], law.place), len(sizes)
        by = np.concatenate([np.broadcast_to(size, self.time.shape) for size in sizes], axis=1)
        told = law.handle == ACTUATOR_COMMAND
        for name in ("winch_angle", "motor_angle") if told else (law.handle,):
            changed = getattr(self, name).copy()
            changed[:, d * at : d * (at + 1)] += by
            setattr(self, name, changed)


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
        self._turns = self.batch.bind("site_xmat")
        self._markers = [models[0].site(name).id for name in PLACES["sensor"]]
        self._wound = np.array([s["wound"][np.array(ENDS_AT) - 1] for s in shapes])
        self._zero = np.array([s["zero"] for s in shapes])

    def run(self, goal: Array, time: Array, period: Array) -> Array:
        """Where disks and servos are in each row, the cables' torque on the horns, and the goals that reach
        the servos, (n, T, 27), for goals (n, T, 6) [rad] in rows at times (n, T) since the session
        began, periods (n,) apart [s].
        """
        n, T = goal.shape[:2]
        steps = max(1, round(float(period.max()) / TIME_STEP))
        dt = (period / steps)[:, None]
        set_timestep(self.batch, dt)
        ahead = np.diff(goal, axis=1, append=goal[:, -1:])
        out = np.empty((n, T, SIMULATED))
        rate, stood = ahead / (steps * dt[:, None]), goal[:, 0]
        moment = self._moment(goal[:, 0], rate[:, 0], time[:, :1], dt, stood)
        self.begin(moment)
        self.apply(moment)
        self.batch.forward()
        History(self.batch).fill()
        for t in range(T):
            for k in range(steps):
                told = goal[:, t] + k / steps * ahead[:, t]
                now = time[:, t : t + 1] + k * dt
                moment = self.act(self._moment(told, rate[:, t], now, dt, stood))
                self.batch.step()
                stood = moment.motor_angle
                if k == 0:  # a step reads its sensors before it moves
                    disk = self._sensors + self._turned(moment.marker_shift)
                    seen = (disk, stood, moment.cable_torque, moment.goal)
                    out[:, t] = np.concatenate(seen, axis=1)
        return out

    def _turned(self, shift: Array) -> Array:
        """Shifts (n, 9) of markers in the disks' frames, in that of the logs [m], (n, 9): they show at once,
        also where cameras are late.
        """
        turns = self._turns.reshape(len(shift), -1, 3, 3)[:, self._markers]
        return (turns @ shift.reshape(-1, 3, 3, 1)).reshape(shift.shape)

    def _moment(
        self, goal: Array, velocity: Array, time: Array, dt: Array, stood: Array
    ) -> TrunkMoment:
        over = np.maximum(self._length - self._rest[:, :, 1], 0.0)
        tension = over * (self._stiffness + self._bend[:, :, 0] * over)
        torque = self._wound * (tension[:, 0::2] - tension[:, 1::2])
        return TrunkMoment(
            dt=dt,
            time=time,
            motor_velocity=velocity,
            cable_torque=torque,
            disk=self._sensors,
            stood=stood,
            goal=goal,
            motor_angle=goal.copy(),
            winch_angle=goal.copy(),
            marker_shift=np.zeros((len(goal), 9)),
        )

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
