"""Differentiate a model's motion from row to row, along a simulated one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import set_timestep, side_by_side
from serpent_twin.machines.model.motion import RowStates
from serpent_twin.machines.model.prescribed import PrescribedSteps, Prescription
from serpent_twin.machines.model.seen import Seen
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


@dataclass(frozen=True)
class ForcedRows:
    """How small changes of states, and small forces and changed commands during rows, go on.

    Prescribed motion is followed, whatever changes. The angle and rate of a prescribed joint are no states:
    nothing follows from their changes.
    """

    motion: RowMotion
    by_force: Array
    """Change of the next row's state by a force on each degree of freedom, (nv, S, T, D)"""
    force_shows: Array
    """Change of the prediction in the row itself, (nv, S, T, C)"""
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
    """By differences, a row at a time: all states, forces and commands side by side; `commands` says how much
    each varies, (nu,). What effects do in time steps is left out, but for what MJCF expresses of them.
    """
    T = states.pose.shape[1]
    base = np.concatenate([getattr(states, name) for name in ("pose", "rate", "activation")], -1)
    D, model = base.shape[-1], driven.models[0]
    by = np.maximum(_SMALL * base.reshape(-1, D).std(axis=0), _LEAST)
    rate = by[model.nq : model.nq + model.nv]
    force = np.maximum(model.dof_M0, 1e-12) * rate / float(np.median(driven.period))
    told = np.maximum(_SMALL * commands, _LEAST)
    bodies = bodies if seen.of_forces else ()
    push = np.repeat(_GENTLE * model.body_subtreemass[list(bodies)], 3)
    sizes = by, force, told, push
    runs = _Changed(driven, states, seen, sizes, bodies)
    each, several = np.concatenate(sizes), [runs.row(t, base[:, t]) for t in range(T)]
    shows, after = (
        np.nan_to_num((rows[:, :, 1:] - rows[:, :, :1]) / each[:, None], posinf=0.0, neginf=0.0)
        for rows in (np.stack(of, axis=1) for of in zip(*several, strict=True))
    )
    shown = np.split(np.moveaxis(shows, 2, 0), np.cumsum([len(of) for of in sizes[:-1]]))
    goes_on, by_force, by_command, _ = np.split(
        np.moveaxis(after, 2, 0), np.cumsum([len(of) for of in sizes[:-1]])
    )
    return ForcedRows(
        RowMotion(np.moveaxis(goes_on, 0, -1), np.moveaxis(shown[0], 0, -1)),
        by_force,
        shown[1],
        by_command,
        shown[2],
        shown[3].reshape(-1, 3, *shown[3].shape[1:]) if len(bodies) else None,
    )


class _Changed:
    """S runs as they are, and each with a state, a force or a command changed, side by side; of sizes by
    states, (D,), forces on degrees of freedom, (nv,), commands, (nu,), and forces on bodies, (3 B,).
    """

    def __init__(
        self,
        driven: DrivenRuns,
        states: RowStates,
        seen: Seen,
        sizes: Sequence[Array],
        bodies: Sequence[int],
    ) -> None:
        self._driven, self._states, self._seen = driven, states, seen
        each = np.concatenate(sizes)
        each[_held(driven)] = 0.0
        changes = np.concatenate([np.zeros((1, len(each))), np.diag(each)])
        self._by, force, self._told, push = np.split(
            changes, np.cumsum([len(of) for of in sizes[:-1]]), axis=1
        )
        self._k = len(changes)
        models = [model for model in driven.models for _ in range(self._k)]
        self._batch: Batch = side_by_side(models, threads())
        set_timestep(self._batch, self._repeated(states.step))
        seen.bind(self._batch, models)
        self._fields = [self._batch.bind(name) for name in _STATE]
        self._control = self._batch.bind("ctrl")
        runs = len(driven.models)
        self._batch.bind("qfrc_applied")[...] = np.tile(force, (runs, 1))
        if len(bodies):
            pushed = np.tile(push, (runs, 1)).reshape(-1, len(bodies), 3)
            self._batch.bind("xfrc_applied")[:, bodies, :3] = pushed
        off = np.repeat(driven.off, self._k, axis=0)
        self._switches = Switches(self._batch, off) if off.any() else None
        self._parts = driven.told.shape[1] // driven.rows
        self._prescription = None
        if known := driven.known:
            motion = PrescribedSteps(known, states.nstep * self._parts, states.step, self._k)
            self._prescription = Prescription(known.machine, self._batch, motion)

    def _repeated(self, values: Array) -> Array:
        return np.repeat(values, self._k, axis=0)

    def row(self, t: int, base: Array) -> tuple[Array, Array]:
        """What is seen in a row, (S, k, C), and the states in the next one, (S, k, D)."""
        S, nstep = len(base), self._states.nstep
        state = (base[:, None] + self._by).reshape(S * self._k, -1)
        sizes = np.cumsum([field.shape[-1] for field in self._fields])[:-1]
        for field, values in zip(self._fields, np.split(state, sizes, axis=1), strict=True):
            field[...] = values
        if self._switches:
            self._switches.turn(t)
        self._tell(t * self._parts)
        if self._prescription:
            self._prescription.seen(t * self._parts * nstep)
        self._batch.forward(stage=self._seen.stage)
        seen = self._seen.read(self._batch).reshape(S, self._k, -1)
        for part in range(t * self._parts, (t + 1) * self._parts):
            self._tell(part)
            self._step(part * nstep)
        after = np.concatenate(self._fields, axis=1).reshape(S, self._k, -1)
        return seen, after

    def _step(self, first: int) -> None:
        """Take the time steps of a part of a row, of which one is the `first`."""
        if not self._prescription:
            self._batch.step(nstep=self._states.nstep)
            return
        for n in range(first, first + self._states.nstep):
            self._prescription.follow(n)
            self._batch.step()

    def _tell(self, t: int) -> None:
        told = self._driven.told[:, t, None] + self._told
        self._control[:, : told.shape[-1]] = told.reshape(len(self._control), -1)


def _held(driven: DrivenRuns) -> list[int]:
    """Which states are prescribed: angles and rates of joints."""
    model, known = driven.models[0], driven.known
    joints = [each.joint for each in known.machine.prescribed if each.joint] if known else []
    angles = [int(model.joint(name).qposadr[0]) for name in joints]
    return angles + [model.nq + int(model.joint(name).dofadr[0]) for name in joints]
