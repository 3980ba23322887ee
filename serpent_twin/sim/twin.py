"""Simulate the arm that its motors drive."""

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, joint_from_motor
from serpent_twin.arrays import Array
from serpent_twin.engine.history import History
from serpent_twin.engine.stepper import addresses
from serpent_twin.errors import SerpentError
from serpent_twin.sim.cable_dynamics import CableDynamics
from serpent_twin.sim.many_twins import TIMESTEP, PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import taken_up
from serpent_twin.sim.pushes import LinkForces, Push
from serpent_twin.sim.reading_age import Readings
from serpent_twin.sim.response import Response
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

_GOALS, _PACES = slice(0, 2 * N_MOTORS, 2), slice(1, 2 * N_MOTORS, 2)
"""Columns of the motors' goals and paces in the controls: actuators that effects add come after the motors"""
_TORQUE = slice(2 * N_MOTORS, 3 * N_MOTORS)  # in the sensor vector, as mjcf.py orders it
_MARKERS = slice(3 * N_MOTORS, 3 * N_MOTORS + 3 * N_JOINTS)
_GAIN_I, _GAIN_P, _VOLTAGE = 4, 6, 7  # of a dcmotor's gainprm: mjcf.py's `controller`
_NO_VOLTAGE = 1e-6  # [1] share of the supply; MuJoCo takes 0 for no limit
_SETTLE = 2.0  # [s]
_UNSTABLE = (
    "the twin's simulation became unstable in {}. Lower the strand stiffness or raise the damping in "
    "the parameters."
)


