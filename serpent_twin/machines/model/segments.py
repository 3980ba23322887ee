"""Cut a session into the segments that are simulated and judged one by one."""

from itertools import pairwise
from math import ceil

import numpy as np

from serpent_twin.machines.model.description import MOTION, Described
from serpent_twin.machines.model.starts import LEAD, measured_joints
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Stretch

_FEWEST = 2
"""Rows of a segment"""
_LEAD = 4
"""Poses before a segment that are sought, so that what remembers its past has one"""
_POSES, ROWS = 20, 100
"""Rows of a segment of poses, and of a motion"""


def segments(machine: Described, run: Log) -> list[Stretch]:
    """A session in parts of nearly one length, each after a lead in which nothing counts as measured; whole,
    if a motion can start from its first row only.
    """
    about, moves = machine.about, machine.about.rows == MOTION
    whole = moves and not measured_joints(machine)
    parts = 1 if whole else ceil(len(run) / (about.segment or (ROWS if moves else _POSES)))
    lead = 0 if whole or about.start else LEAD if moves else _LEAD
    ends = np.linspace(lead if moves else 0, len(run), parts + 1).round().astype(int).tolist()
    found = [Stretch(run, max(0, at - lead), end, (at, end)) for at, end in pairwise(ends)]
    return [each for each in found if each.end - each.first >= _FEWEST]
