"""What would arms do, if their motors moved exactly as logged?

The motors' angles wind the strands, whatever pulls: an error of the twin is not hidden by a
controller, nor made by a servo's lag. Many designs and many stretches of logs step side by side.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin import mjcf
from serpent_twin.arm import N_JOINTS, N_MOTORS, Array
from serpent_twin.design import Design
from serpent_twin.errors import SerpentError
from serpent_twin.history import History
from serpent_twin.mechanism import Mechanism, addresses, side_by_side

TIMESTEP = 0.005
"""[s]; a step of 1 ms moves the markers by about 0.1 mm, and by about 1 ms in time at most (tests)."""
_SWEEPS = 20
_SOFT = 7e3  # [N/m]
STANDING = 0.05
"""[rad/s] slower than this, a motor's load lies anywhere within its gear friction."""


@dataclass(frozen=True)
class Past:
    """What happened before each of B stretches, at K rows, for effects that remember.

    Motor angles and markers were measured then, so nothing is simulated: effects feel the measured
    pose, from row to row.
    """

    time: Array
    """Since each session began [s], (B, K); a shorter past repeats its first row"""
    motor_angle: Array
    """[rad], (B, K, 10)"""
    motor_velocity: Array
    """[rad/s], (B, K, 10)"""
    joint_angle: Array
    """From the markers [rad], (B, K, 9)"""


@dataclass(frozen=True)
class Stretches:
    """B stretches of R rows of logs; a run is put on the measured pose at every restart."""

    time: Array
    """Since each session began [s], (B, R)"""
    motor_angle: Array
    """[rad], (B, R, 10)"""
    motor_velocity: Array
    """[rad/s], (B, R, 10)"""
    joint_angle: Array
    """From the markers [rad], (B, R, 9); used at restarts only"""
    restart: Array
    """Rows at which a segment begins, of bool, (R,); the first is one"""
    servo_lag: float = 0.0
    """Time constant with which a motor takes up a new velocity after each row [s]"""
    earlier: Array | float = 0.0
    """How long the arm's sessions before each one ran in all [s], or (B,)"""
    joint_velocity: Array | float = 0.0
    """[rad/s], or (B, R, 9); used at restarts only"""
    past: Past | None = None
    """What effects with a long memory felt before; without, they begin with the first row"""


@dataclass(frozen=True)
class Response:
    """What D designs did in B stretches of R rows."""

    marker: Array
    """[m], (D, B, R, 9, 3)"""
    load: Array
    """Fraction of the stall torque, (D, B, R, 10)"""
    joint_angle: Array
    """[rad], (D, B, R, 9)"""
    jaw_angle: Array
    """[rad], (D, B, R)"""
    tension: Array
    """In the order of `mjcf.STRANDS` [N], (D, B, R, 20)"""
    unstable: Array
    """Designs whose simulation gave up; their numbers are NaN; of bool, (D,)"""


def impose(
    designs: Sequence[Design],
    stretches: Stretches,
    timestep: float = TIMESTEP,
    nthread: int = 0,
    rough: int = 0,
) -> Response:
    """Drive designs, all with effects of the same kinds, by measured motor angles.

    `rough`, so many times the time step with a few sweeps of a quicker solver, is about half as costly
    and good for differences between designs: markers are off by about 0.1 mm, by the same for all.
    """
    models = [design.spec(motors=False).compile() for design in designs]
    if rough:
        timestep *= rough
        for model in models:
            hasten(model)
    run = _Run(designs, models, stretches, timestep, nthread or os.cpu_count() or 1)
    for row in range(stretches.time.shape[1]):
        if stretches.restart[row]:
            run.restart(row)
        else:
            run.step_to(row)
        run.read(row)
    return run.response()


def hasten(model: mujoco.MjModel) -> None:
    """Let a model's friction be found by a few sweeps of a quicker solver."""
    model.opt.solver, model.opt.iterations = mujoco.mjtSolver.mjSOL_PGS, _SWEEPS


def bearable(designs: Sequence[Design]) -> int:
    """How many times the time step these designs bear where a rough answer does: soft strands bear two."""
    stiffest = max(
        d.parameters.strand_stiffness * np.exp(max(d.tolerances.strand_stiffness)) for d in designs
    )
    return 2 if stiffest < _SOFT else 1


