"""Let effects act on a model's state in each time step."""

from copy import deepcopy
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.springs import Spring, drives_on, single_joints
from serpent_twin.machines.model.state_effects import Acting, state_driven
from serpent_twin.machines.model.state_moment import (
    ACTUATOR,
    BODY,
    JOINT,
    SPRING,
    TENDON,
    StateMoment,
)

_NOTHING, _POSITIONS, _RATES = (
    mujoco.mjtStage.mjSTAGE_NONE,
    mujoco.mjtStage.mjSTAGE_POS,
    mujoco.mjtStage.mjSTAGE_VEL,
)


class StateLaws:
    """Effects that act on the runs of a batch before each time step, at the places that they name.

    `half` says whether rates are half a time step older than poses: those of now are then extrapolated from
    the last two. `beside` names places at which more may be changed than the effects do.
    """

    def __init__(
        self,
        batch: Batch,
        acting: Acting,
        step: Array,
        half: bool,
        beside: frozenset[str] = frozenset(),
    ) -> None:
        model = batch.model
        self._batch, self._acting, self._half, self._dt = batch, acting, half, step[:, None]
        self._several = effects.stacked(acting.several)
        self._first: list[Any] | None = None
        self._names, springs = _places(
            model, {name for each in self._several for name in each.things} | beside
        )
        self._springs = [Spring(batch, kind, name) for kind, name in springs]
        stiffness = [each.stiffness for each in self._springs]
        self._stiffness = np.array(stiffness).reshape(-1, len(step)).T
        self._limits = np.array([each.limits for each in self._springs]).reshape(-1, 2).T
        joints, self._tendons, self._bodies = (
            [of(name).id for name in self._names[kind]]
            for kind, of in ((JOINT, model.joint), (TENDON, model.tendon), (BODY, model.body))
        )
        self._q, self._v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._motors = [model.actuator(name).id for name in self._names[ACTUATOR]]
        turned = model.actuator_trnid[self._motors, 0]
        self._turned = (model.jnt_dofadr[turned][:, None] == np.arange(model.nv)).astype(float)
        self._drives = (turned[:, None] == np.array(joints, int)).astype(float)
        self._gear = model.actuator_gear[self._motors, 0]
        self.stage = _RATES if self._bodies else _POSITIONS if self._tendons else _NOTHING
        """What of the state must be known before a time step"""
        bind, expand = batch.bind, batch.expand
        self._qpos, self._qvel, self._clock = bind("qpos"), bind("qvel"), bind("time")
        self._applied, self._pushed = bind("qfrc_applied"), bind("xfrc_applied")
        self._force, self._entering = bind("actuator_force"), bind("qfrc_actuator")
        self._load, self._spring_load = bind("qfrc_bias"), bind("qfrc_spring")
        self._at, self._about, self._moves = bind("xipos"), bind("subtree_com"), bind("cvel")
        self._turned_to = bind("xmat")
        self._friction = [
            (expand(of), which, expand(of)[:, which].copy()) if which else None
            for of, which in (
                ("dof_frictionloss", self._v.tolist()),
                ("tendon_frictionloss", self._tendons),
            )
        ]

    def begin(self) -> None:
        """Begin all runs again, with the memories that they had there; the batch's state is lost."""
        if self._first is None:
            self._first = self._remembered()
        self._memory = deepcopy(self._first)

    def start(self) -> None:
        """Change what acts at a run's first instant, where rates are of now and no time passes."""
        self.write(self.first())

    def first(self) -> StateMoment:
        """A run's first instant, or that of a pose at rest, with the changes of the effects."""
        self._rate, self._motion = self._qvel.copy(), self._motions()
        return self._changed(0.0 * self._dt, self._rate, self._motion)

    def kept(self) -> tuple[Any, ...]:
        """What the next time step depends on beside the batch's state, for `recall`."""
        return deepcopy((self._memory, self._rate, self._motion))

    def recall(self, kept: tuple[Any, ...]) -> None:
        """Go back to where `kept` was asked."""
        self._memory, self._rate, self._motion = deepcopy(kept)

    def lag(self) -> None:
        """Take the batch's rates as those of half a time step before the first."""
        self._rate = self._qvel.copy()

    def act(self) -> None:
        """Change what acts in the next time step."""
        rate, motion = self._qvel.copy(), self._motions()
        ahead = 0.5 if self._half else 0.0
        now = rate + ahead * (rate - self._rate), motion + ahead * (motion - self._motion)
        self._rate, self._motion = rate, motion
        self.write(self._changed(self._dt, *now))

    def _motions(self) -> Array:
        """Of the bodies, as MuJoCo has them, (n, B, 6)."""
        return self._moves[:, self._bodies]

    def _changed(self, dt: Array, rate: Array, motion: Array) -> StateMoment:
        moment = self._moment(
            dt, self._acting.clocks.begun[:, None] + self._clock[:, None], rate, motion
        )
        effects.act(self._several, moment, self._memory)
        return moment

    def _remembered(self) -> list[Any]:
        """The memories of all runs where they begin, from what was measured before."""
        earlier, begun = self._acting.earlier, 0.0 * self._acting.clocks.begun[:, None]
        if earlier is None:
            self._batch.forward(stage=_RATES)
            moment = self._moment(0.0 * self._dt, begun, self._qvel, self._motions())
            return effects.begin(self._several, moment)
        memory: list[Any] = []
        for k in range(int(earlier.rows.max()) + 1):
            self._qpos[...] = earlier.pose[earlier.session, k]
            self._qvel[...] = earlier.rate[earlier.session, k]
            told = earlier.told[earlier.session, k]
            self._batch.bind("ctrl")[:, : told.shape[1]] = told
            self._batch.forward(stage=self.stage)
            dt = np.where(k < earlier.rows, earlier.period, 0.0)[:, None]
            moment = self._moment(dt, k * earlier.period[:, None], self._qvel, self._motions())
            memory = memory or effects.begin(self._several, moment)
            effects.act(self._several, moment, memory)
        return memory

    def _moment(self, dt: Array, time: Array, rate: Array, motion: Array) -> StateMoment:
        """An instant without effects, of rates (n, nv) and motions of bodies (n, B, 6)."""
        n = len(dt)
        pulls = np.array([each.state(rate) for each in self._springs]).reshape(-1, 4, n)
        length, along, free, told = pulls.transpose(1, 2, 0)
        of_tendons = len(self._tendons)  # which come first among the springs
        at, moves = self._at[:, self._bodies], motion[..., 3:]
        if self._bodies:
            about = self._about[:, self._batch.model.body_rootid[self._bodies]]
            moves = moves + np.cross(motion[..., :3], at - about)
        given = self._force[:, self._motors] * self._gear
        other = self._entering[:, self._v] - given @ self._drives
        other = other + self._load[:, self._v] - self._spring_load[:, self._v]
        rubs = [each[2] if each else np.zeros((n, 0)) for each in self._friction]
        return StateMoment.of(
            names=self._names,
            dt=dt,
            time=time,
            prior_runtime=self._acting.clocks.prior_runtime[:, None],
            joint_angle=self._qpos[:, self._q],
            joint_velocity=rate[:, self._v],
            tendon_length=length[:, :of_tendons],
            tendon_velocity=along[:, :of_tendons],
            body_position=at,
            body_rotation=self._turned_to[:, self._bodies].reshape(n, -1, 3, 3),
            body_velocity=moves,
            free_stretch=free,
            told_pull=told,
            limits=self._limits,
            usual_torque=given,
            other_torque=other,
            drives=self._drives,
            drive_torque=given.copy(),
            joint_torque=np.zeros((n, len(self._v))),
            gear_friction=rubs[0].copy(),
            tendon_pull=np.zeros((n, len(self._tendons))),
            tendon_friction=rubs[1].copy(),
            slack=np.zeros((n, len(self._springs))),
            stiffness=self._stiffness.copy(),
            wrench=np.zeros((n, len(self._bodies), 6)),
        )

    def write(self, moment: StateMoment) -> None:
        """Write into the batch what the effects have made of an instant."""
        for each, rubs in zip(
            self._friction, (moment.gear_friction, moment.tendon_friction), strict=True
        ):
            if each:
                each[0][:, each[1]] = np.maximum(rubs, 0.0)
        for k, spring in enumerate(self._springs):
            spring.write(moment.slack[:, k], moment.stiffness[:, k])
        self._applied[...] = 0.0
        self._applied[:, self._v] = moment.joint_torque
        self._applied += (moment.drive_torque - moment.usual_torque) @ self._turned
        for k, tendon in enumerate(self._springs[: len(self._tendons)]):
            tendon.pull(self._applied, moment.tendon_pull[:, k])
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
    names = {JOINT: joints, TENDON: tendons, BODY: bodies, SPRING: [*first], ACTUATOR: motors}
    there = {name for several in names.values() for name in several}
    if lacking := sorted(wanted - there - {""}):
        raise SerpentError(
            f"the model has no hinge, slide, tendon, body or drive of a joint {lacking[0]!r}, at which a "
            "law of its motion could act. Name one of them."
        )
    return names, springs
