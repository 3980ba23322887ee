"""Simulate short pieces of logs from logged states, to compare what columns might be."""

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import mujoco
import numpy as np
from mujoco import rollout

from serpent_twin.arrays import Array
from serpent_twin.engine.quiet import quietly
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import FORCE, SERVO, Robot

_PIECES, _SECONDS, _ROWS = 24, 0.25, 12
"""Pieces of logs that are simulated; how long each is, and how many rows at least"""
_MOST_STEPS = 40
"""Time steps of a row at most"""
_BAD = 10.0
"""Share that counts for a simulation that is unstable"""
_LEFT_OUT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT)
"""Contacts and limits, which a wrong force or a load that the model lacks would run into"""
_FAR = 1e4
"""Angle or length at which a simulation is unstable [rad or m]"""
_WRONG = 2.5
"""How many times stronger or weaker a model's motors may be than they are logged"""
Use = tuple[str, float]
"""A column, and how many SI units 1 in it is"""


@dataclass(frozen=True)
class Left:
    """What a simulation leaves of each joint's motion that its start does not say."""

    share: Mapping[str, float]
    """Root mean square by joint, 1 where the model says no more than the start"""
    of_log: Mapping[str, Array]
    """Root mean square in each log, by joint"""

    @property
    def score(self) -> float:
        """Sum of the logarithms over the joints; less is better."""
        return float(sum(np.log(np.clip(each, 0.01, _BAD)) for each in self.share.values()))


