"""What does the arm do when its motors move?"""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike

from serpent_twin import mjcf
from serpent_twin.arm import ARM, N_JOINTS, N_MOTORS, Arm, Array, joint_from_motor
from serpent_twin.errors import SerpentError
from serpent_twin.parameters import NOMINAL, Parameters

MOTORS = slice(0, N_MOTORS)
JOINTS = slice(N_MOTORS, N_MOTORS + N_JOINTS)
JAW = N_MOTORS + N_JOINTS
_TORQUE = slice(2 * N_MOTORS, 3 * N_MOTORS)  # in the sensor vector, as mjcf.py orders it
_MARKERS = slice(3 * N_MOTORS, None)
_GAIN_I, _GAIN_P = 4, 6  # of a dcmotor's gainprm: mjcf.py's `controller`


class Twin:
    """`nsim` runs of one arm, stepped side by side; every array below has their rows in front.

    A run starts straight and hanging, at rest, all angles zero. Readings are of the present
    instant. All of the state lies in MuJoCo's state rows and the integrated velocity goals.
    """

    def __init__(
        self,
        model: mujoco.MjModel | None = None,
        nsim: int = 1,
        nthread: int = 1,
        arm: Arm = ARM,
        parameters: Parameters = NOMINAL,
    ) -> None:
        self.model = model or mjcf.build(arm, parameters).compile()
        self.arm = arm
        self.batch = Batch(self.model, nsim, nthread)
        self.qpos, self.qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        self._ctrl = self.batch.bind("ctrl")
        self._sensors, self._stretch = self.batch.bind("sensordata"), self.batch.bind("ten_length")
        self._gain = self.batch.expand("actuator_gainprm")
        self._firmware_gain = self._gain.copy()
        self._goal = np.zeros((nsim, N_MOTORS))
        self.batch.forward()

    @property
    def motor_angle(self) -> Array:
        """Motor angles [rad], (nsim, 10)."""
        return self.qpos[:, MOTORS].copy()

    @property
    def motor_velocity(self) -> Array:
        """Motor velocities [rad/s], (nsim, 10)."""
        return self.qvel[:, MOTORS].copy()

    @property
    def motor_torque(self) -> Array:
        """Torque of each drive at the horn, the gearbox's own friction included [N m], (nsim, 10)."""
        return self._sensors[:, _TORQUE].copy()

    @property
    def joint_angle(self) -> Array:
        """Joint angles [rad], (nsim, 9)."""
        return self.qpos[:, JOINTS].copy()

    @property
    def jaw_angle(self) -> Array:
        """The jaw's angle [rad], (nsim,)."""
        return self.qpos[:, JAW].copy()

    @property
    def markers(self) -> Array:
        """True marker positions in the base frame [m], (nsim, 9, 3)."""
        return self._sensors[:, _MARKERS].reshape(-1, N_JOINTS, 3).copy()

    @property
    def tension(self) -> Array:
        """Tension of every strand, in the order of `mjcf.STRANDS` [N], (nsim, 20)."""
        over = self._stretch - self.model.tendon_lengthspring[:, 1]
        return self.model.tendon_stiffness * np.maximum(over, 0.0)

    def power(self, on: ArrayLike) -> None:
        """Switch the drives on or off; `on` is broadcast to (nsim, 10). Off, a motor turns freely
        against its gear friction; switched on, it starts from where it is.
        """
        was_on = self._gain[:, :, _GAIN_P] > 0
        on = np.broadcast_to(np.asarray(on, bool), self._goal.shape)
        for gain in (_GAIN_I, _GAIN_P):
            self._gain[:, :, gain] = np.where(on, self._firmware_gain[:, :, gain], 0.0)
        self._goal = np.where(on & was_on, self._goal, self.motor_angle)

    def advance(self, velocity: ArrayLike, duration: float) -> Array:
        """Hold goal velocities [rad/s], broadcast to (nsim, 10), for a duration [s].

        Returns the drives' torques in every substep [N m], (nsim, substeps, 10).
        The servo's integral is the angle by which a motor is behind its integrated goal; it stops
        growing where it alone would ask for the stall torque, as firmware prevents wind-up.
        """
        velocity = np.broadcast_to(np.asarray(velocity, float), self._goal.shape)
        substeps = self.substeps(duration)
        most = self.arm.servo.stall_torque / self.arm.servo.velocity_i
        angle = self.qpos[:, MOTORS]
        self._goal = np.clip(self._goal, angle - most, angle + most)
        elapsed = self.model.opt.timestep * np.arange(substeps)
        control = np.empty((len(angle), substeps, 2 * N_MOTORS))
        control[:, :, 0::2] = self._goal[:, None] + velocity[:, None] * elapsed[:, None]
        control[:, :, 1::2] = velocity[:, None]
        record = self.batch.rollout(substeps, control, record=("actuator_force",))
        self._goal = self._goal + velocity * duration
        self._ctrl[:, 0::2] = self._goal  # what is read now belongs to now, not to a step ago
        self.batch.forward()
        self._refuse_divergence()
        return record["actuator_force"]

    def impose(self, start: ArrayLike, end: ArrayLike, duration: float) -> None:
        """Move the motors from angles to angles [rad], (nsim, 10), evenly and exactly, whatever pulls.

        The motors' state is set before each substep, so no servo's lag enters the comparison.
        """
        start, end = np.asarray(start, float), np.asarray(end, float)
        substeps = self.substeps(duration)
        self.qvel[:, MOTORS] = slope = (end - start) / duration
        for n in range(substeps):
            self.qpos[:, MOTORS] = start + (end - start) * (n / substeps)
            self.qvel[:, MOTORS] = slope
            self.batch.step()
        self.qpos[:, MOTORS], self.qvel[:, MOTORS] = end, slope
        self._goal[:] = end
        self.batch.forward()
        self._refuse_divergence()

    def substeps(self, duration: float) -> int:
        """Number of time steps in a duration [s], which must be a whole number of them."""
        substeps = round(duration / self.model.opt.timestep)
        if substeps < 1 or not np.isclose(substeps * self.model.opt.timestep, duration):
            raise SerpentError(
                f"the twin cannot advance by {duration:g} s: its time step is "
                f"{self.model.opt.timestep:g} s. Choose a rate whose period is a multiple of that."
            )
        return substeps

    def _refuse_divergence(self) -> None:
        raised = np.flatnonzero(self.batch.warning[..., 1].any(axis=-1))  # (lastinfo, number)
        if raised.size:
            raise SerpentError(
                f"the twin's simulation became unstable in run {raised[0]} of {len(self.qpos)}. "
                "Lower the strand stiffness or raise the damping in the parameters."
            )


