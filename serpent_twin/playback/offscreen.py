"""Render MuJoCo scenes without a display."""

import ctypes.util
import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError

Image = NDArray[np.uint8]
"""Red, green, blue, (height, width, 3)"""

_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
"""What renders without a display on Linux, and the library that each needs"""
_DISPLAYS = {"darwin": "cgl"}
"""What renders into memory on systems that need no display for it"""
_REMEDY = (
    "Install a software OpenGL (Debian: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6 with "
    "MUJOCO_GL=osmesa), or make a recording with --out FILE.rrd instead."
)


@dataclass(frozen=True)
class Ball:
    """A sphere that is added to a scene."""

    place: NDArray[np.float64]
    """Position in the world frame [m], (3,)"""
    radius: float
    """[m]"""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity, 0 … 1"""


@dataclass(frozen=True)
class Rod:
    """A thin line between two points that is added to a scene."""

    ends: NDArray[np.float64]
    """End points in the world frame [m], (2, 3)"""
    radius: float
    """[m]"""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity, 0 … 1"""


def backend() -> str:
    """Name of MuJoCo's module that renders here: MUJOCO_GL if it is set, else one whose library is there."""
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in (*_LIBRARIES, "cgl", "glfw"):
        return asked
    if sys.platform != "linux":
        return _DISPLAYS.get(sys.platform, "glfw")
    found = [name for name, library in _LIBRARIES.items() if ctypes.util.find_library(library)]
    return [*found, "glfw"][0]


@contextmanager
def opengl(width: int, height: int) -> Iterator[None]:
    """Make an OpenGL context for pictures of a size [px]; a `SerpentError` says what to install for it."""
    name = backend()
    if name == "glfw" and sys.platform == "linux" and not os.environ.get("DISPLAY"):
        raise SerpentError(f"a picture needs OpenGL, and neither EGL nor OSMesa is here. {_REMEDY}")
    try:
        context = importlib.import_module(f"mujoco.{name}").GLContext(width, height)
        context.make_current()
    except Exception as error:  # PyOpenGL raises AttributeError, ImportError, GLError, its own
        raise SerpentError(
            f"no picture can be rendered with {name.upper()} here. {_REMEDY}"
        ) from error
    try:
        yield
    finally:
        context.free()


class Canvas:
    """A model's scene, rendered as often as its state changes; used within `canvas`."""

    def __init__(self, model: mujoco.MjModel, size: tuple[int, int], more: int) -> None:
        self._model, self._option = model, mujoco.MjvOption()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self.scene = mujoco.MjvScene(model, _many(model) + more)
        """What is drawn, with its flags"""
        self._rectangle = mujoco.MjrRect(0, 0, *size)

    def render(
        self, data: mujoco.MjData, camera: mujoco.MjvCamera, more: list[Ball | Rod]
    ) -> Image:
        """Picture of a state, with balls and rods added."""
        scene, everything = self.scene, mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, camera, everything.value, scene
        )
        for each in more:
            _add(scene, each)
        mujoco.mjr_render(self._rectangle, scene, self._context)
        picture = np.empty((self._rectangle.height, self._rectangle.width, 3), np.uint8)
        mujoco.mjr_readPixels(picture, None, self._rectangle, self._context)
        return picture[::-1]

    def free(self) -> None:
        """Free what OpenGL holds."""
        self._context.free()


@contextmanager
def canvas(spec: mujoco.MjSpec, size: tuple[int, int], more: int) -> Iterator[tuple[Canvas, Any]]:
    """A canvas for pictures of a size [px] with up to so many balls and rods, and the compiled model."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    model = spec.compile()
    with opengl(*size):
        drawn = Canvas(model, size, more)
        try:
            yield drawn, model
        finally:
            drawn.free()


def _many(model: mujoco.MjModel) -> int:
    """How many shapes a model's scene has at most: a strand has one for each piece between its sites."""
    return 10_000 + 4 * (model.ngeom + model.nsite + model.nwrap)


def _add(scene: mujoco.MjvScene, each: Ball | Rod) -> None:
    if scene.ngeom >= scene.maxgeom:
        raise SerpentError(f"the scene has more than {scene.maxgeom} shapes: it cannot be drawn.")
    shape = scene.geoms[scene.ngeom]
    colour = np.array(each.colour, np.float32)
    kind = mujoco.mjtGeom
    if isinstance(each, Ball):
        size, turn = np.full(3, each.radius), np.eye(3).ravel()
        mujoco.mjv_initGeom(shape, kind.mjGEOM_SPHERE, size, each.place, turn, colour)
    else:
        mujoco.mjv_initGeom(
            shape, kind.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.zeros(9), colour
        )
        mujoco.mjv_connector(shape, kind.mjGEOM_CAPSULE, each.radius, *each.ends)
    scene.ngeom += 1
