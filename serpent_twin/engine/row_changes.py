"""Linearise a model's motion from row to row, about a simulated one.

A motion obeys M a = f(q, v, act, u) + J'λ, with dry friction λ = −D (J a + B J v) up to its limit. A small
change of state obeys the same equation made linear: friction that sticks is an inertia D and a damper D B,
friction that slides is constant. f is differentiated amid each part of a row, friction is as it was in each
time step, and semi-implicit steps carry all changes of states, forces and commands from one row to the next.
Sources: MuJoCo documentation, Computation, Constraint model; Hairer, Nørsett and Wanner, Solving Ordinary
Differential Equations I, section I.14.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.recorded_steps import RecordedSteps
from serpent_twin.engine.smooth_dynamics import LinearisedInstant, SmoothDynamics
from serpent_twin.engine.steps_of_friction import Constants, Rubbing, rubbing
from serpent_twin.engine.steps_of_springs import StretchedSprings

_SLOW = 0.05
"""Speed at which new friction has its full size, of the joint's own rms: it changes its sign softly"""


@dataclass(frozen=True)
class RowChanges:
    """What changes in a row do to the next row's state, in R rows of S runs: D states, which are angles,
    rates and activations of n free degrees of freedom.
    """

    A: Array
    """Change of the next row's state by the states, (S, R, D, D)"""
    by_force: Array
    """Change of the next row's state by a force on each degree of freedom during each of P parts of the row,
    (n, P, S, R, D)
    """
    by_friction: Array
    """Change of the next row's state by dry friction of each degree of freedom, (n, S, R, D)"""
    by_slack: Array
    """Change of the next row's state by the slack of each tendon with a spring, (L, S, R, D)"""
    by_command: Array
    """Change of the next row's state by each actuator's command, (nu, S, R, D)"""
    by_friction_of: Array
    """Change of the next row's state by dry friction as other twins have it, (Q, S, R, D)"""
    inertia: Array
    """Inertia of all degrees of freedom in each part of a row, (P, S, R, nv, nv)"""
    passive: Array
    """Forces of springs and dampers of other twins beyond its own, (L, S, R, P, n)"""

    @classmethod
    def of(
        cls,
        models: Sequence[mujoco.MjModel],
        steps: RecordedSteps,
        dt: Array,
        off: NDArray[np.int32],
        free: Sequence[int],
        others: Sequence[Sequence[mujoco.MjModel]] = (),
        sprung: Sequence[Sequence[mujoco.MjModel]] = (),
    ) -> "RowChanges":
        """Changes in S runs of some models in time steps of a length [s], (S,), with actuators off in rows,
        (S, R), where only some degrees of freedom are free; by friction of the runs of Q other twins, and by
        springs and dampers of those of L, which differ in nothing else.
        """
        (S, R, _, nv), P, n = steps.position.shape, len(steps.middle), len(free)
        smooth = SmoothDynamics.at(list(_instants(models, steps, dt, off, free, sprung)))
        at = np.array(free, int)
        elsewhere = _ElsewhereConstants.of(models, others, dt, at, R)
        rows = _ChangedRows(models, steps, smooth, dt, at, elsewhere.constants)
        out = rows.carried()
        out = np.moveaxis(out.reshape(S, R, *out.shape[1:]), -1, 0)
        sizes = [rows.D, n * P, n, rows.tendons, models[0].nu]
        states, force, friction, slack, command, others_have = np.split(out, np.cumsum(sizes))
        return cls(
            A=np.moveaxis(states, 0, -1),
            by_force=force.reshape(n, P, S, R, rows.D),
            by_friction=friction,
            by_slack=slack,
            by_command=command,
            by_friction_of=elsewhere.among_all(others_have),
            inertia=np.moveaxis(smooth.mass.reshape(S, R, P, nv, nv), 2, 0),
            passive=np.moveaxis(smooth.passive[..., at].reshape(S, R, P, len(sprung), n), 3, 0),
        )


