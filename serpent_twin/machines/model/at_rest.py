"""Show what a twin, its sensors included, shows at rest in every row of a log."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.machines.model.clocks import Clocks, clocks_of, session_time
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.drives import controls
from serpent_twin.machines.model.known import Factor, by_known_numbers
from serpent_twin.machines.model.known_motion import known_motion
from serpent_twin.machines.model.poses import PosedRuns, Rests
from serpent_twin.machines.model.readings import reread
from serpent_twin.machines.model.seen import Seen, beginning, joint_angles
from serpent_twin.machines.model.state_effects import acting_at_rest
from serpent_twin.tables.segments import Segments


@dataclass(frozen=True)
class TwinAtRest:
    """A twin of a machine whose rows are poses at rest."""

    machine: Described
    frame: Mapping[str, Any]
    """Frame of the cameras: its `shift` and `pivot` [m], (3,) each"""
    measured: Sequence[str]
    """The thing that each channel is of, (C,)"""
    rests: Rests
    """Poses found so far"""
    there: Sequence[Effect]
    x: Mapping[str, float]
    """Coordinates of the fit"""
    compiled: Callable[[Sequence[Factor]], mujoco.MjModel]
    """Its model, with numbers that a session states"""

    def parts(self, pieces: Segments) -> Iterator[tuple[NDArray[np.intp], PosedRuns]]:
        """Which segments have one model, and these."""
        machine, there = self.machine, self.there
        laws = acting_at_rest(there, machine.model)
        for known, which in by_known_numbers(machine, pieces).items():
            some, model = pieces.take(which), self.compiled(known)
            told, seen = controls(machine, there, self.x, some), Seen(machine, self.frame, [self.x])
            motion = known_motion(machine, self.x, some)
            begin = beginning(model, machine)
            yield np.asarray(which), PosedRuns(model, told, begin, seen, some, motion, laws)

    def shown(self, pieces: Segments) -> Array:
        """What is read of it in each row, (S, T, C); NaN where it does not come to rest."""
        machine, rows = self.machine.model, pieces.time.shape[1]
        out = np.empty((*pieces.time.shape, len(self.measured)))
        angles = {
            name: np.empty(pieces.time.shape) for name in joint_angles(machine, machine.qpos0)
        }
        for which, posed in self.parts(pieces):
            found = posed.settled(self.rests)
            out[which] = found.shown
            for name, angle in joint_angles(posed.model, found.pose).items():
                if name in angles:  # others are of effects
                    angles[name][which] = angle.reshape(-1, rows)
        return self._read(out, angles, pieces)

    def _read(self, shown: Array, angles: Mapping[str, Array], pieces: Segments) -> Array:
        """What sensors make of it: each pose is a run of one row, as time between poses is uneven."""
        S, T = pieces.time.shape
        begun, prior = session_time(pieces).ravel(), clocks_of(pieces).prior_runtime.repeat(T)
        alone = shown.reshape(S * T, 1, -1)
        each = {name: angle.reshape(S * T, 1) for name, angle in angles.items()}
        several, period = [self.there] * (S * T), np.ones(S * T)
        read = reread(several, self.measured, alone, period, Clocks(begun, prior), each)
        return read.reshape(shown.shape)
