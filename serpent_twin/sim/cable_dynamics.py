"""Let effects act on runs that step side by side: cables, gears and hinges before every time step."""

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import mujoco.batch
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin import effects
from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arm.hinge_friction import softness
from serpent_twin.arrays import Array
from serpent_twin.effects import Moment
from serpent_twin.errors import SerpentError
from serpent_twin.sim.twin_model import TwinModel

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_UNEQUAL = (
    "runs side by side need models of one structure, which some effects change: give what is absent "
    "in some of the runs a tiny strength, or run those apart."
)


def structure(model: mujoco.MjModel) -> tuple[object, ...]:
    """The sizes of state and fields, which models that step side by side must share."""
    shapes = [np.shape(_field(model, name)) for name in mujoco.batch.MODEL_FIELDS]
    return mujoco.mj_stateSize(model, _STATE), *shapes


def _field(model: mujoco.MjModel, name: str) -> Array:
    owner, _, field = name.rpartition(".")
    return getattr(model.opt if owner == "opt" else model, field)


def side_by_side(models: Sequence[mujoco.MjModel], nthread: int) -> Batch:
    """A batch whose run i is of models[i]; all must be of one structure."""
    distinct = {id(model): model for model in models}
    for model in distinct.values():
        # An unstable run that resets itself would warn in every step.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    batch = Batch(models[0], len(models), nthread)
    if len({structure(model) for model in distinct.values()}) > 1:
        raise SerpentError(_UNEQUAL)
    for name in mujoco.batch.MODEL_FIELDS:
        of = {n: _field(model, name) for n, model in distinct.items()}
        first, *others = of.values()
        if any(not np.array_equal(value, first) for value in others):
            values = np.array([of[id(model)] for model in models])
            batch.expand(name)[...] = values.reshape(len(models), *np.shape(first))
    return batch


_DERIVED = (
    "dof_invweight0",
    "tendon_invweight0",
    "body_invweight0",
    "dof_M0",
    "dof_length",
    "dof_solref",
    "dof_solimp",
)
"""MuJoCo's scale of constraints, and the softening of hinge friction that follows from it"""


_VARIED = ("body_mass", "body_subtreemass", "body_ipos", "body_inertia", "opt.gravity")


class Variation:
    """Models of a batch as a first one, and by how much K further ones differ from it.

    Masses on the bodies' long axes and gravity only; raises a `SerpentError` if anything else does.
    """

    def __init__(self, batch: Batch, models: Sequence[mujoco.MjModel]) -> None:
        self._own: dict[str, Array] = {}
        self._linear: dict[str, tuple[Array, Array]] = {}
        of_all = [_moments(model) for model in models]
        for name in mujoco.batch.MODEL_FIELDS:
            all_of = np.array([_field(model, name) for model in models])
            if name in _DERIVED or not (all_of != all_of[0]).any():
                continue
            if name not in _VARIED:
                raise SerpentError(
                    f"models that differ in {name} cannot be varied while they run, only masses and gravity."
                )
            first, *others = (each[name] for each in of_all)
            self._own[name], self._linear[name] = batch.expand(name), (first, others - first)

    def set(self, share: Array) -> None:
        """Give every run the first model plus shares of the others' differences, (n, K)."""
        now = {
            name: first + np.tensordot(share, change, 1)
            for name, (first, change) in self._linear.items()
        }
        if "body_ipos" in now:
            mass = np.maximum(now["body_mass"], 1e-12)[..., None]
            now["body_ipos"] = now["body_ipos"] / mass
            now["body_inertia"] = now["body_inertia"] - mass * _across(now["body_ipos"])
        for name, own in self._own.items():
            own[...] = now[name].reshape(np.shape(own))


def _moments(model: mujoco.MjModel) -> dict[str, Array]:
    """The fields that may vary, as what is linear in a mass: instead of centres and inertias, the first
    moments [kg m] and the inertias about the bodies' own origins [kg m²].
    """
    mass, centre = model.body_mass[:, None], model.body_ipos
    return {name: _field(model, name) for name in _VARIED} | {
        "body_ipos": mass * centre,
        "body_inertia": model.body_inertia + mass * _across(centre),
    }


def _across(place: Array) -> Array:
    """Squared distances of places on an axis from the frame's axes, (…, 3)."""
    return (place**2).sum(axis=-1, keepdims=True) - place**2


def set_timestep(batch: Batch, timestep: Array) -> None:
    """Let each run take its own time steps [s], (n,) or (n, 1)."""
    own = batch.expand("opt.timestep")
    own[...] = timestep.reshape(np.shape(own))


