"""Read a measured log of another machine.

One run is one Parquet file of float columns in SI units, `time` among them; its metadata, JSON under
the key `measured`, state how it was driven. The file's name carries no information.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.tables import parquet
from serpent_twin.tables.log import Log

KEY = b"measured"
FEWEST = 50
_OTHER = "Name another --rig or --logs."


def read(path: Path, columns: Sequence[str]) -> Log:
    """Read one run that must have these columns, or raise a `SerpentError`."""
    table = parquet.read(path, "Copy it again.")
    raw = table.metadata.get(KEY)
    if raw is None:
        raise SerpentError(
            f"{path} has no metadata under the key measured: it is no log of this kind. Leave it out."
        )
    about = stored.parse_json(raw, dict[str, Any], f"{path}: the metadata")
    if lacking := [c for c in columns if c not in table.columns]:
        raise SerpentError(f"{path} lacks {', '.join(lacking)}: it is of another machine. {_OTHER}")
    if odd := [c for c, values in table.columns.items() if values.dtype.kind not in "fiub"]:
        raise SerpentError(
            f"{path}: the columns {stored.names(odd)} hold no numbers. Leave it out."
        )
    found = {c: values.astype(float) for c, values in table.columns.items()}
    _check(path, found, columns)
    found["time"] -= found["time"][0]
    return Log(path, about, found)


def read_runs(folder: Path, columns: Sequence[str]) -> list[Log]:
    """Read all runs of a folder, by name, or that of a file."""
    if folder.exists() and not folder.is_dir():
        return [read(folder, columns)]
    if not folder.is_dir():
        raise SerpentError(f"There is no folder {folder}. Name the folder with the machine's logs.")
    files = sorted(folder.glob("*.parquet"))
    if not files:
        raise SerpentError(
            f"There is no *.parquet in {folder}. Name the folder with the machine's logs."
        )
    return [read(path, columns) for path in files]


def _check(path: Path, columns: dict[str, Array], needed: Sequence[str]) -> None:
    time = columns["time"]
    if len(time) < FEWEST:
        raise SerpentError(
            f"{path} has {counted(len(time), 'row')}, fewer than {FEWEST}. Leave it out."
        )
    if not (np.diff(time) > 0).all():
        raise SerpentError(
            f"{path}: time does not increase throughout. Repair or leave out the file."
        )
    if odd := [c for c in needed if not np.isfinite(columns[c]).all()]:
        raise SerpentError(
            f"{path}: {', '.join(odd)} are not finite in every row. Repair or leave out the file."
        )
