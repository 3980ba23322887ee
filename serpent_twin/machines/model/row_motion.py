"""Differentiate a model's motion from row to row, along a simulated one."""

from dataclasses import dataclass

import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array
from serpent_twin.machines.model.motion import DrivenRuns, RowStates
from serpent_twin.machines.model.seen import Seen
from serpent_twin.machines.model.switches import Switches
from serpent_twin.machines.places import RowMotion
from serpent_twin.runs.processes import threads
from serpent_twin.sim.stepper import set_timestep, side_by_side

_SMALL = 0.01
"""Differences of states, of how much each varies"""
_LEAST = 1e-5
"""Least of them [rad, m, rad/s, m/s]"""
_STATE = ("qpos", "qvel", "act")


@dataclass(frozen=True)
class ForcedRows:
    """How small changes of states, and small forces and changed commands during rows, go on."""

    motion: RowMotion
    by_force: Array
    """Change of the next row's state by a force on each degree of freedom, (nv, S, T, D)"""
    by_command: Array
    """The same by what each actuator is told, (nu, S, T, D)"""
    command_shows: Array
    """Change of the prediction in the row itself, (nu, S, T, C)"""


def forced_rows(driven: DrivenRuns, states: RowStates, seen: Seen, commands: Array) -> ForcedRows:
    """By differences, a row at a time: all states, forces and commands side by side; `commands` says how much
    each varies, (nu,). What effects do in time steps is left out, but for what MJCF expresses of them.
    """
    S, T = states.pose.shape[:2]
    base = np.concatenate([getattr(states, name) for name in ("pose", "rate", "activation")], -1)
    D, model = base.shape[-1], driven.models[0]
    by = np.maximum(_SMALL * base.reshape(-1, D).std(axis=0), _LEAST)
    rate = by[model.nq : model.nq + model.nv]
    force = np.maximum(model.dof_M0, 1e-12) * rate / float(np.median(driven.period))
    told = np.maximum(_SMALL * commands, _LEAST)
    runs = _Changed(driven, states, seen, by, force, told)
    goes_on, shows, command_shows = np.empty((S, T, D, D)), [], []
    by_force, by_command = np.empty((model.nv, S, T, D)), np.empty((len(told), S, T, D))
    forced, commanded = slice(D, D + model.nv), slice(D + model.nv, None)
    for t in range(T):
        seen_now, after = runs.row(t, base[:, t])
        shown, change = (each[:, 1:] - each[:, :1] for each in (seen_now, after))
        shows.append(shown[:, :D].swapaxes(1, 2) / by)
        command_shows.append((shown[:, commanded] / told[:, None]).swapaxes(0, 1))
        goes_on[:, t] = change[:, :D].swapaxes(1, 2) / by
        by_force[:, :, t] = (change[:, forced] / force[:, None]).swapaxes(0, 1)
        by_command[:, :, t] = (change[:, commanded] / told[:, None]).swapaxes(0, 1)
    out = goes_on, np.stack(shows, axis=1), by_force, by_command, np.stack(command_shows, axis=2)
    goes_on, shown, *others = (np.nan_to_num(each, posinf=0.0, neginf=0.0) for each in out)
    return ForcedRows(RowMotion(goes_on, shown), *others)


class _Changed:
    """S runs as they are, and each with a state, a force or a command changed, side by side."""

    def __init__(
        self,
        driven: DrivenRuns,
        states: RowStates,
        seen: Seen,
        by: Array,
        force: Array,
        told: Array,
    ) -> None:
        self._driven, self._states, self._seen = driven, states, seen
        each = np.concatenate([by, force, told])
        changes = np.concatenate([np.zeros((1, len(each))), np.diag(each)])
        parts = np.cumsum([len(by), len(force)])
        self._by, self._force, self._told = np.split(changes, parts, axis=1)
        self._k = len(changes)
        models = [model for model in driven.models for _ in range(self._k)]
        self._batch: Batch = side_by_side(models, threads())
        set_timestep(self._batch, self._repeated(states.step))
        seen.bind(self._batch)
        self._fields = [self._batch.bind(name) for name in _STATE]
        self._applied, self._control = self._batch.bind("qfrc_applied"), self._batch.bind("ctrl")
        off = np.repeat(driven.off, self._k, axis=0)
        self._switches = Switches(self._batch, off) if off.any() else None

    def _repeated(self, values: Array) -> Array:
        return np.repeat(values, self._k, axis=0)

    def row(self, t: int, base: Array) -> tuple[Array, Array]:
        """What is seen in a row, (S, k, C), and the states in the next one, (S, k, D)."""
        S, parts = len(base), self._driven.told.shape[1] // self._driven.rows
        state = (base[:, None] + self._by).reshape(S * self._k, -1)
        sizes = np.cumsum([field.shape[-1] for field in self._fields])[:-1]
        for field, values in zip(self._fields, np.split(state, sizes, axis=1), strict=True):
            field[...] = values
        self._applied[...] = np.tile(self._force, (S, 1))
        if self._switches:
            self._switches.turn(t)
        self._tell(t * parts)
        self._batch.forward(stage=self._seen.stage)
        seen = self._seen.read(self._batch).reshape(S, self._k, -1)
        for part in range(parts):
            self._tell(t * parts + part)
            self._batch.step(nstep=self._states.nstep)
        after = np.concatenate(self._fields, axis=1).reshape(S, self._k, -1)
        return seen, after

    def _tell(self, t: int) -> None:
        told = self._driven.told[:, t, None] + self._told
        self._control[:, : told.shape[-1]] = told.reshape(len(self._control), -1)
