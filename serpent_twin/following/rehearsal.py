"""Rehearse a motion on the twin: find how its motors must turn for its joints to go as wanted."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.response import Response
from serpent_twin.sim.statics import gives_way
from serpent_twin.sim.twin_model import TwinModel

TIMES = 30
"""Rehearsals at most"""
_SETTLED, _PATIENCE = 0.95, 4
"""So many that leave more than this part of what the best before left are the last: while a joint that sticks
is not yet moved, learning shows nothing
"""
_SMOOTH = 0.375
"""Standard deviation of the smoothing of what is learned [s], so that what sticks and slips is not learned"""
_REST = 2.0
"""For which the twin hangs before a rehearsal begins [s]"""


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
) -> Rehearsal:
    """The motors' angles along which a twin's joints go through some [rad], (T, 9), a period apart [s].

    Iterative learning control: what stretch, slack, friction and gravity keep the joints from in one
    rehearsal is added to the motors' angles at that instant in the next, so that slack is taken up as the
    motion turns round. Source: Bristow et al., IEEE Control Systems 26 (2006) 96, with the inverse stiffness
    as learning function and a low-pass as Q-filter.
    """
    motors, more = on_stiff_cables(joint_angle), gives_way(twin, joint_angle)
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
        if rms < least:
            best, least = Rehearsal(motors, response), rms
        mark, since = (rms, 0) if rms < _SETTLED * mark else (mark, since + 1)
        if since == _PATIENCE or not np.isfinite(rms):
            break
        learned = gaussian_filter1d(
            (more @ short[..., None])[..., 0], _SMOOTH / period, axis=0, mode="nearest"
        )
        motors = motors + on_stiff_cables(learned)
    assert best
    return best


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
