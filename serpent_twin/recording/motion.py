"""Write and read a planned motion: joint targets, one row a control step."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from serpent_twin.arm.control import checked_targets
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.stored.tables import read_table

_KEY = b"serpent_twin_motion"
_COLUMNS = tuple(f"joint_target_{j}" for j in range(1, N_JOINTS + 1))
_ADVICE = "Give a file that python -m serpent_twin.plan wrote."


@dataclass(frozen=True)
class Motion:
    """Joint targets, and what they were planned for."""

    targets: Array
    """[rad], (T, 9)"""
    rate_hz: float
    """Control steps per second"""
    about: Mapping[str, Any]
    """rig, arm, twin_sha256, decides, pieces, seed, provenance"""


def write(path: Path, motion: Motion) -> None:
    """Write a motion's file; the angles are in radians."""
    about = {**motion.about, "rate_hz": motion.rate_hz, "sha256": _hash(motion.targets)}
    table = pa.table(dict(zip(_COLUMNS, motion.targets.T, strict=True)))
    table = table.replace_schema_metadata({_KEY: json.dumps(about)})
    part = path.with_name(path.name + ".partial")
    pq.write_table(table, part, write_page_checksum=True)
    part.rename(path)


def read(path: Path) -> Motion:
    """A motion's file; raises a `SerpentError` if it is damaged, not one, or not for this arm."""
    table = read_table(path, _ADVICE)
    if _KEY not in table.metadata or any(name not in table.columns for name in _COLUMNS):
        raise SerpentError(f"{path} is no planned motion. {_ADVICE}")
    try:
        about = json.loads(table.metadata[_KEY])
        rate, known = float(about["rate_hz"]), about["sha256"]
    except (ValueError, KeyError, TypeError):
        raise SerpentError(f"{path}: its metadata are damaged. Plan the motion again.") from None
    targets = np.stack([table.columns[name] for name in _COLUMNS], axis=-1).astype(float)
    if _hash(targets) != known or not len(targets):
        raise SerpentError(f"{path}: its targets are not those that were planned. Plan it again.")
    if about.get("rig") != "arm":
        raise SerpentError(
            f"{path} is a motion of the machine {about.get('rig')!r}; only the arm is commanded here."
        )
    return Motion(checked_targets(targets, str(path)), rate, about)


def _hash(targets: Array) -> str:
    return hashlib.sha256(np.ascontiguousarray(targets, "<f8").tobytes()).hexdigest()
