"""Plan how the arm follows a path, and say before anything moves what it cannot do."""

from dataclasses import dataclass

import numpy as np
import scipy

from serpent_twin.arm.geometry import ARM, Arm, joint_from_motor
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.limits import Limits
from serpent_twin.live.path import PathToFollow
from serpent_twin.live.reaching import NEAR, JointBounds, all_reached, reached, tips
from serpent_twin.live.rehearsal import TIMES, Rehearsal, Tell, rehearsed
from serpent_twin.sim.twin_model import TwinModel

APPROACH = 0.15
"""Greatest speed of a joint on the way to a path's first point [rad/s]"""
_WAIT = 1.5
"""Time that the arm waits at the path's first point [s]"""
_KNOTS = 0.1
"""Between poses that are sought along a path, at most [s]; those between are interpolated"""
_SHARE = 0.9
"""Fraction of a limit that a plan may use"""
_FEW, _MARGIN = 4, 0.05
"""Rehearsals that show how far motors must turn, to within so much [rad]"""
_EASED, _EASE = 6, 1.2
"""How often other poses are sought at most, and by how many times the excess joints are then turned less"""
_FAR = 10e-3
"""Largest rms distance of a rehearsed tip from its path [m]"""
_SLACK = 0.02
"""Below which a cable's strands both count as slack [N]"""


@dataclass(frozen=True)
class PathPlan:
    """How the arm follows a path, one row a control step: the way there, a rest, and the path."""

    period: float
    """[s]"""
    begins: int
    """Row with which the path begins"""
    tip: Array
    """Where the gripper's end is to be in the base frame [m], (T, 3)"""
    joint_angle: Array
    """[rad], (T, 9)"""
    rehearsal: Rehearsal
    """How the twin does this"""
    arm: Arm = ARM
    """The twin's geometry"""

    @property
    def rows(self) -> int:
        """Control steps."""
        return len(self.tip)

    def time(self, row: int | np.intp) -> float:
        """The time of a row on the path [s]; negative on the way to its first point."""
        return float(row - self.begins) * self.period

    @property
    def short(self) -> Array:
        """How far the twin's tip is from its point in the rehearsal [m], (T,)."""
        did = tips(self.rehearsal.response.joint_angle, self.arm)
        return np.linalg.norm(did - self.tip, axis=1)


def planned(
    path: PathToFollow,
    twin: TwinModel,
    rate_hz: float,
    bounds: JointBounds,
    limits: Limits,
    prior_runtime: float = 0.0,
    tell: Tell = lambda _: None,
) -> PathPlan:
    """How the arm of a twin follows a path, from where it hangs straight; raises a `SerpentError` that says
    where and why it cannot.

    Of the poses that put the tip on the path, those are taken for which no motor has to turn a joint further
    than it may. `tell` is called after each rehearsal.
    """
    period = 1 / rate_hz
    time = np.arange(int(np.floor(path.duration / period + 1e-9)) + 1) * period
    if len(time) < 2:
        raise SerpentError(
            f"{path.file}: the path lasts {path.duration:.3g} s, less than a control step of {period:.3g} s. "
            "Give it more time, or raise --rate-hz."
        )
    along, closer = _poses(path, time, bounds, twin.built), bounds
    _refuse_fast(path, np.cumsum(along, axis=1), 0, period, limits)

    def rehearsed_in(times: int) -> PathPlan:
        return _rehearsed(path, period, along, twin, prior_runtime, times, tell)

    for _ in range(_EASED if path.of_tip else 0):
        tried = rehearsed_in(_FEW)
        if not (excess := _excess(tried, limits)).any():
            break
        closer = _eased(closer, tried, excess)
        found, short = _reached(path, time, closer, twin.built)
        if (short > NEAR).any():
            break
        along = found
    plan = rehearsed_in(TIMES)
    _refuse_fast(path, plan.rehearsal.motor_angle, plan.begins, period, limits)
    _refuse_load(path, plan, limits)
    _refuse_unmet(path, plan)
    return plan


