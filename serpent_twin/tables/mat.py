"""Read the arrays of a MATLAB file as columns; those of a struct by `struct.field`."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.stored import require_file
from serpent_twin.tables.table import MOST_BYTES, DataTable, by_length

_NEWER = b"MATLAB 7.3 MAT-file"
_REMEDY = "save('run.mat', '-struct', 'log', '-v7'), or writetable to CSV"


def read(path: Path, advice: str) -> DataTable:
    """The table of a MATLAB file of version 4 … 7; raises a `SerpentError` that says how to save others."""
    require_file(path, MOST_BYTES, advice)
    with path.open("rb") as file:
        newer = file.read(len(_NEWER)) == _NEWER
    if newer:
        raise SerpentError(
            f"{path} is of version 7.3, which is HDF5 and is not read. In MATLAB, write {_REMEDY}."
        )
    from scipy.io import loadmat

    try:
        whole = loadmat(path, simplify_cells=True)
    except Exception as error:  # of a damaged file, whatever its parts come upon
        why = " ".join(str(error).split()).rstrip(".")
        raise SerpentError(f"{path} is no whole MATLAB file: {why}. {advice}".rstrip()) from None
    arrays = dict(_arrays({k: v for k, v in whole.items() if not k.startswith("__")}))
    columns, lengths = by_length(arrays)
    if not columns:
        raise SerpentError(
            f"{path} has no arrays of numbers: tables, timetables and time series are objects that only "
            f"MATLAB reads. There, write {_REMEDY}."
        )
    return DataTable(path, columns, lengths=lengths)


def _arrays(several: dict[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, each in several.items():
        if isinstance(each, dict):
            yield from _arrays(each, f"{before}{name}.")
        elif isinstance(each, np.ndarray) and each.dtype.kind in "fiub":
            yield f"{before}{name}", each
