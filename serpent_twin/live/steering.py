"""Steer the arm along a planned path by what an estimator says of its pose."""

import numpy as np

from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arm.geometry import markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.effects.named import MotorLatency
from serpent_twin.hardware.xl430 import VELOCITY_UNIT
from serpent_twin.live.follower import Follower
from serpent_twin.live.path_plan import PathPlan
from serpent_twin.live.reaching import tips
from serpent_twin.recording.loop import Step, StepReading
from serpent_twin.sim.statics import gives_way
from serpent_twin.sim.twin_model import TwinModel

WANTED = ("path_x", "path_y", "path_z")
ESTIMATED = ("tip_x", "tip_y", "tip_z")
COLUMNS = (*WANTED, *ESTIMATED)
"""Columns of a log: desired and estimated position of the gripper's end in the base frame [m]"""
_GAIN, _LATE = 5.0, 0.4
"""What of its angle a motor lacks it turns in a second [1/s], and at most until its answer shows: else it
would swing about it
"""
_MOST = 0.3
"""Furthest that feedback moves a motor from the plan [rad]"""


class PathSteering:
    """The planned motion of the motors, with feedback of the joints' estimated angles.

    A motor turns as in the rehearsal, and is drawn towards its angle there in proportion to what it lacks. If
    motors report late, the rehearsal has the angles that they will report, so each turns earlier by that
    delay. What rounding to the motors' unit of speed takes from a command is added to the next one.

    What the estimate says that the joints lack is turned into motor angles by the inverse stiffness and added
    slowly. An estimate that is the twin's own, with motors that follow, agrees with the rehearsal, so that
    nothing is added.
    """

    def __init__(
        self,
        plan: PathPlan,
        twin: TwinModel,
        follower: Follower,
        feedback: float,
    ) -> None:
        """`feedback` takes up what the joints lack [1/s], 0 for open loop."""
        self.plan, self._follower = plan, follower
        delay = twin.effect_of(MotorLatency).delay
        self._gain, self._feedback = min(_GAIN, _LATE / (plan.period + delay)), feedback
        self._built = twin.built
        self._more = gives_way(twin, plan.joint_angle)
        angle = plan.rehearsal.motor_angle
        speed = np.diff(angle, axis=0, append=angle[-1:]) / plan.period
        self._speed = _ahead(speed, delay / plan.period)
        self._added = np.zeros(angle.shape[1])
        self._before, self._joint = 0.0, plan.joint_angle[0]
        self._asked = np.zeros(angle.shape[1])
        self.most_added = np.zeros(angle.shape[1])
        """Furthest that feedback moved each motor from the plan [rad], (10,)"""
        self.planned = np.zeros(plan.rows, int)
        """The plan's row of each control step, (T,): a loop that is late goes on where the path is by then"""
        self.estimated = np.full((plan.rows, 3), np.nan)
        """Where the gripper's end was estimated to be [m], (T, 3)"""

    @property
    def markers_wanted(self) -> Array:
        """Where the markers were to be in each control step [m], (T, 9, 3)."""
        return markers(self.plan.joint_angle[self.planned], self._built)

    @property
    def tip_wanted(self) -> Array:
        """Where the gripper's end was to be in each control step [m], (T, 3)."""
        return self.plan.tip[self.planned]

    @property
    def rows(self) -> int:
        """Control steps."""
        return self.plan.rows

    def command(self, now: StepReading) -> tuple[Array, Array]:
        """The joints' planned angles, and the velocities to be sent."""
        plan, position = self.plan, now.state.position
        row = self.planned[now.number] = min(round(now.time / plan.period), self.rows - 1)
        wanted = plan.rehearsal.motor_angle[row]
        belief = self._follower.update(now)
        interval, self._before = now.time - self._before, now.time
        if belief is not None:
            self._joint = joints_from_markers(belief.marker, self._joint[None], self._built)[0]
            self.estimated[now.number] = tips(self._joint, self._built)
            lacking = on_stiff_cables(self._more[row] @ (plan.joint_angle[row] - self._joint))
            share = 1 - np.exp(-self._feedback * interval)
            added = self._added + share * (position + lacking - wanted - self._added)
            self._added = np.clip(added, -_MOST, _MOST)
            self.most_added = np.maximum(self.most_added, np.abs(self._added))
        toward = self._gain * (wanted + self._added - position)
        rounded = np.clip(self._asked - now.before, -VELOCITY_UNIT, VELOCITY_UNIT)
        self._asked = self._speed[row] + toward + rounded
        return plan.joint_angle[row], self._asked

    def columns(self, step: Step) -> dict[str, float]:
        """The log's columns of a step."""
        values = [*self.plan.tip[self.planned[step.number]], *self.estimated[step.number]]
        return dict(zip(COLUMNS, map(float, values), strict=True))


def _ahead(rows: Array, count: float) -> Array:
    """Rows, (T, n), that are so many rows later, interpolated; beyond the last one, zero."""
    at = np.arange(len(rows))
    return np.stack([np.interp(at + count, at, each, right=0.0) for each in rows.T], axis=1)
