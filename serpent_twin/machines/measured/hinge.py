"""Let effects act on runs of a machine whose drive turns one hinge."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.arm.hinge_friction import STICKS
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Instant
from serpent_twin.sim.history import History
from serpent_twin.sim.stepper import Stepper, addresses, set_timestep, side_by_side

HINGE, SENSOR = "joint1", "marker1"
"""The hinge that is driven and rubs, and the sensor of the angle that is measured"""


@dataclass
class HingeMoment(Instant):
    """One time step of n runs; arrays are (n, 1).

    The first block is measured from the runs and cannot be changed. The second is what the machine
    without effects would do; an effect changes it in place or replaces it.
    """

    given: ClassVar[frozenset[str]] = frozenset(
        {"dt", "time", "motor_angle", "motor_velocity", "joint_velocity", "asked_torque"}
    )

    dt: Array
    """[s]"""
    time: Array
    """Since the run began [s]"""
    motor_angle: Array
    """What drives the machine [rad]"""
    motor_velocity: Array
    """[rad/s]"""
    joint_velocity: Array
    """Of the hinge [rad/s]"""
    asked_torque: Array
    """Torque of the load on the hinge [N m]"""

    winch_angle: Array
    """Angle that winds the machine's first cable [rad]; the drive's angle, unless the drive has play"""
    drive_torque: Array
    """Torque of the drive [N m]"""
    gear_friction: Array
    """Coulomb friction of the hinge [N m]"""

    @property
    def horn_torque(self) -> Array:
        """Torque that the gears or cables carry: the mean of what enters and what leaves [N m]."""
        return (self.drive_torque + self.asked_torque) / 2


class AngleMoment(HingeMoment):
    """A moment of a machine whose drive follows its logged angle, whatever torque that takes."""

    given = HingeMoment.given | {"drive_torque"}


class TorqueMoment(HingeMoment):
    """A moment of a machine whose drive turns the hinge itself, by a torque: there is no cable to wind."""

    given = HingeMoment.given | {"winch_angle"}


class Turns(Stepper[HingeMoment]):
    """Runs side by side, run i of models[i] with effects[i]."""

    moment_of: ClassVar[type[HingeMoment]] = HingeMoment
    """What effects may change"""

    def __init__(
        self, models: Sequence[mujoco.MjModel], several: Sequence[Sequence[Effect]], timestep: Array
    ) -> None:
        super().__init__(side_by_side(models, 1), several)
        self.dt = timestep.reshape(-1, 1)
        set_timestep(self.batch, timestep)
        self.qpos, self.qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        self.ctrl, self.applied = self.batch.bind("ctrl"), self.batch.bind("qfrc_applied")
        self.sensors = self.batch.bind("sensordata")
        _, dof = addresses(models[0], (HINGE,))
        seen = models[0].sensor(SENSOR)
        self._seen = int(models[0].jnt_qposadr[models[0].sensor_objid[seen.id]])
        self._delayed = bool(models[0].sensor_history[seen.id, 0])
        self.dof = int(dof[0])
        self._friction = self.batch.expand("dof_frictionloss")
        self._base = self._friction[:, [self.dof]].copy()

    def moment(
        self, time: Array, angle: Array, velocity: Array, asked: Array, drive: Array
    ) -> HingeMoment:
        """The present instant without effects, of drives' angles and torques (n, 1)."""
        return self.moment_of(
            dt=self.dt,
            time=time,
            motor_angle=angle,
            motor_velocity=velocity,
            joint_velocity=self.qvel[:, [self.dof]],
            asked_torque=asked,
            winch_angle=angle.copy(),
            drive_torque=drive.copy(),
            gear_friction=self._base.copy(),
        )

    def start(self, moment: HingeMoment) -> None:
        """Begin, and fill delayed sensors with the present reading."""
        self.begin(moment)
        self.batch.forward()
        History(self.batch).fill()
        self.batch.forward()

    def read(self) -> Array:
        """The angle that is measured now [rad], (n,): after a step, sensors are one step old."""
        if not self._delayed:
            return self.qpos[:, self._seen].copy()
        self.batch.forward()
        return self.sensors[:, 0].copy()

    def apply(self, moment: HingeMoment) -> None:
        """Set the hinge's friction."""
        self._friction[:, [self.dof]] = moment.gear_friction


def stick(joint: mujoco.MjsJoint) -> None:
    """Let a hinge's dry friction hold it still."""
    joint.solimp_friction[:2] = STICKS