def _rehearsed(
    path: PathToFollow,
    period: float,
    along: Array,
    twin: TwinModel,
    prior_runtime: float,
    times: int,
    tell: Tell,
) -> PathPlan:
    """The plan that leads along some poses, (T, 9), rehearsed so many times at most."""
    there, arm = _way_there(along[0], period), twin.built
    joint_angle = np.concatenate([there, along])
    wanted = path.at(np.arange(len(along)) * period) if path.of_tip else tips(along, arm)
    rehearsal = rehearsed(twin, joint_angle, period, prior_runtime, times, tell)
    tip = np.concatenate([tips(there, arm), wanted])
    return PathPlan(period, len(there), tip, joint_angle, rehearsal, arm)


def _poses(path: PathToFollow, time: Array, bounds: JointBounds, arm: Arm) -> Array:
    """Joint angles along a path at some times, (T, 9)."""
    if not path.of_tip:
        _refuse_beyond(path, bounds)
        return path.at(time)
    found, short = _reached(path, time, bounds, arm)
    if (short > NEAR).any():
        first = int(np.argmax(short > NEAR))
        _refuse_unreached(path, path.duration * first / (len(short) - 1), bounds, arm)
    return found


def _reached(path: PathToFollow, time: Array, bounds: JointBounds, arm: Arm) -> tuple[Array, Array]:
    """Joint angles along a tip's path at some times, (T, 9), and how far off the tip is at poses between
    which they are interpolated [m].
    """
    count = max(2, int(np.ceil(path.duration / _KNOTS)) + 1)
    knots = np.linspace(0.0, path.duration, count)  # whatever the rate, the poses are the same
    found, short = all_reached(path.at(knots), bounds, arm)
    return scipy.interpolate.CubicSpline(knots, found)(time), short


def _excess(plan: PathPlan, limits: Limits) -> Array:
    """Angles by which motors would turn joints further than they may, on stiff cables [rad], (T, 9)."""
    turned = joint_from_motor(plan.rehearsal.motor_angle[:, :-1])
    most = _SHARE * limits.joint_angle - _MARGIN
    return turned - np.clip(turned, -most, most)


def _eased(bounds: JointBounds, plan: PathPlan, excess: Array) -> JointBounds:
    """Bounds nearer to where no joint is turned, by what motors would turn joints too far."""
    eased = plan.joint_angle - _EASE * excess
    most = np.where(excess > 0, eased, np.inf).min(axis=0)
    least = np.where(excess < 0, eased, -np.inf).max(axis=0)
    low, high = np.maximum(bounds.low, least), np.minimum(bounds.high, most)
    return JointBounds(np.minimum(low, high), np.maximum(low, high))


def _way_there(pose: Array, period: float) -> Array:
    """Joint angles from the straight arm to a pose, along which no joint is faster than `APPROACH`, and a
    rest, (T, 9); the path of least jerk (Flash and Hogan, J. Neurosci. 5 (1985) 1688).
    """
    fastest = 15 / 8  # of such a path to its mean speed
    rows = int(np.ceil(fastest * np.abs(pose).max() / APPROACH / period)) + 1
    u = np.linspace(0.0, 1.0, rows + 1)[:, None]
    share = u**3 * (10 - 15 * u + 6 * u**2)
    rest = int(np.ceil(_WAIT / period))
    return np.concatenate([share * pose, np.repeat(pose[None], rest, axis=0)])


def _refuse_unreached(path: PathToFollow, time: float, bounds: JointBounds, arm: Arm) -> None:
    point = path.at(np.array([time]))[0]
    near = tips(reached(point, bounds, arm), arm)
    far = 1e3 * np.linalg.norm(near - point)
    raise SerpentError(
        f"{path.file}: at {time:.2f} s the path is at {_mm(point)} mm, and the gripper's end comes no "
        f"nearer than {far:.1f} mm, at {_mm(near)} mm, while each joint stays within its bounds. "
        "Move the path, or give the joints more room: --wider."
    )


