"""Read the bytes of a regular file of bounded size."""

import os
import stat
from pathlib import Path

from serpent_twin.errors import SerpentError

MOST = 16_000_000
"""Bytes of a JSON or TOML file: a thousand times what the largest of ours has."""


def require_file(path: Path, most: int, advice: str = "") -> None:
    """Refuse what is no regular file of at most so many bytes: a pipe would be waited for without end."""
    try:
        found = path.stat()
    except FileNotFoundError:
        raise _unreadable(path, "there is no such file", advice) from None
    except OSError as error:
        raise _unreadable(path, reason(error), advice) from None
    if stat.S_ISDIR(found.st_mode):
        raise _unreadable(path, "it is a folder", advice)
    if not stat.S_ISREG(found.st_mode):
        raise _unreadable(path, "it is a pipe or a device, no file", advice)
    if found.st_size > most:
        size = f"it has {found.st_size:,} bytes, and at most {most:,} are read"
        raise _unreadable(path, size, advice)


def contents(path: Path, most: int = MOST, advice: str = "") -> bytes:
    """All bytes of a file."""
    require_file(path, most, advice)
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError as error:
        raise _unreadable(path, reason(error), advice) from None


def reason(error: OSError) -> str:
    """The system's reason for refusing, such as `permission denied`."""
    return os.strerror(error.errno).lower() if error.errno else "the system refuses it"


def _unreadable(path: Path, why: str, advice: str) -> SerpentError:
    return SerpentError(f"{path} cannot be read: {why}. {advice}".rstrip())
