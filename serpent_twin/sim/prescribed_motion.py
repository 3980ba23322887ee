"""Simulate arms whose motors follow a prescribed motion, row by row."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.engine.history import History
from serpent_twin.engine.stepper import addresses, set_timestep, side_by_side
from serpent_twin.sim.arm_moment import Moment
from serpent_twin.sim.cable_dynamics import CableDynamics
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.pushed_statics import Pushed, PushedStatics
from serpent_twin.sim.response import Response
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.sim.variation import Variation

_LONGEST = 0.3
"""Greatest sum of a servo's lag and the age of its readings [s]"""
STANDING = 0.05
"""[rad/s] slower than this, a motor's load lies anywhere within its gear friction."""


class DrivenArms:
    """Arms that step side by side, each of its own twin model, all with effects of the same kinds.

    The motors' angles wind the strands, whatever pulls. `place` comes first, then `move` and `read`.
    """

    def __init__(
        self,
        designs: Sequence[TwinModel],
        models: Sequence[mujoco.MjModel],
        servo_lag: float = 0.0,
        nthread: int = 1,
    ) -> None:
        """`servo_lag` is the mean time with which a motor takes up a new velocity after a row [s]."""
        self._lag, self._stall = servo_lag, designs[0].arm.servo.stall_torque
        self._batch, self._models = side_by_side(models, nthread), models
        self._cables = CableDynamics(self._batch, designs, motors=False)
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._sensors = self._batch.bind("sensordata")
        self._history = History(self._batch)
        self._joint_q, self._joint_v = addresses(models[0], mjcf.JOINTS)
        self._jaw = addresses(models[0], ("jaw",))[0]
        self._statics: PushedStatics | None = None
        none = np.zeros(len(designs))
        self._marker_velocity: Array | float = 0.0
        self._motors = MotorTrajectory(none, *np.zeros((2, len(designs), 10)))

    @property
    def prior_runtime(self) -> Array | float:
        """Total time of each arm's earlier sessions [s], (n,)."""
        return np.ravel(self._cables.prior_runtime)

    @prior_runtime.setter
    def prior_runtime(self, seconds: Array) -> None:
        self._cables.prior_runtime = np.asarray(seconds)[:, None]

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Which simulations became unstable, of bool, (n,)."""
        return self._batch.warning[..., 1].any(axis=-1)

    def place(
        self,
        motors: MotorTrajectory,
        joint_angle: Array,
        joint_velocity: Array | float = 0.0,
        anew: bool = True,
    ) -> None:
        """Put the joints at angles [rad], (n, 9), and velocities [rad/s]; `anew` resets effects."""
        self._hold(motors, joint_angle)
        self._qvel[:, self._joint_v] = joint_velocity
        if anew:
            self._begin(motors)
        self._wind(motors)
        self._batch.forward()
        self._history.fill()

    def feel(self, motors: MotorTrajectory, joint_angle: Array, anew: bool = False) -> None:
        """Give effects with memory a measured pose [rad], (n, 9), at rest; nothing is simulated.

        Between the pose before and this one they are given an even motion, each arm in time steps that are
        stable for its laws, however many its neighbours take.
        """
        if anew:
            self._hold(motors, joint_angle)
            self._begin(motors)
            return
        before, was = self._motors, self._qpos[:, self._joint_q]
        interval = (motors.time - before.time)[:, None]
        steps = np.maximum(1, np.ceil(interval / self._cables.longest_step[:, None]))
        for k in range(int(steps.max())):
            share = np.minimum(1.0, (k + 1) / steps)
            now = before.towards(motors, share)
            self._hold(now, was + share * (joint_angle - was))
            dt = np.where(k < steps, interval / steps, 0.0)
            self._cables.act(self._instant(now, dt))

    def _hold(self, motors: MotorTrajectory, joint_angle: Array) -> None:
        """Put joints and the jaw at given angles, at rest."""
        self._motors = motors
        self._qpos[...], self._qvel[...] = 0.0, 0.0
        self._qpos[:, self._joint_q] = joint_angle
        passed = joint_angle.sum(axis=1, keepdims=True)
        wound = self._cables.winch_ratio[:, -1:] * motors.angle[:, -1:] - passed
        self._qpos[:, self._jaw] = self._cables.jaw_at_rest(wound)

    def _begin(self, motors: MotorTrajectory) -> None:
        self._cables.begin(self._instant(motors))

    def _instant(self, motors: MotorTrajectory, dt: float | Array = 0.0) -> Moment:
        return self._cables.moment(motors.time[:, None], motors.angle, motors.velocity, dt)

    @property
    def reading_age(self) -> Array:
        """How old the motors' angles are that drive each arm, as its effects say [s], (n,)."""
        return self._cables.reading_age

    def move(
        self,
        to: MotorTrajectory,
        substeps: int,
        passing: Callable[[Array, Array], None] | None = None,
    ) -> None:
        """Step to the next row, in so many time steps; `passing` is given the times [s], (n,), and the
        markers [m], (n, 9, 3), of each.
        """
        before, interval = self._motors, to.time - self._motors.time
        dt = (interval / substeps)[:, None]
        set_timestep(self._batch, dt)
        old, late = before.velocity, self.reading_age[:, None]
        path = _Path(before.angle, to.angle, old, substeps * dt, self._lag, late)
        began = before.time[:, None]
        lost = self.unstable  # their solver would iterate as long as it may
        stable = np.flatnonzero(~lost) if lost.any() else None
        passed = (
            np.arange(substeps)[:, None, None] * dt
        )  # MuJoCo's springs pull as at a step's start
        for k, (t, angle, velocity) in enumerate(zip(passed, *path.at(passed), strict=True), 1):
            seen = k == substeps or passing is not None
            self._cables.step(began + t, angle, velocity, dt, stable, seen)
            if passing:
                passing((began + t)[:, 0], self._markers())
        self._motors, before_end = to, self._markers()
        self._wind(to)
        self._batch.forward(ids=stable)
        self._marker_velocity = (self._markers() - before_end) / dt[..., None]
        if passing:
            passing(to.time, self._markers())

    def pushed(self, link: int, force: Array) -> Pushed:
        """How the first arm answers to a force on a link, 1 … 9, in the base frame [N], (3,), and to further
        ones; motors hold their angles, and what else moves goes on.
        """
        self._statics = self._statics or PushedStatics(self._models[0])
        cables = self._cables
        found = self._statics.answers(self._qpos[0, self._joint_q], cables.strands(0), link, force)
        share = (1.0 + np.broadcast_to(cables.load_scale, (len(self._qpos), 10))[0]) / self._stall
        return replace(found, load=share * found.load, slope=share[:, None] * found.slope)

    def variation(self) -> Variation:
        """The differences between the first arm and each further one, which can be set anew at any time."""
        return Variation(self._batch, self._models)

    def nudge(self, joint_angle: Array) -> None:
        """Move the joints to angles [rad], (n, 9); velocities and memories stay."""
        self._qpos[:, self._joint_q] = joint_angle
        self._batch.forward()

    def _wind(self, motors: MotorTrajectory) -> None:
        self._cables.wind(self._cables.slack, motors.angle, motors.angle)

    def _markers(self) -> Array:
        """What the marker sensors show, (n, 9, 3); after a time step, of its beginning."""
        return self._sensors.reshape(-1, N_JOINTS, 3) + self._cables.marker_shift

    def marker_shift(self) -> Array:
        """Where effects have the cameras see the markers besides, at the present instant [m], (n, 9, 3)."""
        self._cables.act(self._instant(self._motors))
        return np.broadcast_to(self._cables.marker_shift, (len(self._qpos), N_JOINTS, 3))

    def read(self) -> Response:
        """The sensors' readings of the present instant, (n,). Where the motors' angles are old, the markers
        are carried on by their velocity.
        """
        motors = self._motors
        moment = self._cables.act(self._instant(motors))
        loss = moment.gear_friction * np.tanh(motors.velocity / (STANDING / 3))
        marker = self._markers()
        if self.reading_age.any():
            marker += self.reading_age[:, None, None] * self._marker_velocity
        return Response(
            marker=marker,
            load=self._cables.misread(self._cables.horn_torque(moment) + loss) / self._stall,
            joint_angle=self._qpos[:, self._joint_q],
            jaw_angle=self._qpos[:, self._jaw[0]].copy(),
            tension=moment.tension,
        )