def substeps(stretches: Stretches, timestep: float) -> NDArray[np.intp]:
    """Time steps between the rows of stretches, (R − 1,): jitter of the rows adds none."""
    interval = np.diff(stretches.time, axis=1)
    usual = np.ceil(np.median(interval) / timestep - 1e-9) if interval.size else 1
    longest = np.ceil(0.9 * interval.max(axis=0) / timestep)
    return np.maximum(np.maximum(usual, longest), 1).astype(np.intp)


class _Run:
    """Runs of all designs (D) in all stretches (B), D slow, B fast, from row to row."""

    def __init__(
        self,
        designs: Sequence[Design],
        models: Sequence[mujoco.MjModel],
        stretches: Stretches,
        timestep: float,
        nthread: int,
    ) -> None:
        self.s, (self.B, self.R), self.D = stretches, stretches.time.shape, len(designs)
        self.timestep = timestep
        for model in models:
            model.opt.timestep = timestep
        rows = [n for n in range(self.D) for _ in range(self.B)]
        self.batch = side_by_side([models[n] for n in rows], nthread)
        self.arms = Mechanism(self.batch, [designs[n] for n in rows], motors=False)
        self.arms.earlier = self._rows(np.broadcast_to(stretches.earlier, self.B))[:, None]
        self.dt = self.batch.expand("opt.timestep")
        self.qpos, self.qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        self.sensors = self.batch.bind("sensordata")
        self.history = History(self.batch)
        self.joints, self.joint_speeds = addresses(models[0], mjcf.JOINTS)
        self.jaw = addresses(models[0], ("jaw",))[0]
        self.substeps = substeps(stretches, timestep)
        self.stall = designs[0].arm.servo.stall_torque
        shape = (self.D * self.B, self.R)
        self.marker = np.empty((*shape, 3 * N_JOINTS))
        self.load, self.joint = np.empty((*shape, N_MOTORS)), np.empty((*shape, N_JOINTS))
        self.jaws, self.tension = np.empty(shape), np.empty((*shape, 2 * N_MOTORS))

    def _rows(self, of_stretches: Array) -> Array:
        """(B, …) for all designs, (D B, …)."""
        return np.tile(of_stretches, (self.D,) + (1,) * (of_stretches.ndim - 1))

    def restart(self, row: int) -> None:
        """Put the joints where the markers saw them; effects with a long memory keep it."""
        s = self.s
        if row == 0:
            self._remember(s.past)
        self._pose(s.motor_angle[:, row], s.joint_angle[:, row])
        velocity = np.broadcast_to(s.joint_velocity, s.joint_angle.shape)[:, row]
        self.qvel[:, self.joint_speeds] = self._rows(velocity)
        if row == 0 and not s.past:
            self._start(s.time[:, 0], s.motor_angle[:, 0], s.motor_velocity[:, 0])
        self._wind(row)
        self.batch.forward()
        self.history.fill()

    def _pose(self, motor_angle: Array, joint_angle: Array) -> None:
        """Hold joints [rad], (B, 9), and the jaw, at rest."""
        self.qpos[...], self.qvel[...] = 0.0, 0.0
        self.qpos[:, self.joints] = self._rows(joint_angle)
        passed = self._rows(joint_angle.sum(axis=1, keepdims=True))
        wound = self.arms.winch_ratio[:, -1:] * self._rows(motor_angle[:, -1:]) - passed
        self.qpos[:, self.jaw] = self.arms.jaw_at_rest(wound)

    def _start(self, time: Array, motor_angle: Array, motor_velocity: Array) -> None:
        now = (self._rows(x) for x in (time[:, None], motor_angle, motor_velocity))
        self.arms.start(*now)

    def _remember(self, past: Past | None) -> None:
        """Let effects feel the measured poses before the stretches."""
        if not past:
            return
        for k in range(past.time.shape[1]):
            time, angle, velocity = (
                past.time[:, k],
                past.motor_angle[:, k],
                past.motor_velocity[:, k],
            )
            self._pose(angle, past.joint_angle[:, k])
            if k == 0:
                self._start(time, angle, velocity)
                continue
            dt = self._rows((time - past.time[:, k - 1])[:, None])
            self.arms.act(self._rows(time[:, None]), self._rows(angle), self._rows(velocity), dt)

    def step_to(self, row: int) -> None:
        """Move the motors from the row before to this one."""
        s, period = self.s, self.s.time[:, row] - self.s.time[:, row - 1]
        n, interval = self.substeps[row - 1], self._rows(period)
        before, after = self._rows(s.motor_angle[:, row - 1]), self._rows(s.motor_angle[:, row])
        self.dt[...] = (interval / n).reshape(self.dt.shape)
        dt, began = (interval / n)[:, None], self._rows(s.time[:, row - 1])[:, None]
        path = _Path(before, after, self._rows(s.motor_velocity[:, row - 1]), n * dt, s.servo_lag)
        for k in range(n):
            angle, velocity = path.at(k * dt)  # MuJoCo's springs pull as at the step's beginning
            if self.arms.acting:
                self.arms.act(began + k * dt, angle, velocity, dt)
            else:
                self.arms.wind(self.arms.slack, angle, angle)
            self.batch.step()
        self._wind(row)
        self.batch.forward()

    def _wind(self, row: int) -> None:
        angle = self._rows(self.s.motor_angle[:, row])
        self.arms.wind(self.arms.slack, angle, angle)

    def read(self, row: int) -> None:
        """Note what sensors say of the present instant."""
        angle, velocity = (
            self._rows(x[:, row]) for x in (self.s.motor_angle, self.s.motor_velocity)
        )
        time = self._rows(self.s.time[:, row])[:, None]
        moment = self.arms.act(time, angle, velocity, 0.0)
        loss = moment.gear_friction * np.tanh(velocity / (STANDING / 3))
        self.marker[:, row], self.tension[:, row] = self.sensors, moment.tension
        self.load[:, row] = (self.arms.horn_torque(moment) + loss) / self.stall
        self.joint[:, row] = self.qpos[:, self.joints]
        self.jaws[:, row] = self.qpos[:, self.jaw[0]]

    def response(self) -> Response:
        """All that was noted, by design."""
        bad = self.batch.warning[..., 1].any(axis=-1).reshape(self.D, self.B).any(axis=1)

        def by_design(noted: Array, *last: int) -> Array:
            values = noted.reshape(self.D, self.B, self.R, *last)
            values[bad] = np.nan
            return values

        return Response(
            marker=by_design(self.marker, N_JOINTS, 3),
            load=by_design(self.load, N_MOTORS),
            joint_angle=by_design(self.joint, N_JOINTS),
            jaw_angle=by_design(self.jaws),
            tension=by_design(self.tension, 2 * N_MOTORS),
            unstable=bad,
        )


