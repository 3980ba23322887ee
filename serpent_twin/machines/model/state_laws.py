"""Let effects act on a model's state in each time step."""

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.joint_friction import JointFriction
from serpent_twin.machines.model.misread import SeenMoment, Views, only_seen
from serpent_twin.machines.model.prescribed import NO_EFFORTS, Prescription
from serpent_twin.machines.model.springs import Springs, drives_on, single_joints
from serpent_twin.machines.model.state_effects import Acting, state_driven
from serpent_twin.machines.model.state_moment import (
    ACTUATOR,
    BODY,
    FRAME,
    JOINT,
    SPRING,
    TENDON,
    WINCH,
    StateMoment,
    fixed,
)


class StateLaws:
    """Effects that act on the runs of a batch before each time step, at the places that they name.

    `half` says whether rates are half a time step older than poses: those of now are then extrapolated from
    the last two. `beside` names places at which more may be changed than the effects do. `prescribed` are the
    joints that follow a known motion.
    """

    stage = mujoco.mjtStage.mjSTAGE_VEL
    """What of the state must be known before a time step: levers, bodies and the loads of joints"""

    def __init__(
        self,
        batch: Batch,
        acting: Acting,
        step: Array,
        half: bool,
        beside: frozenset[str] = frozenset(),
        prescribed: Prescription | None = None,
    ) -> None:
        model = batch.model
        self._batch, self._acting, self._half, self._dt = batch, acting, half, step[:, None]
        several = effects.stacked(acting.several)
        self._several = [each for each in several if not only_seen(each)]
        self.seen = [each for each in several if only_seen(each)]
        """Effects that change what is seen in rows alone"""
        self.first_memory: list[Any] | None = None
        """What effects remember where the runs begin, once it is known"""
        wanted = {name for each in self._several for name in each.things} | beside
        wanted |= {each.law.where for each in self.seen if each.law.follows_a_thing}
        self._names, springs = _places(model, wanted)
        self._springs = Springs(batch, springs)
        joints, self._tendons, self._bodies = (
            [of(name).id for name in self._names[kind]]
            for kind, of in ((JOINT, model.joint), (TENDON, model.tendon), (BODY, model.body))
        )
        self._q, self._v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._prescribed, names = prescribed, self._names[JOINT]
        followed = prescribed.joints if prescribed else []
        self._names[WINCH] = [name for name in followed if name in names]
        self._winches = np.array([names.index(name) for name in self._names[WINCH]], np.intp)
        self._columns = [followed.index(name) for name in self._names[WINCH]]
        self._motors = [model.actuator(name).id for name in self._names[ACTUATOR]]
        turned = model.actuator_trnid[self._motors, 0]
        self._turned = (model.jnt_dofadr[turned][:, None] == np.arange(model.nv)).astype(float)
        self._drives = (turned[:, None] == np.array(joints, int)).astype(float)
        self._gear = model.actuator_gear[self._motors, 0]
        self._all_of = self._of_all(joints)
        bind, expand = batch.bind, batch.expand
        self._qpos, self._qvel, self._clock = bind("qpos"), bind("qvel"), bind("time")
        self._gravity = expand("opt.gravity")
        self._weighs = self._gravity.copy()
        self._applied, self._pushed = bind("qfrc_applied"), bind("xfrc_applied")
        self._forces = bind("actuator_force"), bind("qfrc_actuator")
        self._load, self._spring_load = bind("qfrc_bias"), bind("qfrc_spring")
        self._at, self._turned_to = bind("xipos"), bind("xmat")
        self._along = expand("tendon_frictionloss")
        self._own_along = self._along[:, self._tendons].copy()
        efforts = prescribed.efforts if prescribed else NO_EFFORTS
        self._friction = JointFriction(batch, self._v, self._winches.tolist(), efforts)

    def _of_all(self, joints: Sequence[int]) -> dict[str, NDArray[np.intp] | slice]:
        """Which places of each kind an effect without a place is at."""
        model, trn = self._batch.model, mujoco.mjtTrn
        on_joints = np.isin(model.actuator_trntype, (trn.mjTRN_JOINT, trn.mjTRN_JOINTINPARENT))
        driven = set(model.actuator_trnid[on_joints, 0].tolist())
        of_drives = [k for k, n in enumerate(joints) if n in driven or k in self._winches]
        others = [k for k in range(len(joints)) if k not in self._winches]
        geared = np.array(of_drives, np.intp)
        return {
            **dict.fromkeys(("gear_friction", "horn_torque"), geared),
            JOINT: np.array(others, np.intp),
            SPRING: slice(0, len(self._tendons)),
        }

    def begin(self) -> None:
        """Begin all runs again, with the memories that they had there; the batch's state is lost."""
        if self.first_memory is None:
            self.first_memory = self._remembered()
        self._memory = deepcopy(self.first_memory)

    def start(self) -> None:
        """Change what acts at a run's first instant, where rates are of now and no time passes."""
        self.write(self.first())

    def first(self) -> StateMoment:
        """A run's first instant, or that of a pose at rest, with the changes of the effects."""
        self.hold()
        self._rate, self._row = self._qvel.copy(), self._clock.copy()
        if self.seen:
            moment = self._moment(0.0 * self._dt, self._time, self._rate)
            self._shows = effects.begin(self.seen, moment)
        return self._changed(0.0 * self._dt, self._rate)

    def kept(self) -> tuple[Any, ...]:
        """What the next time step depends on beside the batch's state, for `recall`."""
        return deepcopy((self._memory, self._rate, self._driving))

    def recall(self, kept: tuple[Any, ...]) -> None:
        """Go back to where `kept` was asked."""
        self._memory, self._rate, self._driving = deepcopy(kept)

    def lag(self) -> None:
        """Take the batch's rates as those of half a time step before the first."""
        self._rate = self._qvel.copy()
        self.hold()

    def hold(self) -> None:
        """Take what actuators gave in the time step before; a stage before forces loses it."""
        self._driving = tuple(force.copy() for force in self._forces)

    def act(self) -> None:
        """Change what acts in the next time step."""
        rate = self._qvel.copy()
        now = rate + (0.5 if self._half else 0.0) * (rate - self._rate)
        self._rate = rate
        self.write(self._changed(self._dt, now))

    def _changed(self, dt: Array, rate: Array) -> StateMoment:
        moment = self._moment(dt, self._time, rate)
        effects.act(self._several, moment, self._memory)
        return moment

    @property
    def _time(self) -> Array:
        """Time since the sessions began [s], (n, 1)."""
        return self._acting.clocks.begun[:, None] + self._clock[:, None]

    def misread(self, shown: Array, views: Views) -> Array:
        """What is seen in a row in place of what is there, (n, C)."""
        dt, self._row = (self._clock - self._row)[:, None], self._clock.copy()
        names, shift = {**self._names, **views.names}, np.zeros_like(shown)
        state = self._state(dt, self._time, self._qvel)
        moment = SeenMoment.of(**state | {"names": names}, views=views, shown=shown, shift=shift)
        effects.act(self.seen, moment, self._shows)
        return shown + moment.shift

    def _remembered(self) -> list[Any]:
        """The memories of all runs where they begin, from what was measured before."""
        earlier, begun = self._acting.earlier, 0.0 * self._acting.clocks.begun[:, None]
        if earlier is None:
            self._batch.forward()
            self.hold()
            return effects.begin(self._several, self._moment(0.0 * self._dt, begun, self._qvel))
        memory: list[Any] = []
        for k in range(int(earlier.rows.max()) + 1):
            self._qpos[...] = earlier.pose[earlier.session, k]
            self._qvel[...] = earlier.rate[earlier.session, k]
            told = earlier.told[earlier.session, k]
            self._batch.bind("ctrl")[:, : told.shape[1]] = told
            self._batch.forward()
            self.hold()
            dt = np.where(k < earlier.rows, earlier.period, 0.0)[:, None]
            moment = self._moment(dt, k * earlier.period[:, None], self._qvel)
            memory = memory or effects.begin(self._several, moment)
            effects.act(self._several, moment, memory)
        return memory

    def _moment(self, dt: Array, time: Array, rate: Array) -> StateMoment:
        """An instant without effects, of rates (n, nv)."""
        return StateMoment.of(**self._state(dt, time, rate))

    def _state(self, dt: Array, time: Array, rate: Array) -> dict[str, Any]:
        """All that is in an instant without effects."""
        n, springs = len(dt), self._springs
        free, told = springs.state(rate)
        given = self._driving[0][:, self._motors] * self._gear
        other = self._driving[1][:, self._v] - given @ self._drives
        other = other + self._load[:, self._v] - self._spring_load[:, self._v]
        other[:, self._winches] *= 2  # whose motion takes all that they carry
        angle, rates = self._qpos[:, self._q], rate[:, self._v]
        wound = angle[:, self._winches]
        shifted = self._prescribed.shift[:, self._columns] if self._prescribed else 0.0
        return {
            "names": self._names,
            "all_of": self._all_of,
            "dt": dt,
            "time": time,
            "prior_runtime": self._acting.clocks.prior_runtime[:, None],
            "joint_angle": angle,
            "joint_velocity": rates,
            "motor_angle": wound - shifted,
            "motor_velocity": rates[:, self._winches],
            "wound": wound,
            "winches": self._winches,
            "levers": springs.levers()[..., self._v],
            "body_position": self._at[:, self._bodies],
            "body_rotation": self._turned_to[:, self._bodies].reshape(n, -1, 3, 3),
            "free_stretch": free,
            "told_pull": told,
            "limits": springs.limits,
            "usual_torque": given,
            "other_torque": other,
            "drives": self._drives,
            "drive_torque": given.copy(),
            "joint_torque": np.zeros((n, len(self._v))),
            "gear_friction": self._friction.friction.copy(),
            "transition_velocity": self._friction.velocity,
            "winch_angle": wound - shifted,
            "tendon_friction": self._own_along.copy(),
            "slack": np.zeros_like(free),
            "stiffness": springs.stiffness.copy(),
            "wrench": np.zeros((n, len(self._bodies), 6)),
            "acceleration": np.zeros((n, 3)),
        }

    def write(self, moment: StateMoment) -> None:
        """Write into the batch what the effects have made of an instant."""
        rubs = moment.gear_friction, moment.transition_velocity
        self._friction.write(*rubs, moment.joint_torque)
        self._along[:, self._tendons] = np.maximum(moment.tendon_friction, 0.0)
        if self._prescribed:
            turned = moment.winch_angle - moment.motor_angle
            self._prescribed.shift[:, self._columns] = turned
        self._springs.write(moment.slack, moment.stiffness)
        self._gravity[...] = self._weighs - moment.acceleration
        self._applied[...] = 0.0
        self._applied[:, self._v] = moment.joint_torque
        self._applied += (moment.drive_torque - moment.usual_torque) @ self._turned
        if self._bodies:
            self._pushed[:, self._bodies] = moment.wrench


