"""Read the arrays of a .npz file as `numpy.savez` writes it, without pickles.

Nothing is made of the size that a header claims before as many bytes are found in the file.
"""

import re
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.stored.source import require_file

MOST_ARRAYS = 4_000_000_000
"""Bytes of a .npz file: a trace at 100 Hz keeps a derivative of one"""
Arrays = dict[str, NDArray[Any]]
_HEADER = re.compile(
    r"\{'descr': '([<|][fibU]\d{1,9})', 'fortran_order': (False|True), 'shape': \(([\d, ]{0,99})\), \} *\n"
)
_MAGIC, _VERSION = b"\x93NUMPY", b"\x01\x00"
_KINDS = ("<f4", "<f8", "<i4", "<i8", "|b1")


def read_arrays(path: Path, advice: str = "") -> Arrays:
    """All arrays of a file, by name; raises a `SerpentError` that names the file and the array."""
    require_file(path, MOST_ARRAYS, advice)
    try:
        members = _members(path)
    except SerpentError:
        raise
    except Exception:  # of a forged archive, zipfile raises whatever its parts come upon
        raise SerpentError(
            f"{path} is not a whole .npz file: torn, damaged or something else. {advice}".rstrip()
        ) from None
    return {name: _array(raw, f"{path}: the array {name}", advice) for name, raw in members.items()}


def _members(path: Path) -> dict[str, bytes]:
    """The bytes of each array; of a plain archive, no more than the file has."""
    found: dict[str, bytes] = {}
    with ZipFile(path) as archive:
        entries = archive.infolist()
        if sum(each.file_size for each in entries) > path.stat().st_size:
            raise ValueError
        for each in entries:
            name = each.filename.removesuffix(".npy")
            if each.compress_type != ZIP_STORED or name in found or name == each.filename:
                raise ValueError
            found[name] = archive.read(each)
    return found


def _array(raw: bytes, where: str, advice: str) -> NDArray[Any]:
    begin = 10 + int.from_bytes(raw[8:10], "little")
    header = _HEADER.fullmatch(raw[10:begin].decode("latin-1"))
    if raw[:8] != _MAGIC + _VERSION or header is None:
        raise SerpentError(f"{where} has no header that numpy writes. {advice}".rstrip())
    kind, by_columns, lengths = header.groups()
    shape = tuple(map(int, re.findall(r"\d+", lengths)))
    if kind not in _KINDS and not re.match("<U[1-9]", kind):
        raise SerpentError(f"{where} holds {kind}, which no file of ours does. {advice}".rstrip())
    size, there = prod(shape) * np.dtype(kind).itemsize, len(raw) - begin
    if size != there or prod(max(n, 1) for n in shape) > MOST_ARRAYS or len(shape) > 8:
        said = f"is said to be of shape {lengths}, {size:.3g} bytes, and has {there:,}"
        raise SerpentError(f"{where} {said}. {advice}".rstrip())
    order = "F" if by_columns == "True" else "C"
    return np.ndarray(shape, kind, raw, begin, order=order).copy()


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
        raise SerpentError(f"{where} lacks {_listed(odd)}. {advice}".rstrip())
    if odd := sorted(arrays.keys() - wanted.keys()):
        raise SerpentError(f"{where} has {_listed(odd)}, which is unknown there. {advice}".rstrip())
    for name, each in wanted.items():
        if why := _amiss(arrays[name], each):
            raise SerpentError(f"{where}: {name} {why}. {advice}".rstrip())
    return arrays


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - 8} more" if len(names) > 8 else ""
    return ", ".join(name[:60] for name in names[:8]) + more


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
