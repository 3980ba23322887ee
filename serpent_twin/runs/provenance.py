"""Record where a result comes from."""

import hashlib
import importlib.metadata
import platform
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import serpent_twin

_OF_FILES = ("paths", "npaths", "nbuffer", "signature")
"""Fields of a compiled model that depend on where its meshes lie"""
_REPORTED = ("mujoco", "numpy", "scipy", "torch", "pyarrow", "dm-control")


def provenance() -> dict[str, Any]:
    """Versions of the libraries that compute, and the commit of this project."""
    return {"versions": versions(), "git_commit": git_commit()}


@cache
def versions() -> dict[str, str]:
    """Of Python, this project and what computes."""
    own = {"python": platform.python_version(), "serpent-twin": serpent_twin.__version__}
    return own | {name: found for name in _REPORTED if (found := _version(name))}


def _version(name: str) -> str | None:
    """Version of an installed distribution."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def git_commit() -> str:
    """Commit of the source tree, with `-dirty` appended if it was changed; `unknown` outside git."""
    tree = Path(__file__).resolve().parents[2]
    if not (tree / ".git").exists():  # installed, perhaps within another project's repository
        return "unknown"
    command = [
        "git",
        "-C",
        str(tree),
        "describe",
        "--always",
        "--dirty",
        "--abbrev=12",
        "--exclude=*",
    ]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return found.stdout.strip()


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def model_hash(model: mujoco.MjModel) -> str:
    """SHA-256 of a compiled model, hexadecimal: of all fields but the paths of its files."""
    digest = hashlib.sha256()
    for owner in (model, model.opt):
        for name in sorted(n for n in dir(owner) if not n.startswith("_")):
            value = getattr(owner, name)
            if name in _OF_FILES or name.endswith("pathadr"):
                continue
            if isinstance(value, np.ndarray):
                digest.update(f"{name} {value.dtype} {value.shape}".encode() + value.tobytes())
            elif isinstance(value, bytes | int | float):
                digest.update(f"{name} {value!r}".encode())
    return digest.hexdigest()
