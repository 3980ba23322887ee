"""Say what small changes of a model's motion do to what is measured, and to the rows after."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array
from serpent_twin.engine.row_changes import RowChanges
from serpent_twin.engine.stepper import set_timestep, side_by_side
from serpent_twin.engine.steps_of_springs import sprung
from serpent_twin.machines.model.motion import DrivenMotion, RowStates
from serpent_twin.machines.model.seen import Seen, address
from serpent_twin.machines.model.starts import LEAD
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.model.switches import Switches
from serpent_twin.machines.places import RowMotion
from serpent_twin.runs.processes import threads

_SMALL = 0.01
"""Differences of states, of how much each varies"""
_LEAST = 1e-5
"""Least of them [rad, m, rad/s, m/s]"""
_GENTLE = 0.1
"""Differences of forces on bodies, of all that these carry [m/s²]"""
_STATE = ("qpos", "qvel", "act")
_SPRINGS_SHOW = 0, 3
"""What shows, of states, forces, commands, slack and pushes, where nothing measured depends on forces: a
tendon's pull follows from its length
"""


@dataclass(frozen=True)
class ForcedRows:
    """Linear dynamics from row to row, with forces and changed commands as inputs.

    A prescribed motion is followed, whatever changes: the angle and rate of a prescribed joint are no states.
    """

    motion: RowMotion
    free: Sequence[int]
    """The degrees of freedom whose angles, and then rates, are states"""
    by_force: Array
    """Change of the next row's state by a force on each degree of freedom, (nv, S, T, D)"""
    by_friction: Array
    """Change of the next row's state by dry friction of each degree of freedom, (nv, S, T, D)"""
    force_shows: Array
    """Change of the prediction in the row itself by such a force, (nv, S, T, C)"""
    by_slack: Array
    """Change of the next row's state by the slack of each tendon with a spring, (L, S, T, D)"""
    slack_shows: Array
    """Change of the prediction in the row itself, (L, S, T, C)"""
    by_command: Array
    """As by a force, by what each actuator is told, (nu, S, T, D)"""
    command_shows: Array
    """And in the row itself, (nu, S, T, C)"""
    push_shows: Array | None
    """Change of the prediction in the row itself by a force on each body along the world's axes,
    (B, 3, S, T, C); None where nothing that is measured depends on forces
    """


def forced_rows(
    driven: DrivenRuns, states: RowStates, seen: Seen, commands: Array, bodies: Sequence[int]
) -> ForcedRows:
    """Linearise a motion, with bodies that forces may push; `commands` says how much each varies, (nu,). What
    effects do in time steps is left out, but for what MJCF expresses of them.
    """
    model, free = driven.models[0], free_of(driven)
    steps = RowChanges.of(driven.models, states.steps, states.step, driven.off[:, :-1], free)
    shown = _shown(driven, states, seen, _Inputs(free, commands, bodies, sprung(driven.models)))
    by_force, by_friction = (
        _among(free, model.nv, of) for of in (steps.by_force.sum(axis=1), steps.by_friction)
    )
    by_slack, by_command = (
        np.insert(of, of.shape[2], 0.0, axis=2) for of in (steps.by_slack, steps.by_command)
    )
    states_show, force_shows, command_shows, slack_shows, push_shows = shown
    return ForcedRows(
        _row_motion(steps, states_show),
        free,
        by_force,
        by_friction,
        _among(free, model.nv, force_shows, last=False),
        by_slack,
        slack_shows,
        by_command,
        command_shows,
        push_shows.reshape(-1, 3, *push_shows.shape[1:]) if len(push_shows) else None,
    )


def linear_motion(
    driven: DrivenRuns,
    states: RowStates,
    seen: Seen,
    others: Sequence[Sequence[mujoco.MjModel]],
) -> tuple[RowMotion, RowChanges]:
    """Linearise a motion, with the friction of other twins."""
    free = free_of(driven)
    steps = RowChanges.of(
        driven.models, states.steps, states.step, driven.off[:, :-1], free, others
    )
    shows, *_ = _shown(driven, states, seen, _Inputs(free))
    return _row_motion(steps, shows), steps


