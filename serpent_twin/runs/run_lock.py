"""Hold a folder for one run, against other runs and other programs."""

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import number
from serpent_twin.runs.files import json_text, write_json
from serpent_twin.stored import read_json

_TRIES = 20
"""How often a folder is made that another process removes at the same time"""


@contextmanager
def claimed(folder: Path, name: str, settings: dict[str, Any]) -> Iterator[None]:
    """Hold `folder` for a run with these settings, which are stored there as `name`.

    A folder that another process holds, that holds a run with other settings, or something else, is
    refused and left as it is. A run that left nothing but its settings holds no lock: one with other
    settings takes its place. One that fails before it has written anything leaves the folder as it was.
    """
    with _locked(folder) as made:
        began = _began(folder, name)
        if began:
            _agree(folder / name, settings)
        else:
            _refuse_foreign(folder, name)
            write_json(folder / name, settings, indent=2)
        try:
            yield
        except BaseException:
            if not began and not _began(folder, name):
                _leave(folder, name, made)
            raise


def prior_settings(folder: Path, name: str) -> dict[str, Any]:
    """The settings of the run that a folder holds; none if it holds none."""
    return _read(folder / name) if _began(folder, name) else {}


@contextmanager
def _locked(folder: Path) -> Iterator[list[Path]]:
    """Lock a folder, which is made if there is none; yields the folders that were made, it first."""
    made, handle = _opened(folder)
    while not _holds(handle, folder):  # another process made it, failed, and removed it again
        os.close(handle)
        made, handle = _opened(folder)
    try:
        yield made
    finally:
        os.close(handle)


def _opened(folder: Path) -> tuple[list[Path], int]:
    """The folders that were made, and the open folder."""
    for _ in range(_TRIES):
        made = [path for path in (folder, *folder.parents) if not path.exists()]
        with suppress(FileNotFoundError, FileExistsError):
            folder.mkdir(parents=True, exist_ok=True)
            return made, os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    folder.mkdir(parents=True, exist_ok=True)
    return [], os.open(folder, os.O_RDONLY | os.O_DIRECTORY)


def _holds(handle: int, folder: Path) -> bool:
    """Lock an open folder; false if what lies at its path is another one, or nothing, by now."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise SerpentError(
            f"{folder} is in use by another process. Wait for it, or choose another --out."
        ) from None
    try:
        return os.path.samestat(os.fstat(handle), folder.stat())
    except FileNotFoundError:
        return False


def _began(folder: Path, name: str) -> bool:
    """Whether a run has left more in the folder than its settings and empty folders."""
    if not (folder / name).exists():
        return False
    own = {folder / name, folder / f"{name}.partial"}
    return any(path not in own and not path.is_dir() for path in folder.rglob("*"))


def _refuse_foreign(folder: Path, name: str) -> None:
    """Raise `SerpentError` for a folder that holds something, and no settings."""
    if not (folder / name).exists() and {path.name for path in folder.iterdir()} - {
        f"{name}.partial"
    }:
        raise SerpentError(
            f"{folder} is not empty and holds no {name}, so no such run made it. "
            "Nothing was changed: choose another --out."
        )


def _leave(folder: Path, name: str, made: list[Path]) -> None:
    """Remove what a run that wrote nothing left: empty folders, its settings, and folders that it made."""
    inside = sorted((path for path in folder.rglob("*") if path.is_dir()), reverse=True)
    with suppress(OSError):  # what cannot be removed holds no lock, either
        for path in inside:
            path.rmdir()
        (folder / name).unlink()
        for path in made:
            path.rmdir()


def _agree(path: Path, settings: dict[str, Any]) -> None:
    differences = list(_differences(_read(path), json.loads(json_text(settings))))
    if differences:
        raise SerpentError(
            f"{path.parent} holds a run with other settings: {'; '.join(differences)}. "
            "Give the same settings to go on with it, or choose another --out."
        )


def _read(path: Path) -> dict[str, Any]:
    return read_json(path, advice="It is damaged: choose another --out.")


def _differences(earlier: Any, now: Any, name: str = "") -> Iterator[str]:
    if isinstance(earlier, dict) and isinstance(now, dict):
        for key in sorted(earlier.keys() | now.keys()):
            yield from _differences(earlier.get(key), now.get(key), f"{name}.{key}".lstrip("."))
    elif earlier != now:
        yield f"{name} was {_short(earlier)}, now {_short(now)}"


def _short(value: Any) -> str:
    text = number(value) if isinstance(value, int) else str(value)
    return text if len(text) <= 40 else f"{text[:12]}…"
