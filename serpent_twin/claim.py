"""Whose folder is this?"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError


def claim(folder: Path, name: str, settings: dict[str, Any]) -> None:
    """Make `folder` that of a run with these settings, stored there as `name`.

    A folder that holds a run with other settings, or something else, is refused and left as it is.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    if not path.exists():
        if any(folder.iterdir()):
            raise SerpentError(
                f"{folder} is not empty and holds no {name}, so no such run made it. "
                "Nothing was changed: choose another --out."
            )
        path.write_text(json.dumps(settings, indent=2) + "\n")
        return
    differences = list(_differences(_read(path), json.loads(json.dumps(settings))))
    if differences:
        raise SerpentError(
            f"{folder} holds a run with other settings: {'; '.join(differences)}. "
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