def springs_at(model: mujoco.MjModel, wanted: set[str]) -> list[tuple[str, str]]:
    """The kind and name of what pulls at places that are wanted, all if one is ""; of one name, the first."""
    return _places(model, wanted)[1]


def _places(
    model: mujoco.MjModel, wanted: set[str]
) -> tuple[dict[str, list[str]], list[tuple[str, str]]]:
    """The names of the places of each kind that are wanted, all if one is "", and the kinds and names of
    springs.
    """
    joints, tendons, bodies = (
        [name for name in several if name and (name in wanted or "" in wanted)]
        for several in (
            [model.joint(int(n)).name for n in single_joints(model)],
            [model.tendon(n).name for n in range(model.ntendon)],
            [model.body(n).name for n in range(1, model.nbody)],
        )
    )
    springs = [(TENDON, name) for name in tendons]
    springs += [(JOINT, name) for name in joints if model.joint(name).stiffness[0]]
    springs += [
        ("drive", model.actuator(a).name)
        for n in single_joints(model)
        for a in drives_on(model, JOINT, int(n))
        if model.actuator_biasprm[a, 1] and (model.actuator(a).name in wanted or "" in wanted)
    ]
    first = dict.fromkeys(name for _, name in springs)
    springs = [next(each for each in springs if each[1] == name) for name in first]
    motors = [name for name in state_driven(model) if name in wanted or "" in wanted]
    names = {
        FRAME: fixed(model),
        JOINT: joints,
        TENDON: tendons,
        BODY: bodies,
        SPRING: [*first],
        ACTUATOR: motors,
    }
    there = {name for several in names.values() for name in several}
    if lacking := sorted(wanted - there - {""}):
        raise SerpentError(
            f"the model has no hinge, slide, tendon, body or drive of a joint {lacking[0]!r}, at which a "
            "law of its motion could act. Name one of them."
        )
    return names, springs
