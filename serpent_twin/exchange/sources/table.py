"""Read a CSV or Parquet table, whose columns are the fields of its one stream."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Messages, Recorded, unknown_field

_ADVICE = "Leave it out."


class TableSource:
    """A table is one recording."""

    about = "a table, .csv or .parquet"
    extra = ""

    def reads(self, path: Path) -> bool:
        """Whether it has a table's name."""
        return path.is_file() and path.suffix in (".csv", ".parquet")

    def recordings(self, path: Path, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The table, by its file's name."""
        columns = stored.read_columns(path, _ADVICE)

        def field(name: str) -> Array:
            if name not in columns:
                raise unknown_field(name, list(columns))
            if columns[name].dtype.kind not in "fiub":
                raise SerpentError(f"the column {name!r} holds no numbers. Name another one.")
            return columns[name].astype(float)

        rows = len(next(iter(columns.values()), ()))
        return {path.stem: {"": Messages(np.full(rows, np.nan), field, list(columns))}}


SOURCE = TableSource()
