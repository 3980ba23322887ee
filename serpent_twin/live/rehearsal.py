"""Rehearse a motion on the twin: find how its motors must turn for its joints to go as wanted."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import scipy

from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arm.mjcf import JOINTS
from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import addresses
from serpent_twin.errors import SerpentError
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.response import Response
from serpent_twin.sim.statics import gravity_stiffness, held_by_cables
from serpent_twin.sim.twin_model import TwinModel

Tell = Callable[[float], object]
"""Is given by how much joints miss their angles [rad rms]"""

TIMES = 60
"""Rehearsals at most"""
_SETTLED, _PATIENCE = 0.95, 20
"""Fraction of the rms error at the last progress below which a rehearsal is progress, and rehearsals without
progress that end the learning: while a joint that sticks is not yet moved, learning shows nothing
"""
_SMOOTH, _ROWS = 0.1, 1.5
"""Standard deviation of the smoothing of what is learned [s], and at least so many control steps: what sticks
and slips, or swings faster than motors are told to turn, is not learned
"""
_REST = 2.0
"""Time that the twin hangs before a rehearsal begins [s]"""


@dataclass(frozen=True)
class Rehearsal:
    """A motion of the twin, one row a control step."""

    motor_angle: Array
    """[rad], (T, 10)"""
    response: Response
    """What the twin does, (T,)"""


def rehearsed(
    twin: TwinModel,
    joint_angle: Array,
    period: float,
    prior_runtime: float = 0.0,
    times: int = TIMES,
    tell: Tell = lambda _: None,
) -> Rehearsal:
    """The motors' angles along which a twin's joints go through some [rad], (T, 9), a period apart [s];
    `tell` is called after each rehearsal.

    Iterative learning control: what stretch, slack, friction and gravity keep the joints from in one
    rehearsal is added to the motors' angles at that instant in the next, so that slack is taken up as the
    motion turns round, and that the arm does not swing. Source: Bristow et al., IEEE Control Systems 26
    (2006) 96, with the inverse dynamics as learning function and a low-pass as Q-filter.
    """
    motors, inverse = on_stiff_cables(joint_angle), _InverseDynamics(twin, joint_angle, period)
    best, least, mark, since = None, np.inf, np.inf, 0
    for _ in range(times):
        response = _moved(twin, motors, joint_angle[0], period, prior_runtime)
        short = joint_angle - response.joint_angle
        rms = float(np.sqrt((short**2).mean()))
        if not np.isfinite(rms) and best is None:
            raise SerpentError(
                "the twin's simulation became unstable in the rehearsal of this path. Check the twin with "
                "python -m serpent_twin.trace, and that the path is of this arm."
            )
        tell(rms)
        if rms < least:
            best, least = Rehearsal(motors, response), rms
        mark, since = (rms, 0) if rms < _SETTLED * mark else (mark, since + 1)
        if since == _PATIENCE or not np.isfinite(rms):
            break
        motors = motors + on_stiff_cables(inverse.of(short))
    assert best
    return best


class _InverseDynamics:
    """How the joints' angles on stiff cables m must change for a change q of the joints, from the dynamics of
    joints that hang on springs: C (m - q) = M q̈ + D q̇ + G q. Source: Spong, J. Dyn. Syst. Meas. Control 109
    (1987) 310.
    """

    def __init__(self, twin: TwinModel, joint_angle: Array, period: float) -> None:
        self._period, self._width = period, max(_SMOOTH / period, _ROWS)
        self._cable = held_by_cables(twin)
        self._held = self._cable + gravity_stiffness(joint_angle)
        self._damping, self._inertia = _damping_and_inertia(twin, joint_angle)

    def of(self, change: Array) -> Array:
        """The change of m for a smoothed change of q [rad], (T, 9)."""
        angle, speed, acceleration = (
            scipy.ndimage.gaussian_filter1d(
                change, self._width, axis=0, order=order, mode="nearest"
            )
            / self._period**order
            for order in range(3)
        )
        torque = self._held @ angle[..., None] + self._inertia @ acceleration[..., None]
        torque = torque[..., 0] + self._damping * speed
        return np.linalg.solve(self._cable, torque.T).T


def _damping_and_inertia(twin: TwinModel, joint_angle: Array) -> tuple[Array, Array]:
    """Damping of the joints [N m s/rad], (9,), and their inertia in each pose [kg m²], (T, 9, 9)."""
    model = twin.spec(motors=False).compile()
    data, (place, dof) = mujoco.MjData(model), addresses(model, JOINTS)
    whole = np.zeros((model.nv, model.nv))
    found = np.empty((*joint_angle.shape, len(dof)))
    for n, pose in enumerate(joint_angle):
        data.qpos[place] = pose
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fullM(model, data, whole)
        found[n] = whole[np.ix_(dof, dof)]
    return model.dof_damping[dof], found


def _moved(
    twin: TwinModel, motors: Array, start: Array, period: float, prior_runtime: float
) -> Response:
    """What a twin does, (T,), that hangs with its motors at their first angles before they move."""
    time = np.concatenate([[-_REST], np.arange(len(motors)) * period])
    angle = np.concatenate([motors[:1], motors])
    velocity = np.concatenate([np.zeros((2, motors.shape[1])), np.diff(motors, axis=0) / period])
    trajectory = MotorTrajectory(time[None], angle[None], velocity[None])
    motion = PrescribedMotion(
        trajectory,
        start[None],
        servo_lag=twin.parameters.servo_lag,
        prior_runtime=prior_runtime,
    )
    return impose([twin], motion).each(lambda values: values[0, 0, 1:])
