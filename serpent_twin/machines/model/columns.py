"""Say what a log's columns are of a machine: what drives it, its pose, and what is measured beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.machine import Output
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import POSES, MeasuredColumns
from serpent_twin.machines.model.full_rate import columns_between
from serpent_twin.machines.model.held_motion import held_columns
from serpent_twin.machines.model.known_motion import without_held
from serpent_twin.machines.model.segments import ROWS, segments
from serpent_twin.machines.model.starts import start_columns
from serpent_twin.residual import Measure
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments, Stretch, cut

_BLOCK = 8
"""Rows that are judged as one sample"""


@dataclass(frozen=True)
class MachineOfColumns:
    """A machine whose logs are columns, as its machine.toml describes them."""

    described: Described
    outputs: tuple[Output, ...]
    """The channels: all coordinates of the pose, then perhaps others of one measure"""

    @property
    def name(self) -> str:
        """The machine's."""
        return self.described.name

    @property
    def drives(self) -> Mapping[str, str]:
        """What each drive moves, by its column."""
        return {each.column: each.of[1] for each in self.described.about.drive}

    @property
    def motors(self) -> tuple[Measure, ...]:
        """What each drive's column is."""
        return tuple(self.described.told(each) for each in self.described.about.drive)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that a simulation reads."""
        described = self.described
        more: tuple[str, ...] = ()
        if described.about.held:
            more = tuple(held_columns(described))
        elif described.about.moves:
            more = (*start_columns(described), *columns_between(described))
        return (*self.drives, *described.switches, *more)

    @property
    def markers(self) -> tuple[str, ...]:
        """What the pose is made of."""
        return tuple(name for each in self._of_pose(True) for name in each.names)

    @property
    def others(self) -> tuple[str, ...]:
        """What the other channels are of: each number for itself."""
        return tuple(
            name
            for one in self._of_pose(False)
            for name in ([f"{one.site} along {axis}" for axis in "xyz"] if one.site else one.names)
        )

    @property
    def places(self) -> tuple[str, ...]:
        """The thing that each output is measured at, (C,)."""
        return tuple(each.of[1] for each in self.described.about.measured for _ in each.columns)

    def _of_pose(self, wanted: bool) -> list[MeasuredColumns]:
        """What is measured of the pose, or beside it."""
        pose = self.described.pose
        return [each for each in self.described.about.measured if (each.measure == pose) == wanted]

    def pieces(self, sessions: Sequence[Log]) -> Segments:
        """Sessions in segments of some rows; whole, if a motion can start from its first row only."""
        return self.stacked([part for run in sessions for part in segments(self.described, run)])

    def stacked(self, parts: Sequence[Stretch]) -> Segments:
        """Stretches of sessions, what is measured of them as far as it says anything."""
        found = cut(parts, self.columns, [each.name for each in self.outputs])
        return without_held(self.described, found)

    def pose_noise(self, pieces: Segments) -> Array:
        """The least noise of each coordinate."""
        pose = len(self.markers) * self.outputs[0].measure.dimension
        return np.array([each.noise for each in self.outputs[:pose]])

    def block_rows(self, pieces: Segments) -> int:
        """Rows that are judged as one sample: the fewest; in sessions that are simulated whole, where a
        motion's error follows that of the rows before, about those of a usual segment, such that few rows are
        left over.
        """
        rows = pieces.time.shape[1]
        if self.described.about.rows == POSES or rows < 2 * ROWS:
            return _BLOCK
        return rows // (rows // ROWS)
