"""Let effects act on a model's state in each time step."""

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects.instant import read_only
from serpent_twin.engine.stepper import in_a_row
from serpent_twin.machines.model.joint_friction import JointFriction
from serpent_twin.machines.model.misread import SeenMoment, Views, only_seen
from serpent_twin.machines.model.prescribed import NO_EFFORTS, Prescription
from serpent_twin.machines.model.springs import Springs
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_moment import (
    ACTUATOR,
    BODY,
    JOINT,
    SPRING,
    TENDON,
    WINCH,
    StateMoment,
)
from serpent_twin.machines.model.state_places import state_places

_WRITTEN = (
    *("gear_friction", "transition_velocity", "joint_torque", "tendon_friction", "winch_angle"),
    *("slack", "stiffness", "acceleration", "drive_torque", "wrench"),
)
"""What effects change of an instant"""


class StateLaws:
    """Effects that act on the runs of a batch before each time step, at the places that they name.

    `half` says whether rates are half a time step older than poses: those of now are then extrapolated from
    the last two. `beside` names places at which more may be changed than the effects do. `prescribed` are the
    joints that follow a known motion. `carried` computes what the loads of measured drives take, (n, E), by
    which gears rub [N m or N]; without it, that is what they take at rest.
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
        carried: Callable[[], Array] | None = None,
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
        self._names, springs = state_places(model, wanted)
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
        self._written: set[str] = set()
        self._carried = carried
        self._fixed: dict[str, Any] = {
            "names": self._names,
            "all_of": self._all_of,
            "known_places": {},
            "prior_runtime": acting.clocks.prior_runtime[:, None],
            "winches": in_a_row(self._winches),
            "limits": self._springs.limits,
            "least_stretch": np.where(self._springs.limits[0] < 0, -np.inf, 0.0),
            "drives": self._drives,
        }
        self._fixed = {name: read_only(value) for name, value in self._fixed.items()}
        self._when_read = self._read_of_state()

    def _of_all(self, joints: Sequence[int]) -> dict[str, NDArray[np.intp] | slice]:
        """Which places of each kind an effect without a place is at."""
        model, trn = self._batch.model, mujoco.mjtTrn
        on_joints = np.isin(model.actuator_trntype, (trn.mjTRN_JOINT, trn.mjTRN_JOINTINPARENT))
        driven = set(model.actuator_trnid[on_joints, 0].tolist())
        of_drives = [k for k, n in enumerate(joints) if n in driven or k in self._winches]
        others = [k for k in range(len(joints)) if k not in self._winches]
        geared = np.array(of_drives, np.intp)
        return {
            **dict.fromkeys(("gear_friction", "horn_torque"), in_a_row(geared)),
            JOINT: in_a_row(np.array(others, np.intp)),
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
            moment = self._moment(0.0 * self._dt, self._rate)
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
        moment = self._moment(dt, rate)
        effects.act(self._several, moment, self._memory)
        return moment

    def misread(self, shown: Array, views: Views) -> Array:
        """What is seen in a row in place of what is there, (n, C)."""
        dt, self._row = (self._clock - self._row)[:, None], self._clock.copy()
        seen = {"views": views, "shown": shown, "shift": np.zeros_like(shown)}
        seen |= {"names": {**self._names, **views.names}, "known_places": {}}
        seen |= {"dt": dt, "rate": self._qvel.copy(), "shifted": "winch_angle" in self._written}
        moment = SeenMoment.of(self._when_read, **self._fixed | seen)
        effects.act(self.seen, moment, self._shows)
        return shown + moment.shift

    def _remembered(self) -> list[Any]:
        """The memories of all runs where they begin, from what was measured before."""
        earlier, begun = self._acting.earlier, 0.0 * self._acting.clocks.begun[:, None]
        if earlier is None:
            self._batch.forward()
            self.hold()
            return effects.begin(
                self._several, self._moment(0.0 * self._dt, self._qvel.copy(), time=begun)
            )
        memory: list[Any] = []
        for k in range(int(earlier.rows.max()) + 1):
            self._qpos[...] = earlier.pose[earlier.session, k]
            self._qvel[...] = earlier.rate[earlier.session, k]
            told = earlier.told[earlier.session, k]
            self._batch.bind("ctrl")[:, : told.shape[1]] = told
            self._batch.forward()
            self.hold()
            dt = np.where(k < earlier.rows, earlier.period, 0.0)[:, None]
            moment = self._moment(dt, self._qvel.copy(), time=k * earlier.period[:, None])
            memory = memory or effects.begin(self._several, moment)
            effects.act(self._several, moment, memory)
        return memory

    def _moment(self, dt: Array, rate: Array, **known: Any) -> StateMoment:
        """An instant without effects, of rates (n, nv)."""
        known |= {"dt": dt, "rate": rate, "shifted": "winch_angle" in self._written}
        return StateMoment.of(self._when_read, **self._fixed, **known)

    def _read_of_state(self) -> dict[str, Callable[[Any], Any]]:
        """What an instant has of the batch's state, and of what the model has without effects, each computed
        when an effect reads it.
        """
        springs, friction, n, bodies = self._springs, self._friction, len(self._dt), self._bodies
        joints, winches = in_a_row(self._v), in_a_row(self._winches)
        begun, followed, columns = (
            self._acting.clocks.begun[:, None],
            self._prescribed,
            self._columns,
        )
        return {
            "time": lambda _: begun + self._clock[:, None],
            "joint_angle": lambda _: self._qpos[:, self._q],
            "joint_velocity": lambda now: now.rate[:, joints],
            "wound": lambda now: now.joint_angle[:, winches],
            "motor_angle": lambda now: (
                now.wound - (followed.shift[:, columns] if followed else 0.0)
            ),
            "motor_velocity": lambda now: now.joint_velocity[:, winches],
            "levers": lambda _: springs.levers()[..., joints],
            "body_position": lambda _: self._at[:, bodies],
            "body_rotation": lambda _: self._turned_to[:, bodies].reshape(n, -1, 3, 3),
            "pulls": lambda now: springs.state(now.rate),
            "free_stretch": lambda now: now.pulls[0],
            "told_pull": lambda now: now.pulls[1],
            "usual_torque": lambda _: self._driving[0][:, self._motors] * self._gear,
            "other_torque": self._other_torque,
            "drive_torque": lambda now: now.usual_torque.copy(),
            "joint_torque": lambda _: np.zeros((n, len(self._v))),
            "gear_friction": lambda _: friction.friction.copy(),
            "transition_velocity": lambda _: friction.velocity,
            "winch_angle": lambda now: now.motor_angle.copy(),
            "tendon_friction": lambda _: self._own_along.copy(),
            "slack": lambda _: np.zeros_like(springs.stiffness),
            "stiffness": lambda _: springs.stiffness.copy(),
            "wrench": lambda _: np.zeros((n, len(bodies), 6)),
            "acceleration": lambda _: np.zeros((n, 3)),
        }

    def _other_torque(self, now: StateMoment) -> Array:
        other = (
            self._driving[1][:, self._v] + self._load[:, self._v] - self._spring_load[:, self._v]
        )
        if len(self._motors):
            other -= now.usual_torque @ self._drives
        other[:, self._winches] *= 2  # whose motion takes all that they carry
        if self._carried is not None:
            self._friction.of_drives(other, 2 * self._carried())
        return other

    def write(self, moment: StateMoment) -> None:
        """Write into the batch what the effects have made of an instant: what they have read or changed of
        it, and what was written of the one before.
        """
        changed = {name for name in _WRITTEN if name in moment.__dict__}
        of, self._written = changed | self._written, changed
        if not of.isdisjoint(("gear_friction", "transition_velocity", "joint_torque")):
            rubs = moment.gear_friction, moment.transition_velocity
            self._friction.write(*rubs, moment.joint_torque)
        if "tendon_friction" in of:
            self._along[:, self._tendons] = np.maximum(moment.tendon_friction, 0.0)
        if self._prescribed and "winch_angle" in of:
            turned = moment.winch_angle - moment.motor_angle
            self._prescribed.shift[:, self._columns] = turned
        if "slack" in of or "stiffness" in of:
            self._springs.write(moment.slack, moment.stiffness)
        if "acceleration" in of:
            self._gravity[...] = self._weighs - moment.acceleration
        if not of.isdisjoint(("joint_torque", "drive_torque")):
            self._applied[...] = 0.0
            self._applied[:, self._v] = moment.joint_torque
            if len(self._motors):
                more = moment.drive_torque - moment.usual_torque
                self._applied += more @ self._turned
        if self._bodies and "wrench" in of:
            self._pushed[:, self._bodies] = moment.wrench