@dataclass(frozen=True)
class Replay:
    """What the twin did while measured motor angles drove it; T rows, as the log's."""

    joint_angle: Array
    """[rad], (T, 9)"""
    jaw_angle: Array
    """[rad], (T,)"""
    tension: Array
    """In the order of `mjcf.STRANDS` [N], (T, 20)"""
    marker: Array
    """In the base frame [m], (T, 9, 3)"""


def replay_motors(time: Array, motor_position: Array, twin: Twin | None = None) -> Replay:
    """Drive a twin by measured motor angles [rad], (T, 10), at times [s], (T,).

    The run starts where stiff cables would put the joints, and settles for two seconds.
    """
    twin = twin or Twin()
    rows: list[tuple[Array, ...]] = []
    twin.qpos[0, MOTORS] = motor_position[0]
    twin.qpos[0, JOINTS] = joint_from_motor(motor_position[0, :N_JOINTS])
    twin.qpos[0, JAW] = motor_position[0, -1] - motor_position[0, -2]
    twin.impose(motor_position[:1], motor_position[:1], 2.0)
    step = twin.model.opt.timestep
    ticks = np.round((time - time[0]) / step).astype(int)
    for n in range(len(time)):
        if n and ticks[n] > ticks[n - 1]:
            duration = (ticks[n] - ticks[n - 1]) * step
            twin.impose(motor_position[n - 1 : n], motor_position[n : n + 1], duration)
        rows.append((twin.joint_angle[0], twin.jaw_angle[0], twin.tension[0], twin.markers[0]))
    return Replay(*(np.stack(column) for column in zip(*rows, strict=True)))
