"""Cut logs into the shortest segments, two rows, by which a fit comes near from far off."""

from collections.abc import Sequence

import numpy as np

from serpent_twin.machines.model.columns import MachineOfColumns
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION
from serpent_twin.machines.model.from_sites import placed_joints
from serpent_twin.machines.model.segments import lead_of
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments, Stretch

_ROWS = 100
"""Rows that begin a motion, some"""


def goes_on_from_sites(machine: Described) -> bool:
    """Whether a motion goes on in any row from where measured sites place its joints."""
    moves = machine.about.rows == MOTION and not machine.about.lead
    return moves and bool(placed_joints(machine))


def shortest(machine: MachineOfColumns, sessions: Sequence[Log]) -> Segments:
    """Two rows each, after what a segment's start takes, evenly from all sessions."""
    each, found = max(1, _ROWS // len(sessions)), []
    for log in sessions:
        lead = lead_of(machine.described, log)
        last = max(0, len(log) - lead - 2)
        for first in np.unique(np.linspace(0, last, each).astype(int)).tolist():
            found.append(Stretch(log, first, first + lead + 2, (first + lead, first + lead + 2)))
    return machine.stacked(found)