@dataclass(frozen=True, eq=False)
class ShortRuns:
    """Pieces of logs from which a model is simulated under any assignment of columns."""

    robot: Robot
    logged: Logged
    shown: dict[object, Array] = field(default_factory=dict, repr=False)
    """Simulated motions, by the columns that they begin at and are driven by"""

    @cached_property
    def rows(self) -> int:
        """Rows of a piece."""
        period = 1.0 / self.logged.rate_hz
        shortest = min(len(each.known) for each in self.logged.pieces)
        return max(2, min(max(_ROWS, round(_SECONDS / period)), shortest - 1))

    @cached_property
    def starts(self) -> list[tuple[int, int]]:
        """Log and row in which each piece begins, without gaps."""
        found = []
        for n, piece in enumerate(self.logged.pieces):
            last = len(piece.known) - self.rows - 1
            whole = np.convolve(piece.known, np.ones(self.rows + 1), "valid") > self.rows
            rows = np.flatnonzero(whole[: last + 1])
            found += [(n, int(row)) for row in rows]
        chosen = np.unique(np.linspace(0, len(found) - 1, _PIECES).round().astype(int))
        return [found[n] for n in chosen] if found else []

    def left(self, readings: Mapping[str, Use], controls: Mapping[str, Use]) -> Left:
        """What is left, if joints' readings and actuators' controls are these columns."""
        if not self.starts or not readings:
            return Left({}, {})
        readings = dict(sorted(readings.items()))
        measured, rates = self._measured(readings)
        motors = {a.name for a in self.robot.actuators if a.kind == FORCE}
        shown = self._shown(readings, controls)
        still = self._shown(readings, {n: use for n, use in controls.items() if n not in motors})
        share, of_log = {}, {}
        for k, joint in enumerate(readings):
            rest = self._curved(measured[:, 1:, k])
            alone = np.stack([self._curved(each) for each in self._errors(rates[..., k])], axis=-1)
            told = self._curved(shown[..., k] - still[..., k])
            off = _unexplained(rest - self._curved(still[..., k]), told, alone)
            share[joint], of_log[joint] = self._shares(off, _unexplained(rest, 0 * rest, alone))
        return Left(share, of_log)

    def needed(self, joint: str, reading: Use) -> float:
        """Root mean square of the force that the model says a joint's motion needs [N m or N]."""
        measured, rates = (each[..., 0] for each in self._measured({joint: reading}))
        model, _ = self._model
        data = mujoco.MjData(model)
        at, moved = self._places([joint])
        forces = []
        for s in range(len(self.starts)):
            data.qpos[at], data.qvel[moved] = measured[s, 0], rates[s, 0]
            data.qacc[moved] = (rates[s, -1] - rates[s, 0]) * self.logged.rate_hz / self.rows
            mujoco.mj_inverse(model, data)
            forces.append(float(data.qfrc_inverse[moved[0]]))
        return float(np.sqrt(np.mean(np.square(forces)))) if forces else 0.0

    def _places(self, joints: Iterable[str]) -> tuple[list[int], list[int]]:
        """Where the positions and the velocities of joints lie in the model's state."""
        several = [self.robot.model.joint(name) for name in joints]
        return [int(p.qposadr[0]) for p in several], [int(p.dofadr[0]) for p in several]

    def _shown(self, readings: Mapping[str, Use], controls: Mapping[str, Use]) -> Array:
        """What the model shows, (S, rows, J), limited where it is unstable."""
        key = (tuple(readings.items()), tuple(sorted(controls.items())))
        if key not in self.shown:
            with quietly(), np.errstate(all="ignore"):
                found = self._simulated(readings, controls)
            found = np.nan_to_num(found, nan=_FAR, posinf=_FAR, neginf=-_FAR)
            self.shown[key] = np.clip(found, -_FAR, _FAR)
        return self.shown[key]

    def _curved(self, values: Array) -> Array:
        """What straight lines leave of motions (S, rows): noise of where a piece starts is a line."""
        row = np.arange(values.shape[1], dtype=float)
        lines = np.linalg.qr(np.stack([np.ones_like(row), row], axis=1))[0]
        return values - values @ lines @ lines.T

    def _errors(self, rate: Array) -> list[Array]:
        """Motions (S, rows) that a constant force, Coulomb friction and damping add to that of a mass."""
        slow = 0.1 * float(np.sqrt((rate**2).mean())) or 1.0
        forces = (np.ones_like(rate), np.tanh(rate / slow), rate)
        return [np.cumsum(np.cumsum(each, axis=1), axis=1)[:, 1:] for each in forces]

    def _shares(self, off: Array, rest: Array) -> tuple[float, Array]:
        """Share of a motion's rms that is left, in all and by log."""
        logs = np.array([n for n, _ in self.starts])
        several = [_share(off[logs == n], rest[logs == n]) for n in np.unique(logs)]
        return _share(off, rest), np.array(several)

    def _measured(self, readings: Mapping[str, Use]) -> tuple[Array, Array]:
        """Readings and their rates in each piece [SI], (S, 1 + rows, J)."""
        found = np.empty((2, len(self.starts), 1 + self.rows, len(readings)))
        for k, (column, factor) in enumerate(readings.values()):
            smooth = self.logged.smoothed(column)
            for s, (n, row) in enumerate(self.starts):
                value, rate = smooth[n]
                found[0, s, :, k] = factor * value[row : row + self.rows + 1]
                found[1, s, :, k] = factor * rate[row : row + self.rows + 1]
        return found[0], found[1]

    def _simulated(self, readings: Mapping[str, Use], controls: Mapping[str, Use]) -> Array:
        """Joints of the model after each row, (S, rows, J)."""
        model, steps = self._model
        angle, rate = (each[:, 0] for each in self._measured(readings))
        told = self._controls(controls, dict(zip(readings, angle.T, strict=True)))
        data = mujoco.MjData(model)
        spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty((len(self.starts), mujoco.mj_stateSize(model, spec)))
        at, moved = self._places(readings)
        for s in range(len(self.starts)):
            mujoco.mj_resetData(model, data)
            data.qpos[at], data.qvel[moved] = angle[s], rate[s]
            data.ctrl[:] = told[s, 0]
            self._begin(model, data)
            mujoco.mj_getState(model, data, state[s], spec)
        shown, _ = rollout.rollout(model, data, state, np.repeat(told, steps, axis=1))
        return np.asarray(shown)[:, steps - 1 :: steps, [1 + n for n in at]]

    @staticmethod
    def _begin(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Let filters begin at the control, and integrators at the length of what they move."""
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_transmission(model, data)
        for n in range(model.nu):
            if (first := int(model.actuator_actadr[n])) >= 0:
                integrates = model.actuator_dyntype[n] == mujoco.mjtDyn.mjDYN_INTEGRATOR
                data.act[first] = data.actuator_length[n] if integrates else data.ctrl[n]

    @cached_property
    def _model(self) -> tuple[mujoco.MjModel, int]:
        """The model with time steps of which a row has a whole number, and how many."""
        period = 1.0 / self.logged.rate_hz
        steps = int(np.clip(np.ceil(period / self.robot.model.opt.timestep - 1e-6), 1, _MOST_STEPS))
        model = copy.copy(self.robot.model)
        model.opt.timestep = period / steps
        model.opt.disableflags |= _LEFT_OUT
        return model, steps

    def _controls(self, controls: Mapping[str, Use], angle: Mapping[str, Array]) -> Array:
        """Controls in each row, (S, rows, nu); without a column, a servo keeps where it is."""
        told = np.zeros((len(self.starts), self.rows, self.robot.model.nu))
        for k, each in enumerate(self.robot.actuators):
            if each.name in controls:
                column, factor = controls[each.name]
                for s, (n, row) in enumerate(self.starts):
                    told[s, :, k] = (
                        factor * self.logged.pieces[n].values[column][row : row + self.rows]
                    )
            elif each.kind == SERVO and each.joint in angle:
                told[:, :, k] = angle[each.joint][:, None] * each.gear
        return told


def _unexplained(rest: Array, told: Array, alone: Array) -> Array:
    """What is left of motions (S, rows) of what motors add, so many times as strong as a model may be wrong,
    and of forces that the model may lack, (S, rows, 3).
    """
    shape = rest.shape
    y, x, more = rest.ravel(), told.ravel(), alone.reshape(-1, alone.shape[-1])
    base = np.linalg.qr(more / np.maximum(np.linalg.norm(more, axis=0), 1e-300))[0]
    y, x = (each - base @ (base.T @ each) for each in (y, x))
    size = float(x @ x)
    gain = np.clip(float(x @ y) / size, 1 / _WRONG, _WRONG) if size > 0 else 0.0
    return (y - gain * x).reshape(shape)


def _share(off: Array, rest: Array) -> float:
    whole = float(np.sqrt((rest**2).mean())) if rest.size else 0.0
    return min(float(np.sqrt((off**2).mean())) / whole, _BAD) if whole > 0 else 1.0