def _instants(
    models: Sequence[mujoco.MjModel],
    steps: RecordedSteps,
    dt: Array,
    off: NDArray[np.int32],
    free: Sequence[int],
    sprung: Sequence[Sequence[mujoco.MjModel]],
) -> Iterator[LinearisedInstant]:
    (S, R, _, _), P = steps.position.shape, len(steps.middle)
    for s, t, p in np.ndindex(S, R, P):
        k = steps.middle[p]
        yield LinearisedInstant(
            model=models[s],
            timestep=float(dt[s]),
            qpos=steps.position[s, t, k],
            qvel=steps.velocity[s, t, k],
            qacc=steps.acceleration[s, t, k],
            act=steps.act[s, t, p],
            ctrl=steps.ctrl[s, t, p],
            history=steps.history[s, t, p],
            time=steps.time[s, t, p, 0],
            fields={name: of[s, t, p] for name, of in steps.fields.items()},
            free=free,
            off=int(off[s, t]),
            sprung=[of[s] for of in sprung],
        )


@dataclass(frozen=True)
class _ElsewhereConstants:
    """Constants of friction of those of Q other twins in which they differ from a twin's."""

    constants: Constants
    """(N, F, those)"""
    which: Sequence[int]
    count: int
    """Q"""

    @classmethod
    def of(
        cls,
        models: Sequence[mujoco.MjModel],
        others: Sequence[Sequence[mujoco.MjModel]],
        dt: Array,
        free: NDArray[np.intp],
        rows: int,
    ) -> "_ElsewhereConstants":
        """Constants for so many rows of each of S runs, in time steps [s], (S,)."""
        where = rubbing(models, free)
        here = Constants.of(models, *where, dt)
        there = [Constants.of(other, *where, dt) for other in others]
        which = [q for q, of in enumerate(there) if of.differ(here)]
        several = [there[q].repeated(rows) for q in which]
        return cls(Constants.stacked(several, here.repeated(rows).limit), which, len(others))

    def among_all(self, changes: Array) -> Array:
        """Changes, (those, …), with zeros for the other twins, (Q, …)."""
        out = np.zeros((self.count, *changes.shape[1:]))
        out[self.which] = changes
        return out


