"""Write a file whole or not at all."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """The file to write in place of another, which it replaces in one step if nothing fails."""
    part = path.with_name(path.name + ".partial")
    try:
        yield part
        part.rename(path)
    finally:
        part.unlink(missing_ok=True)


def write_whole(path: Path, content: Any) -> None:
    """Replace `path` by a text or bytes in one step: a crash or a full disk leaves what was there."""
    try:
        with replacing(path) as part, part.open("wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        sync_folder(path.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Replace an .npz file by arrays, in one step."""
    with replacing(path) as part, part.open("wb") as file:
        np.savez(file, **arrays)


def write_json(path: Path, content: Any, indent: int | None = 1, ensure_ascii: bool = True) -> None:
    """Replace `path` by a value as JSON, in one step; an `indent` of None gives one line."""
    write_whole(path, json_text(content, indent, ensure_ascii))


def json_text(content: Any, indent: int | None = 1, ensure_ascii: bool = True) -> str:
    """A value as JSON with a line end; what is not finite, which JSON lacks, becomes null."""
    text = json.dumps(finite(content), indent=indent, ensure_ascii=ensure_ascii, allow_nan=False)
    return text + "\n"


def finite(value: Any, number: Callable[[float], float] = float) -> Any:
    """JSON's own kinds of values, None in place of NaN and infinities; `number` is done to each float."""
    if isinstance(value, Mapping):
        return {name: finite(each, number) for name, each in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [finite(each, number) for each in value]
    if isinstance(value, float | np.floating):
        return number(float(value)) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


def sync_folder(folder: Path) -> None:
    """Make renames and removals in a folder survive a loss of power."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def unused(path: Path) -> Path:
    """A path at which nothing is: this one, or one with a number."""
    number, free = 1, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}_{number}{path.suffix}")
    return free
