"""Read the arrays of a .npz file as `numpy.savez` writes it, without pickles.

Nothing is made of the size that a header claims before as many bytes are found in the file.
"""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from numpy.lib.format import read_array_header_1_0, read_magic
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.stored.source import require_file
from serpent_twin.stored.words import names

MOST_ARRAYS = 4_000_000_000
"""Bytes of a .npz file: a trace at 100 Hz keeps a derivative of one"""
Arrays = dict[str, NDArray[Any]]
_KINDS = ("<f4", "<f8", "<i4", "<i8", "|b1")


def read_arrays(path: Path, advice: str = "") -> Arrays:
    """All arrays of a file, by name; raises a `SerpentError` that names the file and the array."""
    require_file(path, MOST_ARRAYS, advice)
    try:
        with ZipFile(path) as archive:
            entries = archive.infolist()
            plain = all(
                e.compress_type == ZIP_STORED and e.filename[-4:] == ".npy" for e in entries
            )
            if not plain or sum(each.file_size for each in entries) > path.stat().st_size:
                raise ValueError
            raw = {each.filename[:-4]: archive.read(each) for each in entries}
        if len(raw) < len(entries):
            raise ValueError
    except Exception:  # of a forged archive, zipfile raises whatever its parts come upon
        raise SerpentError(
            f"{path} is not a whole .npz file: torn, damaged or something else. {advice}".rstrip()
        ) from None
    return {name: _array(each, f"{path}: the array {name}", advice) for name, each in raw.items()}


def _array(raw: bytes, where: str, advice: str) -> NDArray[Any]:
    """An array of as many numbers as there are bytes for, whatever its header says."""
    stream, why = BytesIO(raw), "has no header that numpy writes"
    try:
        version = read_magic(stream)
        shape, by_columns, kind = read_array_header_1_0(stream)
        if version == (1, 0) and (kind.str in _KINDS or kind.kind == "U"):
            has = f"{len(raw) - stream.tell():,} bytes"
            why = f"is said to be {kind} of shape {shape}, and has {has}"
            flat = np.frombuffer(raw, kind, offset=stream.tell())
            return flat.reshape(shape, order="F" if by_columns else "C").copy()
    except Exception:  # numpy parses a forged header as Python, with all that this may raise
        pass
    raise SerpentError(f"{where} {why}. {advice}".rstrip())


@dataclass(frozen=True)
class Numbers:
    """What an array must hold: finite numbers of a shape."""

    shape: tuple[int, ...]
    low: float = -np.inf
    """They are at least that"""
    divides: bool = False
    """They are positive: something is divided by them"""
    unknown: bool = False
    """Whether NaN may stand for one that is not known"""
    covariance: bool = False
    """The last two axes are matrices that can be covariances: symmetric, of no negative variance"""


def require_arrays(
    arrays: Arrays, wanted: dict[str, Numbers], where: str, advice: str = ""
) -> Arrays:
    """The arrays, if they are those that are wanted; a `SerpentError` names the first that is not."""
    if odd := sorted(wanted.keys() - arrays.keys()):
        raise SerpentError(f"{where} lacks {', '.join(odd)}. {advice}".rstrip())
    if odd := sorted(arrays.keys() - wanted.keys()):
        raise SerpentError(f"{where} has {names(odd)}, which is unknown there. {advice}".rstrip())
    for name, each in wanted.items():
        if why := _amiss(arrays[name], each):
            raise SerpentError(f"{where}: {name} {why}. {advice}".rstrip())
    return arrays


def _amiss(array: NDArray[Any], wanted: Numbers) -> str:
    """What is wrong with an array, if something is."""
    if array.shape != wanted.shape:
        return f"is of shape {array.shape}; it must be {wanted.shape}"
    if array.dtype.kind != "f":
        return f"is of type {array.dtype}; it must be float32 or float64"
    values = array[~np.isnan(array)] if wanted.unknown else array
    if not np.isfinite(values).all():
        return "holds NaN" if np.isnan(values).any() else "holds Infinity"
    if (values < wanted.low).any() or (wanted.divides and (values <= 0).any()):
        least = "positive" if wanted.divides else f"at least {wanted.low:g}"
        return f"holds {values.min():g}; its numbers must be {least}"
    return _no_covariance(array) if wanted.covariance else ""


def _no_covariance(array: NDArray[Any]) -> str:
    missing = np.isnan(array).reshape(-1, array.shape[-1] ** 2)
    if (missing.any(axis=1) & ~missing.all(axis=1)).any():
        return "has a covariance that is known in part"
    known = array.reshape(-1, *array.shape[-2:])[~missing.any(axis=1)]
    scale = np.abs(known).max(initial=0.0)
    even = np.allclose(known, np.swapaxes(known, -1, -2), rtol=0, atol=1e-9 * scale)
    if not even or (np.linalg.eigvalsh(known) < -1e-9 * scale).any():
        return "is no covariance: it is not symmetric, or a variance is negative"
    return ""
