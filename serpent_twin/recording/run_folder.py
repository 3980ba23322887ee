"""Find which sessions of a run are recorded already."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.runs.files import unused
from serpent_twin.sessions import FIELDS, read_session, recover


def missing(paths: Sequence[Path]) -> list[int]:
    """Indices of the sessions that are not there in full.

    A session of which a part is there moves to the folder `partial`, so that it can be recorded again.
    """
    return [index for index, path in enumerate(paths) if not _is_complete(path)]


def drop_what_came_again(path: Path) -> None:
    """Delete earlier parts of a session whose every row stands in the whole one, too."""
    folder, whole = _partial(path), read_session(path)
    for part_path in folder.glob(f"{path.stem}*.parquet"):
        part = read_session(part_path)
        pairs = ((getattr(part, name), getattr(whole, name)[: len(part)]) for name in FIELDS)
        if all(np.array_equal(a, b, equal_nan=True) for a, b in pairs):
            part_path.unlink()
    if folder.exists() and not any(folder.iterdir()):
        folder.rmdir()


def _is_complete(path: Path) -> bool:
    journal = path.with_suffix(".journal")
    if journal.exists():
        _recover_when_free(journal)
    if not path.exists():
        return False
    if read_session(path).metadata.get("complete", True):
        return True
    _partial(path).mkdir(exist_ok=True)
    path.rename(unused(_partial(path) / path.name))
    return False


def _partial(path: Path) -> Path:
    return path.parent / "partial"


def _recover_when_free(journal: Path) -> None:
    """Recover a journal; a recorder whose parent was killed may need a moment to notice."""
    until = time.monotonic() + 10.0
    while True:
        try:
            recover(journal)
            return
        except SerpentError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)
