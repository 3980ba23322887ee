"""Read a LeRobot data set, whose tables hold a row for each frame of each episode."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Messages, Recorded, unknown_field

_EPISODE, _TIME = "episode_index", "timestamp"
_PART = re.compile(r"(.+)\[(\d+)\]")


class LeRobotSource:
    """An episode is one recording."""

    about = "a LeRobot data set, a folder with meta/info.json"
    extra = ""

    def reads(self, path: Path) -> bool:
        """Whether it looks like a data set."""
        return (path / "meta" / "info.json").is_file()

    def recordings(self, path: Path, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The episodes, in their order."""
        files = sorted((path / "data").rglob("*.parquet"))
        if not files:
            raise SerpentError(f"{path} holds no tables: data/ is empty. Download them.")
        found: dict[str, Recorded] = {}
        for file in files:
            try:
                table = pq.read_table(file)
            except (pa.ArrowException, OSError) as error:
                raise SerpentError(f"{file} cannot be read: {error}. Download it again.") from None
            if lacking := [n for n in (_EPISODE, _TIME) if n not in table.column_names]:
                raise SerpentError(f"{file} has no {lacking[0]}. Give a LeRobot data set.")
            episode = table.column(_EPISODE).to_numpy()
            for number in dict.fromkeys(episode.tolist()):
                rows = table.filter(pa.array(episode == number))
                found[f"episode_{number:06d}"] = {"": _messages(rows)}
        return dict(sorted(found.items()))


def _messages(rows: pa.Table) -> Messages:
    fields = [name for column in rows.column_names for name in _names(rows, column)]

    def field(path: str) -> Array:
        whole = _PART.fullmatch(path)
        if path not in fields:
            raise unknown_field(path, fields)
        if whole is None:
            return rows.column(path).to_numpy().astype(float)
        column, part = whole[1], int(whole[2])
        return np.array([each[part] for each in rows.column(column).to_pylist()], float)

    return Messages(rows.column(_TIME).to_numpy().astype(float), field, fields)


def _names(rows: pa.Table, column: str) -> list[str]:
    """Paths of the numbers in a column."""
    kind: Any = rows.schema.field(column).type
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        return [column]
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind):
        first = rows.column(column)[0].as_py() or []
        return [f"{column}[{n}]" for n, each in enumerate(first) if isinstance(each, int | float)]
    return []


SOURCE = LeRobotSource()
