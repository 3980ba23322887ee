"""Say what changes of a model's commands do to the poses in which it rests."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import ranges
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import ACTUATOR_COMMAND, Law
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.measured import Runs
from serpent_twin.machines.model.description import Described
from serpent_twin.machines.model.places import clocks_and_commands
from serpent_twin.machines.places import PlaceResponse

_SHARE = 0.1
"""Of a command's scatter in the logs, by which it is changed: dry friction takes up less"""
_STILL = 1e-9
"""Scatter [rad, m or 1] below which a command is the same in all rows"""


@dataclass(frozen=True)
class PosePlaces:
    """What S segments of T poses show of changed commands."""

    readings: Mapping[tuple[str, str], Array]
    """What laws may follow, (S, T), by the reading and its place"""
    responses: Sequence[PlaceResponse]
    """Of each command that changes"""
    starts: Array | None = None
    """Poses have no states in which they begin"""


def commands_at_rest(
    machine: Described,
    respond: Callable[[Sequence[ParameterVector], Runs], Array],
    point: ParameterVector,
    pieces: Runs,
) -> PosePlaces | None:
    """By differences: the twin is settled again for each actuator, with its command changed a little. None
    where no command changes in the log.
    """
    readings, laws, steps = clocks_and_commands(machine, pieces), [], []
    others = np.zeros(len(ranges(Discovered)) - 1)
    for (reading, name), x in readings.items():
        if reading == ACTUATOR_COMMAND and np.std(x) > _STILL:
            laws.append(Law(ACTUATOR_COMMAND, name))
            steps.append(_SHARE * float(np.std(x)))
    if not laws:
        return None
    changed = [
        point.having(f"discovered@{law}", np.array([step, *others]))
        for law, step in zip(laws, steps, strict=True)
    ]
    usual, *found = respond([point, *changed], pieces)
    responses = [
        PlaceResponse(ACTUATOR_COMMAND, law.place, np.nan_to_num((there - usual)[None] / step))
        for law, there, step in zip(laws, found, steps, strict=True)
    ]
    return PosePlaces(readings, responses)
