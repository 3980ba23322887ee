"""Say what small changes of a model's motion do to what is measured, and to the rows after."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.row_changes import RowChanges
from serpent_twin.engine.steps_of_springs import sprung
from serpent_twin.machines.model.motion import DrivenMotion, RowStates
from serpent_twin.machines.model.seen import Seen, address
from serpent_twin.machines.model.starts import LEAD
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.model.variants import Variants
from serpent_twin.machines.places import RowMotion

_SMALL = 0.01
"""Differences of states, of how much each varies"""
_LEAST = 1e-5
"""Least of them [rad, m, rad/s, m/s]"""
_GENTLE = 0.1
"""Differences of forces on bodies, of all that these carry [m/s²]"""
_REST = "tendon_lengthspring"
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
    """Change of the next row's state by what each actuator is commanded, (nu, S, T, D)"""
    command_shows: Array
    """Change of the prediction in the row itself by what each actuator is commanded, (nu, S, T, C)"""
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
    otherwise_sprung: Sequence[Sequence[mujoco.MjModel]],
) -> tuple[RowMotion, RowChanges]:
    """Linearise a motion, with the friction of other twins, and the springs and dampers of those that differ
    in nothing else.
    """
    free, about = free_of(driven), (driven.models, states.steps, states.step)
    steps = RowChanges.of(*about, driven.off[:, :-1], free, others, otherwise_sprung)
    shows, *_ = _shown(driven, states, seen, _Inputs(free))
    return _row_motion(steps, shows), steps


def _row_motion(steps: RowChanges, shows: Array) -> RowMotion:
    """Motion through all rows, after the last of which there is none; what states show is (D, S, T, C)."""
    goes_on = np.insert(steps.A, steps.A.shape[1], 0.0, axis=1)
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
    model, free = driven.models[0], list(inputs.free)
    base = states.pose, states.rate, states.activation
    varies = np.concatenate([of.std(axis=(0, 1)) for of in base])
    varies = np.maximum(_SMALL * varies, _LEAST)
    rate = varies[model.nq : model.nq + model.nv]
    force = np.maximum(model.dof_M0, 1e-12) * rate / float(np.median(driven.period))
    commands = np.empty(0) if inputs.commands is None else inputs.commands
    which = [
        [*free, *(model.nq + n for n in free), *range(model.nq + model.nv, len(varies))],
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
    rows = np.stack([runs.row(t) for t in range(states.pose.shape[1])], axis=2)
    shows = (rows[1:] - rows[0]) / each[:, None, None, None]
    shows = np.nan_to_num(shows, posinf=0.0, neginf=0.0)
    found = np.zeros((counts[-1], *shows.shape[1:]))
    parts = np.split(np.arange(counts[-1]), counts[:-1])
    found[np.concatenate([parts[n] for n in tried])] = shows
    return np.split(found, counts[:-1])


class _Changed:
    """S runs as they are, and with one change each; sizes of the changes are of states, forces on degrees of
    freedom, commands, tendons' slack and forces on bodies, and so is which.
    """

    def __init__(
        self,
        driven: DrivenRuns,
        states: RowStates,
        seen: Seen,
        sizes: Sequence[Array],
        which: Sequence[Sequence[int]],
    ) -> None:
        self._driven, self._states, self._seen, model = driven, states, seen, driven.models[0]
        each = np.concatenate(sizes)
        changes = np.concatenate([np.zeros((1, len(each))), np.diag(each)])
        parts = np.split(changes, np.cumsum([len(of) for of in sizes[:-1]]), axis=1)
        whole = model.nq + model.nv + model.na, model.nv, driven.told.shape[-1], model.ntendon
        by = [np.zeros((len(changes), 1, size)) for size in whole]
        for of, at, part in zip(by, which, parts, strict=False):
            of[:, 0, [*at]] = part
        state, self._force, self._told, slack = by
        self._state = np.split(state, [model.nq, model.nq + model.nv], axis=-1)
        models, runs = [*driven.models] * len(changes), len(driven.models)
        self._runs = Variants(driven, models, states.step)
        batch = self._runs.batch
        seen.bind(batch, models)
        if slack.any():
            longer = slack[:, 0].repeat(runs, 0)[..., None]
            for rest in (batch.expand(_REST), self._runs.own[_REST]):
                rest += longer
        if len(bodies := [*which[4]]):
            pushed = parts[4].reshape(-1, len(bodies), 3).repeat(runs, axis=0)
            batch.bind("xfrc_applied")[:, bodies, :3] = pushed

    def row(self, t: int) -> Array:
        """What is seen in a row, (k, S, C)."""
        states = self._states
        pose, rate, activation = self._state
        self._runs.put(
            t,
            qpos=states.pose[:, t] + pose,
            qvel=states.rate[:, t] + rate,
            act=states.activation[:, t] + activation,
            ctrl=self._driven.told_at(t) + self._told,
            qfrc_applied=states.applied[:, t] + self._force,
        )
        self._runs.act(states.fields, (t,))
        self._runs.batch.forward(stage=self._seen.stage)
        return self._runs.apart(self._seen.read(self._runs.batch, self._runs.older))


def free_of(driven: DrivenRuns) -> list[int]:
    """The degrees of freedom that no prescribed joint takes."""
    model, known = driven.models[0], driven.known
    joints = [each.joint for each in known.machine.prescribed if each.joint] if known else []
    held = {int(model.joint(name).dofadr[0]) for name in joints}
    return [n for n in range(model.nv) if n not in held]


def adapted(
    rows: RowMotion, measured: Sequence[str], motion: DrivenMotion, free: Sequence[int]
) -> RowMotion:
    """Motion from row to row whose first states follow what is read in the lead, where readings say them."""
    if motion.gain is None:
        return rows
    (S, _, C, D), joints = rows.C.shape, motion.start.joints
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
