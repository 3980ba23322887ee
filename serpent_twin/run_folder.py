"""What of a run is in its folder already?"""

import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.log import FIELDS, read_session, recover

SETTINGS = "collect.json"


def claim(folder: Path, settings: dict[str, Any]) -> None:
    """Make `folder` this run's and store its settings there, or refuse what holds another run."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / SETTINGS
    if not path.exists():
        _refuse_foreign_logs(folder)
        path.write_text(json.dumps(settings, indent=2) + "\n")
        return
    differences = list(_differences(_read_settings(path), settings))
    if differences:
        raise SerpentError(
            f"{folder} holds a run with other settings: {'; '.join(differences)}. "
            "Give the same settings to go on with it, or choose another --out."
        )


def missing(paths: Sequence[Path]) -> list[int]:
    """Indices of the sessions that are not there in full.

    A session of which a part is there moves to the folder `partial`, so that it can be recorded anew.
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


def _read_settings(path: Path) -> dict[str, Any]:
    try:
        return json.loads(path.read_text())
    except ValueError as error:
        raise SerpentError(
            f"{path} is damaged ({error}), so nobody can tell which run lies beside it. "
            "Choose another --out, or delete that file if the run there is to be mixed with this."
        ) from None


def _differences(earlier: Any, now: Any, name: str = "") -> Iterator[str]:
    if isinstance(earlier, dict) and isinstance(now, dict):
        for key in sorted(earlier.keys() | now.keys()):
            yield from _differences(earlier.get(key), now.get(key), f"{name}.{key}".lstrip("."))
    elif earlier != now:
        yield f"{name} was {earlier}, now {now}"


def _refuse_foreign_logs(folder: Path) -> None:
    found = next(iter(sorted(folder.glob("session_*"))), None)
    if found:
        raise SerpentError(
            f"{folder} holds {found.name}, but no {SETTINGS}, so another program recorded it. "
            "Nothing was changed: choose another --out."
        )


def _is_complete(path: Path) -> bool:
    journal = path.with_suffix(".journal")
    if journal.exists():
        _recover_when_free(journal)
    if not path.exists():
        return False
    if read_session(path).metadata.get("complete", True):
        return True
    _partial(path).mkdir(exist_ok=True)
    path.rename(_unused(_partial(path) / path.name))
    return False


def _partial(path: Path) -> Path:
    return path.parent / "partial"


def _recover_when_free(journal: Path, patience: float = 10.0) -> None:
    """Recover a journal; a recorder whose parent was killed may need a moment to notice."""
    until = time.monotonic() + patience
    while True:
        try:
            recover(journal)
            return
        except SerpentError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


def _unused(path: Path) -> Path:
    number, free = 1, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}_{number}{path.suffix}")
    return free
