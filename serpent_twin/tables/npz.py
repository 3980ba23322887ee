"""Read the arrays of a .npz file, as numpy.savez and savez_compressed write it, as columns."""

import zipfile
from pathlib import Path

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.stored import require_file
from serpent_twin.tables.table import MOST_BYTES, DataTable, by_length


def read(path: Path, advice: str) -> DataTable:
    """The table of a .npz file; pickles in it are not read."""
    require_file(path, MOST_BYTES, advice)
    arrays = {}
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(each.file_size for each in archive.infolist()) > MOST_BYTES:
                raise SerpentError(f"{path} unpacks to more than {MOST_BYTES:,} bytes. {advice}")
        with np.load(path, allow_pickle=False) as file:
            for name in file.files:
                try:
                    arrays[name] = file[name]
                except ValueError:  # of objects, which only a pickle could hold
                    continue
    except SerpentError:
        raise
    except Exception:  # of a forged archive, zipfile raises whatever its parts come upon
        raise SerpentError(
            f"{path} is not a whole .npz file: torn, damaged or something else. {advice}".rstrip()
        ) from None
    columns, lengths = by_length(
        {n: each for n, each in arrays.items() if each.dtype.kind in "fiubmMU"}
    )
    if not columns:
        raise SerpentError(f"{path} has no arrays of numbers. {advice}".rstrip())
    texts = {n: each.astype(object) for n, each in columns.items() if each.dtype.kind == "U"}
    return DataTable(path, columns | texts, lengths=lengths)