def _refuse_beyond(path: PathToFollow, bounds: JointBounds) -> None:
    beyond = np.argwhere((path.points < bounds.low - 1e-9) | (path.points > bounds.high + 1e-9))
    if len(beyond):
        n, j = beyond[0]
        raise SerpentError(
            f"{path.file}, line {n + 2}: joint {j + 1} is to be at {path.points[n, j]:.3f} rad; its bounds "
            f"are {bounds.low[j]:.3f} and {bounds.high[j]:.3f} rad. Move it within, or give it more room: "
            "--wider."
        )


def _refuse_fast(
    path: PathToFollow, motors: Array, begins: int, period: float, limits: Limits
) -> None:
    """Refuse a path on which a motor would turn faster than it may, by the motors' angles, (T, M)."""
    speed = np.abs(np.diff(motors, axis=0)) / period
    most = _SHARE * limits.velocity
    if speed.max() > most:
        row, motor = np.unravel_index(int(speed.argmax()), speed.shape)
        raise SerpentError(
            f"{path.file}: {_when((row - begins) * period)} motor {motor + 1} would have to turn at "
            f"{speed.max():.2f} rad/s, and {most:.2f} rad/s is what it may. Near a singular pose a small way "
            f"of the tip takes large turns: move the path, or give it {speed.max() / most:.1f} times the "
            "time."
        )


def _refuse_load(path: PathToFollow, plan: PathPlan, limits: Limits) -> None:
    """Refuse what the rehearsal shows that the arm cannot do."""
    response, motors = plan.rehearsal.response, plan.rehearsal.motor_angle
    load, most = np.abs(response.load), _SHARE * limits.load
    if load.max() > most:
        row, motor = np.unravel_index(int(load.argmax()), load.shape)
        raise SerpentError(
            f"{path.file}: {_when(plan.time(row))} motor {motor + 1} would hold {100 * load.max():.0f} % of "
            f"its stall torque, and {100 * most:.0f} % is what it may. Move the path to where the arm hangs "
            "lower."
        )
    turned, most = np.abs(joint_from_motor(motors[:, :-1])), _SHARE * limits.joint_angle
    if turned.max() > most:
        row, joint = np.unravel_index(int(turned.argmax()), turned.shape)
        raise SerpentError(
            f"{path.file}: {_when(plan.time(row))} the motors would have to turn joint {joint + 1} by "
            f"{turned.max():.2f} rad on stiff cables, since the real ones stretch, and {most:.2f} rad is "
            f"what they may: at {limits.joint_angle:.2f} rad the arm is stopped. Move the path to where the "
            "arm hangs lower, or raise joint_angle_deg in the limits of its setup, arm.toml."
        )


def _refuse_unmet(path: PathToFollow, plan: PathPlan) -> None:
    """Refuse a path that the twin does not follow, however its motors turn."""
    rms = float(np.sqrt((plan.short[plan.begins :] ** 2).mean()))
    if rms > _FAR:
        row = plan.begins + int(plan.short[plan.begins :].argmax())
        raise SerpentError(
            f"{path.file}: however its motors turn, the twin's tip stays {1e3 * rms:.0f} mm from the path, "
            f"and {1e3 * plan.short[row]:.0f} mm at {plan.time(row):.2f} s: its cables "
            "are too soft or too slack for this path. Move it to where the arm hangs lower, or go slower."
        )


def slack_cables(plan: PathPlan) -> list[int]:
    """Cables, from 1, of which no strand pulls on the whole path: what they hold cannot be driven."""
    tension = plan.rehearsal.response.tension[plan.begins :, :-2]
    pulls = (tension > _SLACK).any(axis=0).reshape(-1, 2).any(axis=1)
    return [int(j) + 1 for j in np.flatnonzero(~pulls)]


def _when(time: float) -> str:
    return f"at {time:.2f} s" if time >= 0 else f"{-time:.2f} s before the path begins,"


def _mm(point: Array) -> str:
    return f"({', '.join(f'{1e3 * each:.0f}' for each in point)})"
