"""Estimate the pose by a twin whose motors move as measured."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, joint_from_motor, markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers, marker_jacobian
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.bus_reading import BusReading, readings
from serpent_twin.estimators.coloured_noise import ColouredNoise, coloured_part
from serpent_twin.estimators.estimator import Live, TrainedEstimator
from serpent_twin.readouts import Progress
from serpent_twin.readouts.covariance import covariance_of
from serpent_twin.readouts.saved import Wanted, covariances, divisors, numbers
from serpent_twin.readouts.windows import SessionWindows, Windows
from serpent_twin.sim import twin_model
from serpent_twin.sim.many_twins import TIMESTEP, coarse_step
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import STANDING, DrivenArms, servo_lag
from serpent_twin.sim.response import Response

SETTLE = 2.0
"""Seconds that the twin hangs before the first reading"""
TRUST = 40.0
"""Seconds over which the loads' error sets the inflation of the covariance"""
TURNING = 2 * STANDING
"""[rad/s] faster than this, gear friction has one sign and a load is informative"""
STILL = 1e-3
"""[rad/s] slower than this, a motor stands; in between, the error of its load is learned from logs"""
_WHITE = {"load_coloured": np.zeros((N_MOTORS, N_MOTORS)), "load_correlation_time": np.array(1.0)}
"""What is learned of errors that are white"""