class _Path:
    """Motion of motors between rows: each takes up the constant velocity that ends at the measured angle.

    Where readings are old, (n, 1) [s], the motors go on as they did for so long after a row: of the lag that
    logs show, so much is dead time.
    """

    def __init__(
        self, before: Array, after: Array, old: Array, period: Array, lag: float, late: Array
    ) -> None:
        self._old, self._dead = old, np.minimum(late, lag)
        self._before, self._lag = before, lag - self._dead
        period = period - self._dead
        taken = self._lag * (1 - _faded(period, self._lag))
        self._new = (after - before - old * (self._dead + taken)) / (period - taken)

    def at(self, t: Array) -> tuple[Array, Array]:
        """Angles [rad] and velocities [rad/s], (K, n, 10), at times [s] since the row before, (K, n, 1)."""
        before = self._before + self._old * np.minimum(t, self._dead)
        since = np.maximum(t - self._dead, 0.0)
        angle, velocity = taken_up(before, self._old, self._new, since, self._lag)
        angle.setflags(write=False)  # effects read it in every time step
        return angle, np.broadcast_to(velocity, angle.shape)


def taken_up(
    before: Array, old: Array, new: Array, t: Array, lag: float | Array
) -> tuple[Array, Array]:
    """Angles [rad] and velocities [rad/s] a time t [s] after motors at angles `before` were given
    new velocities in place of old ones, with a lag of first order [s]; shapes broadcast.

    x(t) = x₀ + v t + (v₀ − v) τ (1 − exp(−t/τ)).
    """
    change, fading = old - new, _faded(t, lag)
    return before + new * t + change * lag * (1 - fading), new + change * fading


def _faded(t: Array, lag: float | Array) -> Array:
    """What is left of a change after a time, with a lag of first order; nothing without a lag."""
    return np.where(np.greater(lag, 0), np.exp(-t / np.maximum(lag, 1e-9)), 0.0)


def servo_lag(logs: Sequence[tuple[Array, Array, Array]]) -> float:
    """Mean time with which the motors take up a new velocity after a row [s], from logs of time, (T,), angles
    and velocities, (T, 10): the servos' lag, and how old the readings are.

    Between two rows a motor goes v T + (v₀ − v) τ, so τ is a slope; a log without jumps gives 0.
    """
    jump, short = [], []
    for time, angle, v in logs:
        jump.append((v[:-1] - v[1:]).ravel())
        short.append((np.diff(angle, axis=0) - v[1:] * np.diff(time)[:, None]).ravel())
    x, y = np.concatenate(jump), np.concatenate(short)
    use = np.isfinite(x + y) & (np.abs(x) > 4 * STANDING)
    slope = float(x[use] @ y[use] / (x[use] @ x[use])) if use.sum() > 100 else 0.0
    return float(np.clip(slope, 0.0, _LONGEST))