class _ChangedRows:
    """N rows side by side, each with the changes of its state by M things, (N, D, M)."""

    def __init__(
        self,
        models: Sequence[mujoco.MjModel],
        steps: RecordedSteps,
        smooth: SmoothDynamics,
        dt: Array,
        free: NDArray[np.intp],
        elsewhere: Constants,
    ) -> None:
        model, (_, R, _, nv) = models[0], steps.position.shape
        self._n, self._na, self._nu = len(free), model.na, model.nu
        self.D = 2 * self._n + self._na
        self._dt, self._part = dt.repeat(R)[:, None, None], steps.part
        P, N = len(steps.middle), len(self._dt)

        def parts(of: Array) -> Array:
            return np.moveaxis(of.reshape(N, P, *of.shape[1:]), 1, 0)

        def among_free(of: Array) -> Array:
            return parts(of)[..., free, :][..., free]

        self._mass, self._held = among_free(smooth.mass), among_free(smooth.held)
        self._unheld = np.linalg.inv(self._mass + self._dt * among_free(smooth.implicit))
        self._by_v = among_free(smooth.by_velocity)
        act, self._command = (parts(of)[:, :, free] for of in (smooth.by_act, smooth.by_control))
        by_q = among_free(smooth.by_position)
        self._by_state = np.concatenate([-by_q, -self._by_v, act], axis=-1)
        rates = parts(smooth.act_by)
        q, v, more = rates[..., free], rates[..., nv + free], rates[..., 2 * nv :]
        self._rates, arms = np.concatenate([q, v, more], axis=-1), parts(smooth.arms)
        self._rubbing = Rubbing.of(models, steps, arms, dt, free)
        self._elsewhere = elsewhere
        self._springs = StretchedSprings.of(models, steps, arms[..., free])
        self.tendons = len(self._springs.which)
        rate = steps.velocity[..., free].reshape(N, -1, self._n)
        self._new = against(rate)

    def carried(self) -> Array:
        """Changes of the next row's state by states, forces in parts, friction, slack, commands and friction
        of other twins, (N, D, M).
        """
        n, D, P = self._n, self.D, len(self._mass)
        sizes = [D, n * P, n, self.tendons, self._nu, self._elsewhere.limit.shape[-1]]
        _, force, friction, slack, command, elsewhere = _slices(sizes)
        out = np.zeros((len(self._dt), D, sum(sizes)))
        out[:, range(D), range(D)] = 1.0
        answers = _Answers(self)
        for k, p in enumerate(self._part.tolist()):
            answer, by_state = answers.at(p, k)
            pushed = by_state @ out
            pushed[:, range(n), force.start + P * np.arange(n) + p] += 1.0
            pushed[:, range(n), np.arange(n) + friction.start] += self._rubbing.more(
                k, self._new[:, k]
            )
            pushed[:, :, slack] += self._springs.slack(p, k)
            pushed[:, :, command] += self._command[p]
            pushed[:, :, elsewhere] += self._rubbing.otherwise(p, k, self._elsewhere)
            rates = self._rates[p][..., :D] @ out
            rates[:, :, command] += self._rates[p][..., D:]
            out[:, n : 2 * n] += self._dt * (answer @ pushed)
            out[:, :n] += self._dt * out[:, n : 2 * n]
            out[:, 2 * n :] += self._dt * rates
        return out

    def spring(self, by_state: Array, p: int, k: int) -> None:
        """Write the forces by angles in a time step, (N, n, D)."""
        n = self._n
        self._springs.change(by_state[..., :n], p, k, self._by_state[p][..., :n])

    def smooth(self, p: int) -> Array:
        """Forces by the state in a part of the rows, (N, n, D)."""
        return self._by_state[p].copy()

    def sticks(self, k: int) -> NDArray[np.bool_]:
        """Which frictions stick in a time step, (N, F)."""
        return self._rubbing.sticks[:, k]

    def answers(
        self, p: int, which: NDArray[np.bool_], sticks: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Accelerations by forces, and forces by rates, of some rows in which friction sticks, (m, n, n)."""
        inertia, damper = self._rubbing.of_sticking(p, which, sticks)
        held, eye = self._held[p, which] + inertia, np.eye(self._n)
        takes = held @ np.linalg.inv(self._mass[p, which] + held)
        return self._unheld[p, which] @ (eye - takes), -self._by_v[p, which] - damper


class _Answers:
    """What rows answer to forces and states, computed anew where friction begins or ceases to stick."""

    def __init__(self, rows: _ChangedRows) -> None:
        self._rows, self._part = rows, -1

    def at(self, p: int, k: int) -> tuple[Array, Array]:
        """Accelerations by forces, (N, n, n), and forces by states, (N, n, D), in a time step of a part."""
        sticks = self._rows.sticks(k)
        if p != self._part:
            self._by_state = self._rows.smooth(p)
            n = self._by_state.shape[1]
            self._answer = np.empty((len(sticks), n, n))
            changed = np.full(len(sticks), True)
        else:
            changed = (sticks != self._sticks).any(axis=1)
        n, self._part, self._sticks = self._answer.shape[1], p, sticks
        if changed.any():
            found = self._rows.answers(p, changed, sticks[changed])
            self._answer[changed], self._by_state[changed, :, n : 2 * n] = found
        self._rows.spring(self._by_state, p, k)
        return self._answer, self._by_state


def against(rate: Array) -> Array:
    """Sides of new friction of joints [1] at their rates, (…, n): opposite, and less where they are slow."""
    rms = np.sqrt(np.nanmean(rate**2, axis=tuple(range(rate.ndim - 1))))
    return -np.tanh(np.nan_to_num(rate) / np.maximum(_SLOW * rms, 1e-9))


def _slices(sizes: Sequence[int]) -> list[slice]:
    """Slices of parts that lie one after the other."""
    ends = np.cumsum(sizes).tolist()
    return [slice(end - size, end) for end, size in zip(ends, sizes, strict=True)]
