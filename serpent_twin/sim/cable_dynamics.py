"""Step the arm's cables, gears and hinges."""

from collections.abc import Sequence

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.engine.friction_softness import BRISK, USUAL, softness
from serpent_twin.engine.stepper import Stepper, addresses, in_a_row
from serpent_twin.sim.arm_moment import Moment
from serpent_twin.sim.pushed_statics import StretchedStrands
from serpent_twin.sim.twin_model import TwinModel

_MORE = 1.001
"""Times its own friction from which a hinge rubs more"""
_OF_PARTS = (
    "slack", "stiffness", "joint_friction", "transition_velocity", "gear_friction", "stiffening",
)  # fmt: skip
"""Quantities of an instant that are those of the arm's parts, unless an effect changes them"""
_NOTHING = dict.fromkeys(("reading_age", "marker_shift", "load_shift", "load_scale"), 0.0)
"""Quantities of an instant that are zero, unless an effect changes them"""


class CableDynamics(Stepper[Moment]):
    """Cables, gears and hinges of n runs.

    `motors` says whether the model has the motors' hinges, which wind its strands already;
    else the strands' rest lengths carry what the winches wind.
    """

    def __init__(self, batch: Batch, designs: Sequence[TwinModel], motors: bool) -> None:
        super().__init__(batch, [design.active for design in designs])
        model = batch.model
        self.arm, self._motors = designs[0].arm, motors
        self._joint_q, self._joint_v = map(in_a_row, addresses(model, mjcf.JOINTS))
        self._motor_v = in_a_row(addresses(model, mjcf.MOTORS)[1]) if motors else None
        self._jaw_q, jaw_v = map(in_a_row, addresses(model, ("jaw",)))
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._rest = batch.expand("tendon_lengthspring")
        self._rest_plus, self._rest_minus = (self._rest[:, side::2, 1] for side in (0, 1))
        self._stiffness = batch.expand("tendon_stiffness")
        self._friction = batch.expand("dof_frictionloss")
        self._bend = batch.expand("tendon_stiffnesspoly")  # T = k x + bend x²
        self._applied, self._length = batch.bind("qfrc_applied"), batch.bind("ten_length")
        self._jaw_friction = self._friction[:, jaw_v].copy()
        self.transition_velocity = np.array([d.transition_velocity for d in designs])
        self._soft = tuple(batch.expand(f"dof_{of}") for of in ("solref", "solimp", "invweight0"))
        self.slack, self.stiffness = self._rest[:, :, 1].copy(), self._stiffness.copy()
        bend, stiff = self._bend[:, :, 0], self.stiffness
        self.stiffening = np.divide(bend, stiff, out=np.zeros_like(bend), where=stiff > 0)
        self.joint_friction = self._friction[:, self._joint_v].copy()
        if self._motor_v is None:
            self.gear_friction = np.array([design.gear_friction for design in designs])
        else:
            self.gear_friction = self._friction[:, self._motor_v].copy()
        self.winch_ratio = 1.0 + np.array([d.tolerances.winch_radius for d in designs])
        self.winch_ratio.setflags(write=False)
        self.winch_reach = self.arm.pulley_radii * self.winch_ratio
        self.prior_runtime: Array | float = 0.0
        """Total time of earlier sessions [s], or (n, 1)"""
        self._rubs = b""
        self._age: Array | float = 0.0
        self.marker_shift: Array | float = 0.0
        """Where the last moment had the cameras see the markers besides [m], or (n, 9, 3)"""
        self.load_shift: Array | float = 0.0
        """Shift of the loads as read in the last moment, as a share of the stall torque, or (n, 10)"""
        self.load_scale: Array | float = 0.0
        """Scale error of the loads as read in the last moment, as a share of the loads, or (n, 10)"""

    def moment(
        self, time: Array, motor_angle: Array, motor_velocity: Array, dt: float | Array = 0.0
    ) -> Moment:
        """The present instant without effects, of motors, (n, 10), at times (n, 1)."""
        joints = self._qpos[:, self._joint_q].copy(), self._qvel[:, self._joint_v].copy()
        for each in (jaw := self._qpos[:, self._jaw_q].copy(), *joints):
            each.setflags(write=False)
        return Moment.of(
            arm=self.arm,
            dt=dt,
            time=time,
            motor_angle=motor_angle,
            motor_velocity=motor_velocity,
            joint_angle=joints[0],
            joint_velocity=joints[1],
            jaw_angle=jaw,
            winch_angle=motor_angle.copy(),
            joint_torque=np.zeros((len(motor_angle), N_JOINTS)),
            motor_torque=np.zeros((len(motor_angle), N_MOTORS)),
            **{name: getattr(self, name).copy() for name in _OF_PARTS},
            **_NOTHING,
            winch_ratio=self.winch_ratio,
            prior_runtime=self.prior_runtime,
        )

    def apply(self, moment: Moment) -> None:
        """Write into the batch what the effects have made of an instant."""
        self.wind(moment.slack, moment.winch_angle, moment.motor_angle)
        self._stiffness[...] = moment.stiffness
        self._bend[:, :, 0] = moment.stiffness * moment.stiffening
        self._rub(moment)
        self._applied[:, self._joint_v] = moment.joint_torque
        if self._motor_v is not None:
            self._friction[:, self._motor_v] = moment.gear_friction
            self._applied[:, self._motor_v] = moment.motor_torque
        self._age = moment.reading_age
        self.marker_shift, self.load_shift = moment.marker_shift, moment.load_shift
        self.load_scale = moment.load_scale

    def step(
        self,
        time: Array,
        motor_angle: Array,
        motor_velocity: Array,
        dt: float | Array,
        ids: NDArray[np.intp] | None = None,
        seen: bool = True,
    ) -> None:
        """Let the effects act on the next time step, and take it, of the runs `ids` alone if given.

        Effects on what sensors show act only in steps that are `seen`.
        """
        if self.moving or (self.acting and seen):
            moment = self.moment(time, motor_angle, motor_velocity, dt)
            self.act(moment, seen)
        else:
            self.wind(self.slack, motor_angle, motor_angle)
        self.batch.step(ids=ids)

    def _rub(self, moment: Moment) -> None:
        """Set the hinges' friction to this moment's, where it has changed."""
        wanted = moment.joint_friction.tobytes() + moment.transition_velocity.tobytes()
        if wanted == self._rubs:
            return
        self._rubs = wanted
        reference, impedance, inverse_inertia = self._soft
        friction, v = moment.joint_friction, self._joint_v
        time = np.where(friction > _MORE * self.joint_friction, BRISK, USUAL)
        soft = softness(friction, inverse_inertia[:, v], moment.transition_velocity, time)
        self._friction[:, v] = friction
        reference[:, v, 0] = soft[0]
        impedance[:, v, :2] = soft[1][..., None]

    @property
    def reading_age(self) -> Array:
        """How old the motors' readings are, as the last moment had it [s], (n,)."""
        return np.broadcast_to(self._age, (len(self._qpos), 1))[:, 0]

    def jaw_at_rest(self, wound: Array) -> Array:
        """Angle of the jaw at rest [rad], (n, 1): as near to zero as its friction holds it against its
        cable, which motor and joints wind [rad], (n, 1).
        """
        radius = self.arm.pulley_radius[-1]
        stretch = self.slack[:, -2:] + self._jaw_friction / (radius * self.stiffness[:, -2:])
        high, low = stretch[:, :1] / radius, -stretch[:, 1:] / radius
        return wound - np.clip(wound, np.minimum(low, high), np.maximum(low, high))

    def wind(self, slack: Array, winch_angle: Array, motor_angle: Array) -> None:
        """Shift the strands' rest lengths by what the winches wind outside the model."""
        wound = winch_angle - motor_angle if self._motors else winch_angle
        taken = self.winch_reach * wound
        np.subtract(slack[:, 0::2], taken, out=self._rest_plus)
        np.add(slack[:, 1::2], taken, out=self._rest_minus)

    def strands(self, run: int) -> StretchedStrands:
        """The strands of one run at the present instant."""
        return StretchedStrands(
            self._length[run] - self._rest[run, :, 1],
            self._stiffness[run].copy(),
            self._bend[run, :, 0].copy(),
            self.winch_reach[run],
        )

    def misread(self, torque: Array) -> Array:
        """What the motors report of torques [N m], (…, 10), as the last moment had it."""
        return torque * (1.0 + self.load_scale) + self.load_shift * self.arm.servo.stall_torque

    def horn_torque(self, moment: Moment) -> Array:
        """Torque of cables and effects on each motor's horn, without gearbox friction [N m], (n, 10)."""
        return moment.horn_torque
