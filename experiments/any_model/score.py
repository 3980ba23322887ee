"""Judge what a trace found of a machine with one fault."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.any_model.record import VECTORS
from experiments.any_model.trial import CLEAN, COMPOSED
from serpent_twin.effects import law_of, placed, ranges

Row = Mapping[str, Any]
"""One line of results.jsonl"""
WITHIN = 0.1
"""Relative error within which a strength counts as near"""


def right(row: Row) -> bool:
    """Whether the fault is named first, at its place; of a machine without one, whether nothing is."""
    if row["name"] == CLEAN:
        return not row["named"] and not row["stand_ins"]
    return row["named"][:1] == [row["name"]]


def undecided(row: Row) -> bool:
    """Whether the fault is among those that the trace says its logs cannot tell from what it named first."""
    first = row["named"][:1]
    return bool(first) and not right(row) and row["name"] in row["rivals"].get(first[0], [])


def off(row: Row) -> float:
    """Relative error of the strength; NaN if the fault is not named."""
    found = _found(row)
    if found is None:
        return float("nan")
    true, value = found[:2]
    return float(np.linalg.norm(value - true) / np.linalg.norm(true))


def covered(row: Row) -> bool | None:
    """Whether the interval holds the strength, of a vector each component; None if it is not named."""
    found = _found(row)
    if found is None:
        return None
    true, _, low, high = found
    return bool(((low <= true) & (true <= high)).all())


def told(row: Row) -> str:
    """The strength that was found, with its interval."""
    found = _found(row)
    if found is None:
        return ""
    _, value, low, high = found
    parts = (f"{v:.3g} [{a:.3g} … {b:.3g}]" for v, a, b in zip(value, low, high, strict=True))
    return ", ".join(parts)


def _found(row: Row) -> tuple[Any, Any, Any, Any] | None:
    """True, found, low and high strengths, (n,) each."""
    if row["name"] == CLEAN or row["name"] not in row["strengths"]:
        return None
    of, law = row["strengths"][row["name"]], law_of(row["name"])
    names = [f"along_{axis}" for axis in "xyz"]
    if law in COMPOSED:
        names = [name for name in of if name.startswith("size")]
    elif law not in VECTORS:
        names = [next(iter(ranges(placed(row["name"])[0])))]
    true = np.array(list(row["true"].values()))
    value, low, high = (np.array([of[n][key] for n in names]) for key in ("value", "low", "high"))
    if law in COMPOSED and value @ true < 0:  # a wave half a period later, a push told as a pull
        return true, -value, -high, -low
    return true, value, low, high
