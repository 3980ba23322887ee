"""Write a spec as MJCF with all digits of its numbers."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

_DIGITS = 15
"""All that a double surely holds (IEEE 754), so that 0.1 stays 0.1"""
_GET, _SET = "_mjPRIVATE__get_xml_precision", "_mjPRIVATE__set_xml_precision"
"""Of MuJoCo 3.17; where its library lacks them, numbers have the six digits of its default"""


def to_xml(spec: mujoco.MjSpec) -> str:
    """A compiled spec as MJCF, its numbers to a part in 10¹⁵."""
    with _digits(_DIGITS):
        return spec.to_xml()


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