class Twin:
    """`nsim` runs of one arm, stepped side by side; every array below has their rows in front.

    A run starts straight and hanging, at rest, all angles zero. Readings are of the present
    instant. The whole state is in MuJoCo's state rows, the servos' goals, and the effects' memories.
    """

    def __init__(
        self,
        design: TwinModel = NOMINAL_TWIN,
        nsim: int = 1,
        nthread: int = 1,
        model: mujoco.MjModel | None = None,
        prior_runtime: float = 0.0,
    ) -> None:
        """`model` replaces the compiled spec of the twin model; `prior_runtime` is the total time of the
        arm's earlier sessions [s], for effects of wear.
        """
        self.model = model or design.spec().compile()
        self.design, self.arm = design, design.arm
        self.batch = Batch(self.model, nsim, nthread)
        self.qpos, self.qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        self._motor_q, self._motor_v = addresses(self.model, mjcf.MOTORS)
        self._joint_q, _ = addresses(self.model, mjcf.JOINTS)
        self._jaw_q = addresses(self.model, ("jaw",))[0][0]
        self._time, self._ctrl = self.batch.bind("time"), self.batch.bind("ctrl")
        self._force = self.batch.bind("actuator_force")[:, :N_MOTORS]
        self._sensors, self._stretch = self.batch.bind("sensordata"), self.batch.bind("ten_length")
        self._strands = tuple(
            self.batch.expand(f"tendon_{of}")
            for of in ("lengthspring", "stiffness", "stiffnesspoly")
        )
        self._gain = self.batch.expand("actuator_gainprm")[:, :N_MOTORS]
        self._firmware_gain = self._gain.copy()
        self._goal, self._pace = np.zeros((2, nsim, N_MOTORS))
        self.mechanism = CableDynamics(self.batch, [design] * nsim, motors=True)
        self.mechanism.prior_runtime = self.prior_runtime = prior_runtime
        self.pushes: Sequence[Push] = ()
        """What pushes links of all runs, at times since they began"""
        self._pushed = LinkForces(self.batch)
        self._readings = Readings()
        self._ran = 0.0  # a run that became unstable resets MuJoCo's clock
        self.mechanism.begin(self.mechanism.moment(*self._instant()))
        self._look()
        History(self.batch).fill()
        self.batch.forward()

    @property
    def runtime(self) -> float:
        """Total time that the arm has run, earlier sessions included [s]."""
        return self.prior_runtime + self._ran

    def anew(self) -> "Twin":
        """One run of the same arm, straight, at rest and re-strung; wear is kept."""
        return Twin(self.design, model=self.model, prior_runtime=self.runtime)

    @property
    def motor_angle(self) -> Array:
        """Motor angles [rad], (nsim, 10)."""
        return self.qpos[:, self._motor_q]

    @property
    def motor_velocity(self) -> Array:
        """Motor velocities [rad/s], (nsim, 10)."""
        return self.qvel[:, self._motor_v]

    @property
    def motor_torque(self) -> Array:
        """Torque of each drive at the horn, the gearbox's own friction included [N m], (nsim, 10)."""
        return self._sensors[:, _TORQUE].copy()

    @property
    def reported(self) -> Array:
        """Angles [rad], velocities [rad/s] and torques [N m] of the motors as they report them, which may be
        old, (nsim, 3, 10).
        """
        torque = self.mechanism.misread(self.motor_torque)
        now = np.stack([self.motor_angle, self.motor_velocity, torque], axis=1)
        return self._readings.before(self._ran, now, self.mechanism.reading_age)

    @property
    def joint_angle(self) -> Array:
        """Joint angles [rad], (nsim, 9)."""
        return self.qpos[:, self._joint_q]

    @property
    def jaw_angle(self) -> Array:
        """The jaw's angle [rad], (nsim,)."""
        return self.qpos[:, self._jaw_q].copy()

    @property
    def markers(self) -> Array:
        """Where cameras without noise see the markers, in the base frame [m], (nsim, 9, 3)."""
        seen = self._sensors[:, _MARKERS].reshape(-1, N_JOINTS, 3)
        return seen + self.mechanism.marker_shift

    @property
    def tension(self) -> Array:
        """Tension of every strand, in the order of `mjcf.STRANDS` [N], (nsim, 20)."""
        rest, stiffness, bend = self._strands
        over = np.maximum(self._stretch - rest[:, :, 1], 0.0)
        return (stiffness + bend[:, :, 0] * over) * over

    def power(self, on: ArrayLike) -> None:
        """Switch the drives on or off; `on` is broadcast to (nsim, 10). Off, a motor turns freely
        against its gear friction; switched on, it starts from where it is.
        """
        was_on = self._gain[:, :, _GAIN_P] > 0
        on = np.broadcast_to(np.asarray(on, bool), self._goal.shape)
        for gain in (_GAIN_I, _GAIN_P):
            self._gain[:, :, gain] = np.where(on, self._firmware_gain[:, :, gain], 0.0)
        self._goal = np.where(on & was_on, self._goal, self.motor_angle)
        self._pace = np.where(on & was_on, self._pace, 0.0)

    def limit_voltage(self, share: ArrayLike) -> None:
        """Limit the drives' voltages to shares of the full one, 0 … 1, broadcast to (nsim, 10)."""
        share = np.maximum(np.broadcast_to(share, self._goal.shape), _NO_VOLTAGE)
        full = self._firmware_gain[:, :, _VOLTAGE]
        self._gain[:, :, _VOLTAGE] = np.where(share < 1, share * full, full)

    def advance(self, velocity: ArrayLike, duration: float) -> Array:
        """Hold goal velocities [rad/s], broadcast to (nsim, 10), for a duration [s].

        Returns the drives' torques in every substep [N m], (nsim, substeps, 10). The servo's integral is the
        angle by which a motor is behind its integrated goal; it stops growing where it alone would demand the
        stall torque, as firmware prevents wind-up.
        """
        velocity = np.broadcast_to(np.asarray(velocity, float), self._goal.shape)
        substeps = self.substeps(duration)
        most = self.arm.servo.stall_torque / self.arm.servo.velocity_i
        angle = self.qpos[:, self._motor_q]
        self._goal = np.clip(self._goal, angle - most, angle + most)
        control = np.zeros((len(angle), substeps, self.model.nu))
        elapsed = self.model.opt.timestep * np.arange(substeps)
        control[:, :, _GOALS], control[:, :, _PACES] = self._held_to(velocity, elapsed)
        ahead = self._held_to(velocity, np.array([duration]))
        in_python = self.mechanism.acting or self.pushes
        torque = self._step(control) if in_python else self._roll(control)
        self._goal, self._pace = (each[:, 0] for each in ahead)
        # readings are of the present instant, not of a step ago
        self._ctrl[:, _GOALS], self._ctrl[:, _PACES] = self._goal, self._pace
        self._pushed.apply(self.pushes, self._ran + duration)
        self._look()
        self._refuse_divergence()
        self._ran += duration
        return torque

    def _held_to(self, velocity: Array, elapsed: Array) -> tuple[Array, Array]:
        """Angles and velocities to which servos that take up new goal velocities, (nsim, 10), are held after
        so many times (n,) [s]; (nsim, n, 10) and what broadcasts to it.
        """
        goal, old, new = (x[:, None] for x in (self._goal, self._pace, velocity))
        return taken_up(goal, old, new, elapsed[:, None], self.design.parameters.servo_lag)

    def _roll(self, control: Array) -> Array:
        """Take all substeps at once: no effect acts in Python."""
        record = self.batch.rollout(control.shape[1], control, record=("actuator_force",))
        return record["actuator_force"][..., :N_MOTORS]

    def _step(self, control: Array) -> Array:
        """Step substep by substep, effects acting before each."""
        torque = np.empty((*control.shape[:2], N_MOTORS))
        for k in range(control.shape[1]):
            self._ctrl[...] = control[:, k]
            self._pushed.apply(self.pushes, self._ran + k * self.model.opt.timestep)
            time, angle, velocity = self._instant()
            self.mechanism.step(time, angle, velocity, self.model.opt.timestep)
            torque[:, k] = self._force
            told = self.mechanism.misread(torque[:, k])
            reading = np.stack([angle, velocity, told], axis=1)
            began = self._ran + k * self.model.opt.timestep
            self._readings.keep(began, reading, self.mechanism.reading_age)
        return torque

    def _instant(self) -> tuple[Array, Array, Array]:
        """Time [s], (nsim, 1), and the motors' angles and velocities."""
        return self._time[:, None].copy(), self.motor_angle, self.motor_velocity

    def _look(self) -> None:
        """Update sensors and tensions to the present instant."""
        if self.mechanism.acting:
            self.mechanism.act(self.mechanism.moment(*self._instant()))
        self.batch.forward()

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
            raise SerpentError(_UNSTABLE.format(f"run {raised[0]} of {len(self.qpos)}"))


def replay_motors(
    time: Array,
    motor_position: Array,
    design: TwinModel = NOMINAL_TWIN,
    prior_runtime: float = 0.0,
) -> Response:
    """Response, (T,), of a twin model whose motors follow measured angles [rad], (T, 10), at rising times
    [s], (T,).

    `prior_runtime` is the total time of the arm's earlier sessions [s], for effects of wear.

    The run starts where stiff cables would put the joints, and settles for two seconds. A gap in
    time is bridged as one long, even motion.
    """
    angle = np.concatenate([motor_position[:1], motor_position])
    clock = np.concatenate([time[:1] - _SETTLE, time])
    motors = MotorTrajectory(clock, angle, np.gradient(angle, clock, axis=0))
    joint = joint_from_motor(motor_position[:1, :N_JOINTS])
    motion = PrescribedMotion(motors[None], joint, prior_runtime=prior_runtime)
    for timestep in (TIMESTEP, mjcf.TIMESTEP):
        response = impose([design], motion, timestep, 1)
        if not response.unstable.any():
            return response[0, 0, 1:]
    raise SerpentError(_UNSTABLE.format("its replay"))