@dataclass
class Observer(TrainedEstimator):
    """Ours: the twin, driven by the motors' angles from the session's first row on; no markers.

    Training estimates its covariance: the joint angles' error over the validation sessions, propagated
    through the arm's pose, and the markers' residual error. While loads differ from the twin's more than
    they did then, the stated spread grows in proportion.
    """

    name: ClassVar[str] = "observer"
    about: ClassVar[str] = "ours: the twin driven by the motors' angles"

    twin: Mapping[str, Any] = field(
        default_factory=lambda: twin_model.to_dict(twin_model.NOMINAL_TWIN)
    )
    """The twin model, as twin.json holds it; the nominal one by default"""

    def __post_init__(self) -> None:
        self.twin = twin_model.to_dict(twin_model.from_dict(self.twin))

    @classmethod
    def of(cls, arm: twin_model.TwinModel) -> Self:
        """The observer of a twin that no log has trained: it states no covariance."""
        made = cls(twin=twin_model.to_dict(arm))
        unknown = np.full((N_JOINTS, 3, 3), np.nan)
        made.learned = {
            "servo_lag": np.array(arm.parameters.servo_lag),
            "joint": np.full((N_JOINTS, N_JOINTS), np.nan),
            "rest": unknown,
            "load": np.full(N_MOTORS, np.inf),
            "load_slow": np.full(N_MOTORS, np.inf),
            "covariance": unknown,
        } | _WHITE
        return made

    def wanted(self) -> Wanted:
        """The servos' lag [s], covariances of joints [rad²] and markers [m²], the loads' rms error, that
        of motors that turn slowly, and the part of errors that lasts: its covariance over the motors, and its
        correlation time [s].

        A marker that no validation session shows has no `scale`.
        """
        return {
            "servo_lag": numbers(low=0.0),
            "joint": covariances(size=N_JOINTS),
            "rest": covariances(N_JOINTS),
            "load": divisors(N_MOTORS),
            "load_slow": divisors(N_MOTORS),
            "load_coloured": covariances(size=N_MOTORS),
            "load_correlation_time": numbers(low=0.0),
            "covariance": covariances(N_JOINTS),
            "scale": numbers(N_JOINTS, 1, 1, low=0.0, unknown=True),
        }

    def follow(self, session: SessionWindows) -> Belief:
        """Markers of all windows of a session, with their covariance."""
        if not self.learned:
            raise SerpentError(
                f"the readout {self.name} has not been fitted; call fit or load first."
            )
        return super().follow(session)

    def live(self, prior_runtime: float = 0.0) -> "LiveObserver":
        """An estimator for one session of an arm after `prior_runtime` in earlier sessions [s]."""
        return LiveObserver(self, prior_runtime)

    def require_rate(self, rate_hz: float) -> None:
        """Accept rows of any rate: the twin is simulated from each to the next, however long that takes."""

    @property
    def takes_twin(self) -> bool:
        """True: another twin can replace the observer's."""
        return True

    def with_twin(self, arm: twin_model.TwinModel) -> Self:
        """Copy the observer with another twin; its covariance stays that of training with its own."""
        return self.with_settings(twin=twin_model.to_dict(arm))

    @cached_property
    def arm(self) -> twin_model.TwinModel:
        """The twin model."""
        return twin_model.from_dict(self.twin)

    @property
    def gear_friction(self) -> Array:
        """Friction of the twin's gears, as fractions of the stall torque, (10,)."""
        return self.arm.gear_friction / self.arm.arm.servo.stall_torque

    @property
    def coloured_noise(self) -> ColouredNoise:
        """The part of the loads' errors that lasts from row to row."""
        covariance, time = (self.learned[name] for name in _WHITE)
        return ColouredNoise.of(covariance, float(time))

    @property
    def own_twin(self) -> twin_model.TwinModel:
        """The twin model."""
        return self.arm

    def _run(self, session: SessionWindows) -> Iterator[tuple[Response, Belief]]:
        """Readings and estimates of the twin in the session's windows."""
        live, first = self.live(session.log.prior_runtime), len(session.log.time) - len(session)
        for k, now in enumerate(readings(session.log)):
            belief = live.update(now)
            if k >= first:
                yield live.sensed, belief

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        lag = servo_lag(
            [(s.log.time, s.log.motor_position, s.log.motor_velocity) for s in train.sessions]
        )
        self.learned = {
            **self.learned,
            "servo_lag": np.array(lag),
            "joint": np.zeros((N_JOINTS, N_JOINTS)),
            "rest": np.tile(np.eye(3), (N_JOINTS, 1, 1)),
            "load": self.learned.get("load", np.full(N_MOTORS, np.inf)),
        }
        seen = []
        for done, session in enumerate(validate.sessions, 1):
            seen.append(self._compared(session))
            progress(done, len(validate.sessions), np.nan)
        turning = [each[3] for each in seen]
        at, joint, rest, load, slow, error = map(np.concatenate, zip(*seen, strict=True))
        known = joint[np.isfinite(joint).all(axis=1)]
        self.learned |= {
            "joint": known.T @ known / max(1, len(known)),
            "rest": covariance_of(rest),
            "load": _root_mean(load, np.full(N_MOTORS, 1e-3)),  # for a motor that never turned
            "load_slow": _root_mean(slow, self.gear_friction),
            "covariance": covariance_of(error),
        }
        period = np.median([np.median(np.diff(s.log.time)) for s in validate.sessions])
        coloured = coloured_part(turning, self.learned["load"], float(period))
        self.learned |= dict(zip(_WHITE, map(np.asarray, coloured), strict=True))
        # Errors need not be normal: each marker's ellipsoids are scaled to hold it as often as stated.
        scale = Belief(np.zeros_like(error), self.seen_from(at)).scale_to(error)
        self.learned["scale"] = scale[:, None, None]

    def seen_from(self, joint_angle: Array, doubt: float = 1.0) -> Array:
        """Covariance of the markers in poses [rad], (N, 9), while joints err by `doubt` times the variance
        of the validation sessions; (N, 9, 3, 3).
        """
        slope = marker_jacobian(joint_angle, self.arm.built)[1]
        each = slope.reshape(-1, N_JOINTS, 3, N_JOINTS)
        of_joints = each @ self.learned["joint"] @ np.swapaxes(each, -1, -2)
        return self.learned.get("scale", 1.0) * (doubt * of_joints + self.learned["rest"])

    def _rms_mm(self) -> float:
        """Error of a marker on the validation sessions [mm]."""
        square = np.trace(self.learned["covariance"], axis1=-2, axis2=-1)
        return 1e3 * float(np.sqrt(square.mean()))

    def _compared(self, session: SessionWindows) -> tuple[Array, ...]:
        """Joint angles; their errors, the markers' beside, those of loads of turning motors and of slow ones,
        the markers'.
        """
        rows = [sensed for sensed, _ in self._run(session)]
        at = np.concatenate([row.joint_angle for row in rows])
        moved = np.concatenate([row.marker for row in rows])
        speed = np.abs(session.log.motor_velocity[-len(rows) :])
        turns, slow = speed > TURNING, (speed > STILL) & (speed <= TURNING)
        load = session.log.motor_load[-len(rows) :] - np.concatenate([row.load for row in rows])
        angle = joints_from_markers(session.marker, at, self.arm.built)
        angle[~np.isfinite(session.marker).all(axis=(1, 2))] = np.nan
        rest = session.marker - markers(angle, self.arm.built)
        turning, slowly = (np.where(each, load, np.nan) for each in (turns, slow))
        return at, angle - at, rest, turning, slowly, session.marker - moved

    def _spread(self, validate: Windows) -> Array:
        return self.learned["covariance"]