def _row_motion(steps: RowChanges, shows: Array) -> RowMotion:
    """Motion through all rows, after the last of which there is none; what states show is (D, S, T, C)."""
    goes_on = np.insert(steps.goes_on, steps.goes_on.shape[1], 0.0, axis=1)
    return RowMotion(goes_on, np.moveaxis(shows, 0, -1))


@dataclass(frozen=True)
class _Inputs:
    """What may change what is measured in a row: states of free degrees of freedom and forces on them,
    commands that vary so much, forces on bodies, and slack of tendons.
    """

    free: Sequence[int]
    commands: Array | None = None
    bodies: Sequence[int] = ()
    tendons: Sequence[int] = ()


def _among(free: Sequence[int], nv: int, by: Array, last: bool = True) -> Array:
    """Changes by what acts on all degrees of freedom, none on others than free ones, (nv, S, T, …)."""
    rows = by.shape[2] + last  # after the last row there is none
    out = np.zeros((nv, by.shape[1], rows, *by.shape[3:]))
    out[list(free), :, : by.shape[2]] = by
    return out


def _shown(driven: DrivenRuns, states: RowStates, seen: Seen, inputs: _Inputs) -> list[Array]:
    """Changes of the prediction in a row by its states, by forces on free degrees of freedom, by commands,
    by slack of tendons and by forces on bodies, (…, S, T, C) each, by finite differences.
    """
    model, T, free = driven.models[0], states.pose.shape[1], list(inputs.free)
    base = np.concatenate([getattr(states, name) for name in ("pose", "rate", "activation")], -1)
    varies = np.maximum(_SMALL * base.reshape(-1, base.shape[-1]).std(axis=0), _LEAST)
    rate = varies[model.nq : model.nq + model.nv]
    force = np.maximum(model.dof_M0, 1e-12) * rate / float(np.median(driven.period))
    commands = np.empty(0) if inputs.commands is None else inputs.commands
    which = [
        [*free, *(model.nq + n for n in free), *range(model.nq + model.nv, base.shape[-1])],
        [] if inputs.commands is None else free,
        [*range(len(commands))],
        inputs.tendons,
        inputs.bodies if seen.of_forces else (),
    ]
    sizes = [
        varies[which[0]],
        force[which[1]],
        np.maximum(_SMALL * commands, _LEAST),
        np.full(len(inputs.tendons), _LEAST),
        np.repeat(_GENTLE * model.body_subtreemass[list(which[4])], 3),
    ]
    counts = np.cumsum([len(of) for of in sizes])
    tried = [*_SPRINGS_SHOW] if not seen.of_forces else [*range(len(sizes))]
    which = [of if n in tried else [] for n, of in enumerate(which)]
    sizes = [of if n in tried else np.empty(0) for n, of in enumerate(sizes)]
    runs, each = _Changed(driven, states, seen, sizes, which), np.concatenate(sizes)
    rows = np.stack([runs.row(t, base[:, t]) for t in range(T)], axis=1)
    shows = np.nan_to_num((rows[:, :, 1:] - rows[:, :, :1]) / each[:, None], posinf=0.0, neginf=0.0)
    found = np.zeros((counts[-1], *shows.shape[:2], shows.shape[-1]))
    parts = np.split(np.arange(counts[-1]), counts[:-1])
    found[np.concatenate([parts[n] for n in tried])] = np.moveaxis(shows, 2, 0)
    return np.split(found, counts[:-1])