def addresses(
    model: mujoco.MjModel, names: Sequence[str]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Addresses of joints of these names in qpos and in qvel."""
    joints = [model.joint(name) for name in names]
    return (
        np.array([int(j.qposadr[0]) for j in joints], np.intp),
        np.array([int(j.dofadr[0]) for j in joints], np.intp),
    )


class CableDynamics:
    """Cables, gears and hinges of n runs, on which their effects act before every time step.

    `motors` says whether the model has the motors' hinges, which wind its strands already;
    else the strands' rest lengths carry what the winches wind.
    """

    def __init__(self, batch: Batch, designs: Sequence[TwinModel], motors: bool) -> None:
        model = batch.model
        self.batch, self.arm, self._motors = batch, designs[0].arm, motors
        self._joint_q, self._joint_v = addresses(model, mjcf.JOINTS)
        self._motor_v = addresses(model, mjcf.MOTORS)[1] if motors else None
        self._jaw_q, jaw_v = addresses(model, ("jaw",))
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._effects = effects.stacked([design.active for design in designs])
        self.acting = bool(self._effects)
        self._rest = batch.expand("tendon_lengthspring")
        self._stiffness = batch.expand("tendon_stiffness")
        self._friction = batch.expand("dof_frictionloss")
        self._bend = batch.expand("tendon_stiffnesspoly")  # T = k x + bend x²
        self._applied = batch.bind("qfrc_applied")
        self._jaw_friction = self._friction[:, jaw_v].copy()
        self.transition_velocity = np.array([d.transition_velocity for d in designs])
        self._soft = tuple(batch.expand(f"dof_{of}") for of in ("solref", "solimp", "invweight0"))
        self.slack, self.stiffness = self._rest[:, :, 1].copy(), self._stiffness.copy()
        bend, stiff = self._bend[:, :, 0], self.stiffness
        self.stiffening = np.divide(bend, stiff, out=np.zeros_like(bend), where=stiff > 0)
        self.joint_friction = self._friction[:, self._joint_v].copy()
        if self._motor_v is None:
            self.gear_friction = _per_motor(designs)
        else:
            self.gear_friction = self._friction[:, self._motor_v].copy()
        self.winch_ratio = 1.0 + np.array([d.tolerances.winch_radius for d in designs])
        self.winch_ratio.setflags(write=False)
        self.winch_reach = self.arm.pulley_radii * self.winch_ratio
        self.prior_runtime: Array | float = 0.0
        """Total time of earlier sessions [s], or (n, 1)"""
        self._rubs: tuple[Array, ...] = (np.empty(0), np.empty(0))
        self._memory: list[Any] = []
        self.reading_age = np.zeros(len(designs))
        """How old the motors' readings are, as the last moment had it [s], (n,)"""
        self.longest_step = np.full(len(designs), np.inf)
        """Longest time step that the effects' memories follow [s], (n,)"""

    def start(self, time: Array, motor_angle: Array, motor_velocity: Array) -> None:
        """Begin a run: reset the effects' memories. Arrays are (n, 1), (n, 10), (n, 10)."""
        moment = self.moment(time, motor_angle, motor_velocity, 0.0)
        self._memory = effects.begin(self._effects, moment)
        self.longest_step = effects.longest_step(self._effects, moment, len(time))

    def moment(
        self, time: Array, motor_angle: Array, motor_velocity: Array, dt: float | Array
    ) -> Moment:
        """The present instant without effects."""
        joints = self._qpos[:, self._joint_q], self._qvel[:, self._joint_v]
        for each in (jaw := self._qpos[:, self._jaw_q], *joints):
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
            slack=self.slack.copy(),
            stiffness=self.stiffness.copy(),
            joint_torque=np.zeros((len(motor_angle), N_JOINTS)),
            motor_torque=np.zeros((len(motor_angle), N_MOTORS)),
            joint_friction=self.joint_friction.copy(),
            transition_velocity=self.transition_velocity.copy(),
            gear_friction=self.gear_friction.copy(),
            stiffening=self.stiffening.copy(),
            reading_age=0.0,
            winch_ratio=self.winch_ratio,
            prior_runtime=self.prior_runtime,
        )

    def act(
        self, time: Array, motor_angle: Array, motor_velocity: Array, dt: float | Array
    ) -> Moment:
        """Let the effects act on the next time step, and write their changes into the batch."""
        moment = self.moment(time, motor_angle, motor_velocity, dt)
        effects.act(self._effects, moment, self._memory)
        self.wind(moment.slack, moment.winch_angle, motor_angle)
        self._stiffness[...] = moment.stiffness
        self._bend[:, :, 0] = moment.stiffness * moment.stiffening
        self._rub(moment)
        self._applied[:, self._joint_v] = moment.joint_torque
        if self._motor_v is not None:
            self._friction[:, self._motor_v] = moment.gear_friction
            self._applied[:, self._motor_v] = moment.motor_torque
        self.reading_age = np.broadcast_to(moment.reading_age, (len(motor_angle), 1))[:, 0]
        return moment

    def step(
        self,
        time: Array,
        motor_angle: Array,
        motor_velocity: Array,
        dt: float | Array,
        ids: NDArray[np.intp] | None = None,
        before: Callable[[Array], None] | None = None,
    ) -> None:
        """Let the effects act on the next time step, and take it, of the runs `ids` alone if given.

        `before` is called in between, with the winches' angles [rad], (n, 10).
        """
        winch = motor_angle
        if self.acting:
            winch = self.act(time, motor_angle, motor_velocity, dt).winch_angle
        else:
            self.wind(self.slack, motor_angle, motor_angle)
        if before:
            before(winch)
        self.batch.step(ids=ids)

    def _rub(self, moment: Moment) -> None:
        """Set the hinges' friction to this moment's, where it has changed."""
        wanted = moment.joint_friction, moment.transition_velocity
        if all(map(np.array_equal, wanted, self._rubs)):
            return
        self._rubs = tuple(each.copy() for each in wanted)
        reference, impedance, inverse_inertia = self._soft
        friction, v = moment.joint_friction, self._joint_v
        soft = softness(friction, inverse_inertia[:, v], moment.transition_velocity)
        self._friction[:, v] = friction
        reference[:, v, 0] = soft[0]
        impedance[:, v, :2] = soft[1][..., None]

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
        self._rest[:, 0::2, 1] = slack[:, 0::2] - taken
        self._rest[:, 1::2, 1] = slack[:, 1::2] + taken

    def horn_torque(self, moment: Moment) -> Array:
        """Torque of cables and effects on each motor's horn, without gearbox friction [N m], (n, 10)."""
        return moment.horn_torque


def _per_motor(designs: Sequence[TwinModel]) -> Array:
    return np.array(
        [d.parameters.gear_friction * np.exp(d.tolerances.gear_friction) for d in designs]
    )
