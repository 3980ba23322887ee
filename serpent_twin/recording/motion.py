"""Write a planned motion of any machine, one row a control step, and read that of the arm: joint targets."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm.control import TARGET_COLUMNS, checked_targets
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines import ARM
from serpent_twin.runs.files import write_whole
from serpent_twin.tables import parquet, text

_KEY = b"serpent_twin_motion"
_ADVICE = "Give a file that python -m serpent_twin.plan wrote."


@dataclass(frozen=True)
class Motion:
    """What commands a machine, and what it was planned for."""

    targets: Array
    """Joint targets of the arm [rad], (T, 9); of another machine what its columns hold, (T, D)"""
    rate_hz: float
    """Control steps per second"""
    about: Mapping[str, Any]
    """rig, arm, twin_sha256, decides, pieces, seed, provenance"""
    columns: tuple[str, ...] = TARGET_COLUMNS
    """Names, (D,)"""
    time: tuple[str, float] | None = None
    """Name of a column of the time, and its unit [s]"""


def write(path: Path, motion: Motion) -> None:
    """Write a motion's file, CSV or Parquet; only the latter says what it was planned for."""
    columns = dict(zip(motion.columns, motion.targets.T, strict=True))
    if motion.time:
        name, unit = motion.time
        time = np.arange(len(motion.targets)) / motion.rate_hz / unit
        columns = {name: np.round(time, 9), **columns}
    about = {**motion.about, "rate_hz": motion.rate_hz, "sha256": _hash(motion.targets)}
    is_text = path.suffix == ".csv"
    write_whole(path, text.packed(columns) if is_text else parquet.packed(columns, _KEY, about))


def require_form(path: Path, rig: str) -> None:
    """Refuse a file of a form in which a machine takes no motion."""
    forms = (".parquet",) if rig == ARM else (".parquet", ".csv")
    if path.suffix not in forms:
        raise SerpentError(f"--out {path} must end in {' or '.join(forms)}.")


def read(path: Path) -> Motion:
    """A motion's file; raises a `SerpentError` if it is damaged, not one, or not for this arm."""
    table = parquet.read(path, _ADVICE)
    if _KEY not in table.metadata:
        raise SerpentError(f"{path} is no planned motion. {_ADVICE}")
    try:
        about = json.loads(table.metadata[_KEY])
        rate, known = float(about["rate_hz"]), about["sha256"]
    except (ValueError, KeyError, TypeError):
        raise SerpentError(f"{path}: its metadata are damaged. Plan the motion again.") from None
    if about.get("rig") != ARM:
        raise SerpentError(
            f"{path} is a motion of the machine {about.get('rig')!r}; only the arm is commanded here."
        )
    if any(name not in table.columns for name in TARGET_COLUMNS):
        raise SerpentError(f"{path} is no planned motion. {_ADVICE}")
    targets = np.stack([table.columns[name] for name in TARGET_COLUMNS], axis=-1).astype(float)
    if _hash(targets) != known or not len(targets):
        raise SerpentError(f"{path}: its targets are not those that were planned. Plan it again.")
    return Motion(checked_targets(targets, str(path)), rate, about)


def _hash(targets: Array) -> str:
    return hashlib.sha256(np.ascontiguousarray(targets, "<f8").tobytes()).hexdigest()