class _Changed:
    """S runs as they are, and each with a state, a force or a command changed, side by side; sizes of the
    changes are of states, forces on degrees of freedom, commands, tendons' slack and forces on bodies, and so
    is which.
    """

    def __init__(
        self,
        driven: DrivenRuns,
        states: RowStates,
        seen: Seen,
        sizes: Sequence[Array],
        which: Sequence[Sequence[int]],
    ) -> None:
        self._driven, self._seen, model = driven, seen, driven.models[0]
        each = np.concatenate(sizes)
        changes = np.concatenate([np.zeros((1, len(each))), np.diag(each)])
        parts = np.split(changes, np.cumsum([len(of) for of in sizes[:-1]]), axis=1)
        state, told, force = (
            np.zeros((len(changes), n))
            for n in (
                states.pose.shape[-1] + states.rate.shape[-1] + model.na,
                driven.told.shape[-1],
                model.nv,
            )
        )
        state[:, list(which[0])] = parts[0]
        force[:, list(which[1])[: len(sizes[1])]] = parts[1]
        told[:, list(which[2])] = parts[2]
        slack = np.zeros((len(changes), model.ntendon))
        slack[:, list(which[3])[: len(sizes[3])]] = parts[3]
        self._by, self._told, self._k = state, told, len(changes)
        models = [model for model in driven.models for _ in range(self._k)]
        self._batch: Batch = side_by_side(models, threads())
        set_timestep(self._batch, np.repeat(states.step, self._k, axis=0))
        seen.bind(self._batch, models)
        self._fields = [self._batch.bind(name) for name in _STATE]
        self._control = self._batch.bind("ctrl")
        runs = len(driven.models)
        self._force, self._applied = force, self._batch.bind("qfrc_applied")
        self._equality = self._batch.expand("eq_data")
        if slack.any():
            self._batch.expand("tendon_lengthspring")[...] += np.tile(slack, (runs, 1))[..., None]
        if len(which[4]):
            pushed = np.tile(parts[4], (runs, 1)).reshape(-1, len(which[4]), 3)
            self._batch.bind("xfrc_applied")[:, list(which[4]), :3] = pushed
        off = np.repeat(driven.off, self._k, axis=0)
        self._switches = Switches(self._batch, off) if off.any() else None
        self._parts, self._states = driven.told.shape[1] // driven.rows, states

    def row(self, t: int, base: Array) -> Array:
        """What is seen in a row, (S, k, C)."""
        S = len(base)
        state = (base[:, None] + self._by).reshape(S * self._k, -1)
        sizes = np.cumsum([field.shape[-1] for field in self._fields])[:-1]
        for field, values in zip(self._fields, np.split(state, sizes, axis=1), strict=True):
            field[...] = values
        if self._switches:
            self._switches.turn(t)
        told = self._driven.told[:, t * self._parts, None] + self._told
        self._control[:, : told.shape[-1]] = told.reshape(len(self._control), -1)
        applied, equality = self._states.applied[:, t], self._states.equality[:, t]
        self._applied[...] = (applied[:, None] + self._force).reshape(self._applied.shape)
        self._equality[...] = np.repeat(equality, self._k, axis=0)
        self._batch.forward(stage=self._seen.stage)
        return self._seen.read(self._batch).reshape(S, self._k, -1)


def free_of(driven: DrivenRuns) -> list[int]:
    """The degrees of freedom that no prescribed joint takes."""
    model, known = driven.models[0], driven.known
    joints = [each.joint for each in known.machine.prescribed if each.joint] if known else []
    held = {int(model.joint(name).dofadr[0]) for name in joints}
    return [n for n in range(model.nv) if n not in held]


def adapted(
    rows: RowMotion, measured: Sequence[str], motion: DrivenMotion, free: Sequence[int]
) -> RowMotion:
    """The same, where runs begin as readings say, in states that follow what is read in the lead."""
    if motion.gain is None:
        return rows
    (S, _, C, D), joints = rows.shows.shape, motion.start.joints
    model, at = motion.driven.models[0], list(free)
    out = np.zeros((S, D, LEAD, C))
    gain = motion.gain.reshape(S, len(joints), 2, len(joints), LEAD)
    for j, joint in enumerate(joints):
        if (dof := address(model, joint)) not in at:
            continue
        angle = at.index(dof)
        for k, other in enumerate(joints):
            if other not in measured:  # prescribed, which no start changes
                continue
            column = list(measured).index(other)
            out[:, angle, :, column] = -gain[:, j, 0, k]
            out[:, len(at) + angle, :, column] = -gain[:, j, 1, k]
    return replace(rows, adapts=out)
