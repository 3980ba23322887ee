"""Whose folder is this?"""

import fcntl
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.files import write_whole


@contextmanager
def claimed(folder: Path, name: str, settings: dict[str, Any]) -> Iterator[None]:
    """Hold `folder` for a run with these settings, which are stored there as `name`.

    A folder that another process holds, that holds a run with other settings, or something else, is
    refused and left as it is.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    if not path.exists():
        if any(folder.iterdir()):
            raise SerpentError(
                f"{folder} is not empty and holds no {name}, so no such run made it. "
                "Nothing was changed: choose another --out."
            )
        write_whole(path, json.dumps(settings, indent=2) + "\n")
    with path.open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SerpentError(
                f"{folder} is in use by another process. Wait for it, or choose another --out."
            ) from None
        _agree(path, settings)
        yield


def _agree(path: Path, settings: dict[str, Any]) -> None:
    differences = list(_differences(_read(path), json.loads(json.dumps(settings))))
    if differences:
        raise SerpentError(
            f"{path.parent} holds a run with other settings: {'; '.join(differences)}. "
            "Give the same settings to go on with it, or choose another --out."
        )


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except ValueError as error:
        raise SerpentError(
            f"{path} is damaged ({error}), so nobody can tell which run lies beside it. "
            "Choose another --out."
        ) from None


def _differences(earlier: Any, now: Any, name: str = "") -> Iterator[str]:
    if isinstance(earlier, dict) and isinstance(now, dict):
        for key in sorted(earlier.keys() | now.keys()):
            yield from _differences(earlier.get(key), now.get(key), f"{name}.{key}".lstrip("."))
    elif earlier != now:
        yield f"{name} was {_short(earlier)}, now {_short(now)}"


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 40 else f"{text[:12]}…"