class _Path:
    """How motors go from row to row: their old velocity turns into a new one within the servo's lag.

    x(t) = x₀ + v t + (v₀ − v) τ (1 − exp(−t/τ)), the new velocity v being what ends at the measured angle.
    """

    def __init__(self, before: Array, after: Array, old: Array, period: Array, lag: float) -> None:
        self._before, self._lag = before, lag
        taken = lag * (1 - np.exp(-period / lag)) if lag else 0.0
        self._new = (after - before - old * taken) / (period - taken)
        self._change = old - self._new

    def at(self, t: Array) -> tuple[Array, Array]:
        """Angles [rad] and velocities [rad/s] at times [s] since the row before, (n, 1)."""
        if not self._lag:
            return self._before + self._new * t, self._new
        fading = np.exp(-t / self._lag)
        angle = self._before + self._new * t + self._change * self._lag * (1 - fading)
        return angle, self._new + self._change * fading


def gaps(time: Array) -> Array:
    """Rows whose interval to the row before is off the median by more than half, of bool, (R,)."""
    step = np.diff(time, prepend=time[:1])
    if len(time) < 2:
        raise SerpentError("a stretch needs at least two rows.")
    usual = np.median(step[1:])
    return np.r_[False, np.abs(step[1:] - usual) > usual / 2]
