"""Keep commands at a log's full rate where one reading is used of several rows."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION
from serpent_twin.tables.log import Log


def thinned(machine: Described, run: Log) -> Log:
    """One row of so many, with further columns of the commands in the rows between: a command holds until
    the next row of the file. Where rows are poses, what was told between has no effect.
    """
    every = machine.about.every
    rows = np.arange(0, len(run), every)
    between = {
        _between(name, n): run.columns[name][np.minimum(rows + n, len(run) - 1)]
        for name in command_columns(machine)
        for n in range(1, every if machine.about.rows == MOTION else 1)
    }
    kept = {name: values[::every] for name, values in run.columns.items()}
    return replace(run, columns=kept | between)


def full_rate(columns: Mapping[str, Array], name: str, every: int) -> Array:
    """A column at the full rate, (..., T every), from columns that `thinned` made, (..., T); each value
    repeated where there are none of rows between.
    """
    values = [columns.get(_between(name, n), columns[name]) for n in range(every)]
    return np.stack(values, axis=-1).reshape(*columns[name].shape[:-1], -1)


def held(machine: Described, columns: Mapping[str, Array]) -> dict[str, Array]:
    """The further columns that `thinned` makes, of commands that change in the rows alone that are used."""
    every = machine.about.every
    names = command_columns(machine) if machine.about.rows == MOTION else []
    return {_between(name, n): columns[name] for name in names for n in range(1, every)}


def columns_between(machine: Described) -> Sequence[str]:
    """Names of the further columns that `thinned` makes."""
    names = command_columns(machine)
    return [_between(name, n) for name in names for n in range(1, machine.about.every)]


def command_columns(machine: Described) -> list[str]:
    """The columns that command actuators, each once."""
    return list(dict.fromkeys(each.column for each in machine.commanded))


def _between(name: str, n: int) -> str:
    return f"{name}, {n} rows later" if n else name
