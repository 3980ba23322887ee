"""Make poses of the rows of a log."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.clocks import CLOCK_BEGAN
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.doubts import FEWEST
from serpent_twin.machines.model.log_rows import RawLog, alike
from serpent_twin.numerals import counted, listed
from serpent_twin.tables.log import Log


def poses(
    machine: Described, whole: Log, several: Sequence[RawLog], labels: NDArray[Any] | None
) -> tuple[list[Log], list[str]]:
    """Poses row by row; those without a command are left out, and that is said."""
    if len(several) > 1:
        raise SerpentError(
            f"{listed(each.path for each in several)} hold columns of the same poses. Put them into one "
            "table."
        )
    one = several[0]
    kept = np.isfinite(one.of((*one.drives, "time"))).all(axis=0)
    if kept.sum() < FEWEST:
        raise SerpentError(
            f"{one.path} has {counted(int(kept.sum()), 'row')} in which all drives have a number, fewer than "
            f"{FEWEST}. Leave it out."
        )
    time = one.time[kept]
    if not (np.diff(time) > 0).all():
        row = int(np.flatnonzero(kept)[np.argmin(np.diff(time) > 0) + 1]) + 1
        raise SerpentError(
            f"{one.path}: {one.clock!r} does not increase in row {row}. Sort the rows, split the log there, "
            "or leave the column out of machine.toml: then poses are counted."
        )
    columns = {name: values[kept] for name, values in one.columns.items()}
    columns["time"] = time - time[0]
    run = replace(whole, metadata=whole.metadata | {CLOCK_BEGAN: time[0]}, columns=columns)
    left = int((~kept).sum())
    notes = [f"{one.path}: {counted(left, 'row')} without a command left out."] if left else []
    return ([run] if labels is None else _by_label(run, labels[kept])), notes


def _by_label(whole: Log, labels: NDArray[Any]) -> list[Log]:
    """A log in parts, each of one label."""
    return [replace(whole[rows], label=str(labels[rows.start])) for rows in alike(labels)]
