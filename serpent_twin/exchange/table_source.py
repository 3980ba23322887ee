"""Read a table, whose columns are the fields of its one stream."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from serpent_twin import tables
from serpent_twin.arrays import Array
from serpent_twin.exchange.messages import Mask, Messages, Recorded, unknown_field
from serpent_twin.tables.times import is_time

_ADVICE = "Leave it out."


class TableSource:
    """A table is one recording."""

    about = f"a table, {', '.join(tables.ENDINGS)}"

    def reads(self, path: Path) -> bool:
        """Whether it has a table's name."""
        return path.is_file() and tables.reads(path)

    def recordings(self, path: Path, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The table, by its file's name."""
        table = tables.read(path, _ADVICE)
        return {tables.stem(path): {"": messages_of(table, np.ones(table.rows, bool))}}


def messages_of(table: tables.DataTable, rows: Mask) -> Messages:
    """Some rows of a table as messages."""
    stamps = {name: "s" for name, values in table.columns.items() if _states_time(values)}

    def field(name: str) -> Array:
        if name not in table:
            raise unknown_field(name, list(table.columns))
        read = table.seconds if name in stamps else table.numbers
        return read(name, advice="Name another one.")[rows]

    unknown = np.full(int(rows.sum()), np.nan)
    units = dict(table.units) | stamps
    return Messages(unknown, field, list(table.columns), units=units, notes=table.notes)


def _states_time(values: tables.table.Column) -> bool:
    """Whether a column has time stamps, or texts that are times."""
    if values.dtype.kind in "mM":
        return True
    first = (
        next((each for each in values if each is not None), None)
        if values.dtype.kind == "O"
        else None
    )
    return first is not None and is_time(str(first))


SOURCE = TableSource()
