"""Refuse logs of which one repeats another: a readout would be judged by what it was trained on."""

import hashlib
import itertools
from collections.abc import Sequence

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.tables.log import Log

SHARED = 10
"""Equal rows that make two logs one. Of 69 logs of nine simulated arms, the XL330, the jaw and the trunk, two
pairs of one machine share a row, and none shares two."""


def refuse_repeated(logs: Sequence[Log]) -> None:
    """Raise a `SerpentError` that names two logs which hold the same rows, if there are such.

    Rows are compared by their readings, as float32: whatever the clock, the markers, the metadata, the
    compression and the order of the rows are, and if only a part of a log was copied.
    """
    rows = [set(_rows(log.readings)) for log in logs]
    for (a, of_a), (b, of_b) in itertools.combinations(zip(logs, rows, strict=True), 2):
        shared, fewest = len(of_a & of_b), min(len(of_a), len(of_b))
        if shared < max(1, min(SHARED, fewest)):
            continue
        if a.path and b.path and a.path.resolve() == b.path.resolve():
            raise SerpentError(
                f"{a.path} is given twice: a result on it says nothing where it was trained on or fitted to. "
                "Give it once."
            )
        raise SerpentError(
            f"{_where(a)} and {_where(b)} hold the same readings ({shared} of {counted(fewest, 'row')}): one "
            "repeats the other or a part of it, and a result on the one says nothing where the other was "
            "trained on or fitted to. Leave one of them out."
        )


def readings_hash(log: Log) -> str:
    """SHA-256 of what `refuse_repeated` compares, hexadecimal: the same for a log that was written anew."""
    return hashlib.sha256(b"".join(_rows(log.readings))).hexdigest()


def _rows(readings: Array) -> list[bytes]:
    with np.errstate(over="ignore"):
        exact = np.ascontiguousarray(readings, np.float32) + np.float32(0)  # −0 is 0
    return [row.tobytes() for row in exact]


def _where(log: Log) -> str:
    return str(log.path) if log.path and log.path.stem == log.name else log.name
