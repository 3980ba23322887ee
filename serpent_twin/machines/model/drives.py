"""Tell actuators what the columns of a log say, effects included, row by row."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import ClassVar

import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import CABLE, Effect, Instant
from serpent_twin.effects.law import ACTUATOR_COMMAND, Law
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.clocks import clocks_of, session_time
from serpent_twin.machines.model.coordinates import SCALE, zero_of
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION
from serpent_twin.machines.model.full_rate import full_rate
from serpent_twin.machines.model.state_effects import acts_on_state
from serpent_twin.tables.segments import Segments

PARTS = 4
"""Fewest parts of a motion's row, in each of which effects may change commands anew"""


def commands(machine: Described, pieces: Segments, every: int = 1) -> Array:
    """What the log tells the actuators, so many times in each row, (S, T every, nu)."""
    S, T = pieces.time.shape
    out = np.tile(machine.keyframe_controls, (S, T * every, 1))
    for each in machine.commanded:
        told = full_rate(pieces.column, each.column, every)
        out[..., machine.model.actuator(each.actuator).id] = told
    return out


def controls(
    machine: Described, there: Sequence[Effect], x: Mapping[str, float], pieces: Segments
) -> Array:
    """What the drives tell the actuators, (S, T, nu), at coordinates `x` of the fit.

    In parts of rows, (S, T parts, nu), where the log has further commands between the rows that are used, and
    where effects act on a motion: its drives hold what they are told until the next row, and what is late
    changes between rows.
    """
    moves = machine.about.rows == MOTION
    model, every = machine.model, machine.about.every if moves else 1
    start, logged = machine.keyframe_controls, commands(machine, pieces, every)
    told = logged.copy()
    for each in machine.commanded:
        n = model.actuator(each.actuator).id
        away = logged[..., n] - start[n]
        zero = 0.0 if each.exact else machine.control_unit(each)[1] * x[zero_of(each)]
        scaled = machine.is_servo(each.actuator) and not each.exact
        scale = np.exp(x[SCALE]) if scaled else 1.0
        told[..., n] = start[n] + scale * away + zero
    of_drives = [e for e in there if e.acts_at < CABLE and not acts_on_state(e, model)]
    of_drives = [e for e in of_drives if e.at not in machine.winches]
    several = effects.stacked([of_drives] * len(told))
    if not several:
        return told
    names = {"actuator": [model.actuator(n).name for n in range(model.nu)]}
    force = np.abs(model.actuator_gainprm[:, 0] * model.actuator_gear[:, 0])
    finer = ceil(PARTS / every) if moves else 1
    parts = every * finer
    ahead, dt = every * np.asarray(np.gradient(told, axis=1)), pieces.period[:, None] / parts
    told, ahead, logged = (np.repeat(each, finer, axis=1) for each in (told, ahead, logged))
    time, prior = session_time(pieces), clocks_of(pieces).prior_runtime[:, None]
    memory: list[object] = []
    for t in range(told.shape[1]):
        now = told[:, t]
        now_at = time[:, t // parts, None] + t % parts * dt
        moment = DrivenMoment(
            names, dt, now_at, prior, force, logged[:, t], ahead[:, t], now.copy()
        )
        memory = memory if t else effects.begin(several, moment)
        effects.act(several, moment, memory)
        told[:, t] = moment.winch_angle
    return told


class ToldBefore:
    """Controls of the last few twins. Most twins of a derivative have the same, and effects on them take
    long: they go through all rows one by one.
    """

    _MOST = 16

    def __init__(self) -> None:
        self._found: dict[Hashable, Array] = {}

    def of(self, twin: Hashable, pieces: Segments, find: Callable[[], Array]) -> Array:
        """What was found of such a twin in such runs, or is found now."""
        logged = [(name, hash(of.tobytes())) for name, of in pieces.column.items()]
        key = twin, *logged, pieces.time.tobytes(), pieces.period.tobytes()
        if key not in self._found:
            if len(self._found) >= self._MOST:
                del self._found[next(iter(self._found))]
            self._found[key] = find()
        return self._found[key]


@dataclass
class DrivenMoment(Instant):
    """One row of n runs, or a part of one; arrays are (n, nu), one number an actuator."""

    given: ClassVar[frozenset[str]] = frozenset(
        {"names", "dt", "time", "prior_runtime", "force_per_control", "command", "motor_velocity"}
    )
    followed: ClassVar[tuple[str, ...]] = (ACTUATOR_COMMAND,)
    changed: ClassVar[tuple[str, ...]] = (ACTUATOR_COMMAND,)
    usual_kind: ClassVar[str] = "actuator"
    has_places: ClassVar[bool] = True

    names: Mapping[str, Sequence[str]]
    """Names of the actuators, (nu,), by their kind"""
    dt: Array
    """Time to the next moment [s], (n, 1)"""
    time: Array
    """Time since the session began [s], (n, 1)"""
    prior_runtime: Array
    """Time from the beginning of the log to that of the session [s], (n, 1)"""
    force_per_control: Array
    """Force per unit of the control of an actuator whose control is a force [N m or N], (nu,)"""
    command: Array
    """What the log tells the actuators [m, rad or 1]"""
    motor_velocity: Array
    """Change from row to row of what reaches them [m or rad]"""

    winch_angle: Array
    """What reaches them: that with the scale and zeros of the fit, unless effects change it [m, rad or 1]"""

    @property
    def goal(self) -> Array:
        """Commands that reach the actuators [m, rad or 1], for effects that delay them: `winch_angle`."""
        return self.winch_angle

    @goal.setter
    def goal(self, goal: Array) -> None:
        self.winch_angle = goal

    @property
    def drive_torque(self) -> Array:
        """What actuators that are told a force give [N m or N]."""
        return self.winch_angle * self.force_per_control

    @drive_torque.setter
    def drive_torque(self, force: Array) -> None:
        self.winch_angle = force / self.force_per_control

    def reading_of(self, law: Law) -> Array:
        """What a law follows, (n, 1); raises a `SerpentError` of one that remembers."""
        if not law.possible:
            raise SerpentError(f"no command here follows the {law.depends_on}.")
        return super().reading_of(law)

    def add(self, handle: str, place: str, size: Array) -> None:
        """Add a size (n, 1) to what reaches one actuator."""
        self.at(place).winch_angle += size
