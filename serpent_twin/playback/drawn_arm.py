"""Draw the arm with its markers at one moment, as MuJoCo renders it, under a line that names them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import ImageDraw, ImageFont

from serpent_twin.arm import mjcf
from serpent_twin.arrays import Array
from serpent_twin.playback.marker_looks import Colour
from serpent_twin.playback.offscreen import Ball, Canvas, Image, Rod, canvas

SIZE = (720, 720)
"""Size of the rendered scene [px]; both even, as video codecs need"""
_LINE, _MARGIN = 24, 10
"""Height of a line of text, and the margin to its left [px]"""
_INK, _PAPER = (35, 40, 45), (255, 255, 255)
_RADIUS, _THIN = 0.006, 0.0016
"""Radius of a marker, and of the line through an arm's markers [m]"""
_OPACITY = 0.85
_LOOK_AT, _DISTANCE, _AZIMUTH, _ELEVATION = (0.0, 0.0, -0.19), 0.80, 207.0, -6.0
"""The camera: a point in the world [m], the way to it [m], and its direction [deg]"""
_MORE = 200
"""Balls and rods of a picture at most"""


@dataclass(frozen=True)
class DrawnPose:
    """Angles of the drawn arm at one moment."""

    motor: Array
    """[rad], (10,)"""
    joint: Array
    """[rad], (9,)"""
    jaw: float
    """[rad]"""


@dataclass(frozen=True)
class Markers:
    """Markers of one source at one moment, joined by a line from the base."""

    name: str
    """What the picture's legend calls them"""
    colour: Colour
    """0 … 255"""
    place: Array
    """Marker positions in the base frame [m], (9, 3), NaN where one was lost"""


@dataclass(frozen=True)
class Pencil:
    """Draws the arm's poses, one after another."""

    canvas: Canvas
    model: Any
    fine: bool
    """Whether to draw shadows, and each pixel as the mean of four"""

    def picture(self, title: str, pose: DrawnPose, markers: Sequence[Markers]) -> Image:
        """Picture of a pose with markers, a title and a legend above, (height, width, 3)."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = np.r_[pose.motor, pose.joint, pose.jaw]
        mujoco.mj_forward(self.model, data)
        flags, kinds = self.canvas.scene.flags, mujoco.mjtRndFlag
        flags[kinds.mjRND_SHADOW] = flags[kinds.mjRND_REFLECTION] = self.fine
        drawn = self.canvas.render(data, _camera(), [s for each in markers for s in _shapes(each)])
        if self.fine:
            height, width = drawn.shape[0] // 2, drawn.shape[1] // 2
            drawn = drawn.reshape(height, 2, width, 2, 3).mean(axis=(1, 3)).astype(np.uint8)
        return np.vstack([_legend(title, markers), drawn])


@contextmanager
def pencil(fine: bool = True) -> Iterator[Pencil]:
    """What draws the arm: `fine` for one picture, not so for the many of a video."""
    spec = mjcf.build(drawn=True)
    spec.visual.quality.offsamples = 0  # in software, as slow as four times the pixels
    width, height = SIZE
    with canvas(spec, (2 * width, 2 * height) if fine else SIZE, _MORE) as (drawn, model):
        yield Pencil(drawn, model, fine)


def _camera() -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = _LOOK_AT, _DISTANCE
    camera.azimuth, camera.elevation = _AZIMUTH, _ELEVATION
    return camera


def _shapes(each: Markers) -> Iterator[Ball | Rod]:
    """Balls where markers are seen, and rods between them from the base on."""
    there = each.place[np.isfinite(each.place).all(axis=-1)]
    red, green, blue = (c / 255 for c in each.colour)
    colour = red, green, blue, _OPACITY
    chain = np.vstack([np.zeros(3), there]) @ mjcf.world_from_base().T
    for ends in pairwise(chain):
        yield Rod(np.array(ends), _THIN, colour)
    for place in chain[1:]:
        yield Ball(place, _RADIUS, colour)


def _legend(title: str, markers: Sequence[Markers]) -> NDArray[np.uint8]:
    """A strip with the title, and below it the name of each source in its colour."""
    lines = 1 + len(markers)
    height = 2 * ((lines * _LINE + 2 * _MARGIN) // 2)
    strip = Pillow.new("RGB", (SIZE[0], height), _PAPER)
    pen, font = ImageDraw.Draw(strip), ImageFont.load_default(_LINE - 8)
    pen.text((_MARGIN, _MARGIN), title, _INK, font)
    for n, each in enumerate(markers, 1):
        top = _MARGIN + n * _LINE
        pen.ellipse((_MARGIN, top + 2, _MARGIN + 14, top + 16), each.colour)
        pen.text((_MARGIN + 24, top), each.name, _INK, font)
    return np.asarray(strip)
