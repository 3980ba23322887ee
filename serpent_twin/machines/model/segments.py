"""Cut a session into the segments that are simulated and judged one by one."""

from collections.abc import Sequence
from itertools import pairwise
from math import ceil

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION
from serpent_twin.machines.model.starts import LEAD, measured_joints, rate_of, starts_anywhere
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments, Stretch

_FEWEST = 2
"""Rows of a segment"""
_SETTLES = 4
"""Times the rows before a segment, from which a session is long enough to have them"""
_ALIKE = 1e-9
"""Share of the greatest motion below which rows move alike: the first of these, whatever the last bits say"""
_LEAD = 4
"""Poses before a segment that are sought, so that what remembers its past has one"""
_POSES, ROWS = 20, 100
"""Rows of a segment of poses, and of a motion"""
_SEARCHED, _VALUES = (7, 16), 40_000
"""Segments of a motion by which candidates are chosen, fewest and most, and measured values that are enough:
a fit takes as long as they do
"""


def segments(machine: Described, run: Log) -> list[Stretch]:
    """A session in parts of nearly one length, each after a lead in which nothing counts as measured; whole,
    if a motion can start from its first row only.
    """
    about, moves = machine.about, machine.about.moves
    whole = moves and not starts_anywhere(machine)
    lead = 0 if whole or about.held else lead_of(machine, run)
    settles = moves and not about.held and not whole and not lead and len(run) > _SETTLES * LEAD
    first = (LEAD if settles else lead) if moves else 0
    size = about.segment or (ROWS if moves else _POSES)
    parts = 1 if whole else ceil(len(run) / size)
    ends = np.linspace(first, len(run), parts + 1).round().astype(int).tolist()
    judged = list(pairwise(ends))
    if settles:
        found = _settling(machine, run, judged)
    else:
        found = [Stretch(run, max(0, at - lead), end, (at, end)) for at, end in judged]
    return [each for each in found if each.end - each.first >= _FEWEST]


def _settling(machine: Described, run: Log, judged: Sequence[tuple[int, int]]) -> list[Stretch]:
    """Stretches of one length, as far as the log goes, that begin before what is judged of each, in the row
    in which joints move least: rows tell a quick motion's rate badly, and a machine swings on from a wrong
    one. By the first row that is judged a model has forgotten where it began.
    """
    rates = [run.columns[rate_of(joint)] for joint in measured_joints(machine)]
    moves = np.sum([(each / (np.std(each) or 1.0)) ** 2 for each in rates], axis=0)
    before = [moves[at - LEAD : at - LEAD // 2] for at, _ in judged]
    least = [int(np.argmax(each <= each.min() + _ALIKE * each.max())) for each in before]
    begins = [at - LEAD + quiet for quiet, (at, _) in zip(least, judged, strict=True)]
    most = max(end - begin for begin, (_, end) in zip(begins, judged, strict=True))
    return [
        Stretch(run, begin, min(begin + most, len(run)), each)
        for begin, each in zip(begins, judged, strict=True)
    ]


def searched(pieces: Segments) -> int:
    """How many segments of a motion a search uses."""
    fewest, most = _SEARCHED
    return int(np.clip(_VALUES // pieces.measured[0].size, fewest, most))


def lead_of(machine: Described, run: Log) -> int:
    """Rows before each segment; raises a `SerpentError` of a session that ends before they do."""
    about = machine.about
    if about.rows != MOTION:
        return _LEAD
    if not about.lead:
        return 0 if about.start else LEAD
    lead, seconds = ceil(about.lead / run.period), float(run.time[-1] - run.time[0])
    if len(run) < lead + _FEWEST:
        raise SerpentError(
            f"{run.name} lasts {seconds:.4g} s, no longer than the lead of {about.lead:g} s that "
            f"{machine.path} states. Give longer logs, or a shorter lead if the machine forgets sooner."
        )
    return lead