def _root_mean(errors: Array, one: Array) -> Array:
    """Root mean square of errors, (T, 10), NaN where not known, and of one more, (10,)."""
    return np.sqrt(np.nanmean(np.vstack([errors, one]) ** 2, axis=0))


class LiveObserver(Live):
    """The twin of one session, a row at a time."""

    def __init__(
        self,
        observer: Observer,
        prior_runtime: float = 0.0,
        members: Sequence[twin_model.TwinModel] = (),
    ) -> None:
        members = members or (observer.arm,)
        models = {id(arm): arm.spec(motors=False).compile() for arm in members}
        coarse = coarse_step(list(members))
        self._timestep = (
            coarse if coarse >= 2 * TIMESTEP else TIMESTEP
        )  # else off by more than 0.15 mm
        for model in models.values():
            model.opt.timestep = self._timestep
        lag = float(observer.learned["servo_lag"])
        self.arms = DrivenArms(members, [models[id(arm)] for arm in members], lag)
        self.arms.prior_runtime = np.full(len(members), prior_runtime)
        self._count, self._observer, self._time = len(members), observer, np.nan
        self._doubt = 1.0  # squared, of the loads' errors over those in training

    def update(self, now: BusReading) -> Belief:
        """The markers now."""
        self.step(now)
        return self.belief(now)

    def step(self, now: BusReading) -> None:
        """Simulate the twin to this reading; at the first one, it starts at the pose of stiff cables."""
        position, velocity = (np.tile(x, (self._count, 1)) for x in (now.position, now.velocity))
        to = MotorTrajectory(np.full(self._count, now.time), position, velocity)
        interval = now.time - self._time
        if np.isnan(interval):
            before = MotorTrajectory(to.time - SETTLE, position, np.zeros_like(velocity))
            self.arms.place(before, joint_from_motor(position[:, :N_JOINTS]))
            interval = SETTLE
        if interval <= 0:
            raise SerpentError(
                f"a reading at {now.time:g} s came after one at {self._time:g} s; give them in order."
            )
        self.arms.move(to, max(1, round(interval / self._timestep)))
        if self.arms.unstable.any():
            raise SerpentError(
                f"the twin's simulation became unstable at {now.time:g} s. Check the motors' angles, and "
                "the twin with python -m serpent_twin.trace."
            )
        self._interval, self._time = interval, now.time
        self.members = self.arms.read()

    @property
    def sensed(self) -> Response:
        """The mean of the members' readings, (1,)."""
        return self.members.each(lambda values: values.mean(axis=0, keepdims=True))

    def belief(self, now: BusReading) -> Belief:
        """The twin's estimate of the markers; its covariance grows as loads differ from the twin's."""
        sensed = self.sensed
        error = (now.load - sensed.load[0]) / self._observer.learned["load"]
        turning = np.abs(now.velocity) > TURNING
        if turning.any():
            fade = np.exp(-self._interval / TRUST)
            self._doubt = fade * self._doubt + (1 - fade) * float((error[turning] ** 2).mean())
        doubt = max(1.0, self._doubt)
        covariance = self._observer.seen_from(sensed.joint_angle, doubt)
        return Belief(sensed.marker, covariance)
