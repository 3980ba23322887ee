"""Write a spec as MJCF with all digits of its numbers."""

import ctypes
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import mujoco

_DIGITS = 15
"""All that a double surely holds (IEEE 754), so that 0.1 stays 0.1"""
_GET, _SET = "_mjPRIVATE__get_xml_precision", "_mjPRIVATE__set_xml_precision"
"""Getter and setter of digits in MuJoCo 3.17; where its library lacks them, numbers have its default, six"""


def to_xml(spec: mujoco.MjSpec, folder: Path) -> str:
    """A compiled spec as MJCF for a file in a folder, its numbers to a part in 10¹⁵; meshes and textures stay
    where they are.
    """
    with _digits(_DIGITS):
        text = spec.to_xml()
    if not (spec.meshes or spec.textures or spec.hfields or spec.skins):
        return text
    root, here = ElementTree.fromstring(text), Path(spec.modelfiledir)
    compiler = root.find("compiler")
    if compiler is None:
        compiler = ElementTree.SubElement(root, "compiler")
    for name in ("meshdir", "texturedir"):
        compiler.set(name, _from(folder, here / compiler.get(name, "")))
    return ElementTree.tostring(root, encoding="unicode")


def first_comment(path: Path) -> str:
    """The comment of an MJCF's first line; nothing where it has none."""
    found = re.match(r"<!--\s*(.*?)\s*-->", path.read_text(encoding="utf-8"))
    return found[1] if found else ""


def _from(folder: Path, other: Path) -> str:
    """The path of one folder as files of another may state it."""
    try:
        return Path(os.path.relpath(other.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return other.resolve().as_posix()


@contextmanager
def _digits(count: int) -> Iterator[None]:
    """Let MuJoCo write numbers with so many digits."""
    library = _library()
    if library is None or not hasattr(library, _SET):
        yield
        return
    before = getattr(library, _GET)()
    getattr(library, _SET)(count)
    try:
        yield
    finally:
        getattr(library, _SET)(before)


def _library() -> ctypes.CDLL | None:
    """MuJoCo's own library, as it is loaded."""
    folder = Path(mujoco.__file__).parent
    found = [path for name in ("libmujoco*", "mujoco.dll") for path in folder.glob(name)]
    return ctypes.CDLL(str(found[0])) if found else None
