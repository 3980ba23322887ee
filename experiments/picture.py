"""Draw docs/arm.png and, from a recording, docs/replay.png.

Needs a software or hardware OpenGL that MuJoCo finds without a display (MUJOCO_GL=egl or osmesa), and
for the replay a Vulkan driver (Debian: mesa-vulkan-drivers, libvulkan1).
"""

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import motor_from_joint
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import GIVEN, Checked, when
from serpent_twin.stored import within

DOCS = Path(__file__).resolve().parent.parent / "docs"
POSE = np.array([0.30, 0.34, 0.24, 0.30, 0.10, -0.10, -0.26, -0.30, -0.34])  # [rad] an S of sorts
JAW = -0.5  # [rad] open
PORT = 9917  # of the viewer


@dataclass(frozen=True)
class View:
    """Where a camera stands and how large its picture is."""

    look_at: tuple[float, float, float]
    """World point in the middle of the picture [m]"""
    distance: float
    """Distance from the point `look_at` to the camera [m]"""
    azimuth: float
    """[deg]"""
    elevation: float
    """[deg]"""
    size: tuple[int, int]
    """Width and height [px]"""


WHOLE = View((0.07, 0.03, -0.045), 1.22, 207, -4, (760, 1200))
WINCHES = View((0.0, 0.0, 0.09), 0.36, 163, 14, (590, 594))
JOINTS = View((0.015, 0.01, -0.055), 0.22, 214, -16, (590, 600))
GAP = 6  # [px] between the pictures


@dataclass(frozen=True)
class Picture(Checked):
    """Draw the pictures of the README and of docs/index.md."""

    docs: Path = DOCS
    """Folder for the pictures."""
    replay: Path | None = None
    """A recording by serpent_twin.replay, to be photographed in rerun's viewer."""
    at: Annotated[float, within(0, 1e9, "s"), when(replay=GIVEN)] = 127.0
    """The moment of the recording [s]."""


def main(config: Picture) -> None:  # noqa: D103 tyro would print it above the config's own
    docs = config.docs
    docs.mkdir(parents=True, exist_ok=True)
    details = np.vstack([render(WINCHES), white(GAP, WINCHES.size[0]), render(JOINTS)])
    sheet = np.hstack([render(WHOLE), white(WHOLE.size[1], GAP), details])
    Image.fromarray(sheet).save(docs / "arm.png", optimize=True)
    print(docs / "arm.png")
    if config.replay:
        photograph(config.replay, config.at, docs / "replay.png")
        print(docs / "replay.png")


def render(view: View) -> np.ndarray:
    """One picture of the arm in POSE, (height, width, 3), drawn at twice the size and averaged."""
    width, height = view.size
    spec = mjcf.build(drawn=True)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 2 * width, 2 * height
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = np.r_[motor_from_joint(POSE), POSE.sum() + JAW, POSE, JAW]
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = view.look_at, view.distance
    camera.azimuth, camera.elevation = view.azimuth, view.elevation
    with mujoco.Renderer(model, 2 * height, 2 * width) as renderer:
        renderer.update_scene(data, camera)
        large = renderer.render().reshape(height, 2, width, 2, 3)
    return large.mean(axis=(1, 3)).astype(np.uint8)


def white(height: int, width: int) -> np.ndarray:
    """An empty picture."""
    return np.full((height, width, 3), 255, np.uint8)


def photograph(replay: Path, at: float, out: Path) -> None:
    """Open a recording in a viewer without a window, go to a moment [s], keep the picture."""
    viewer = ViewerClient.spawn(headless=True, port=PORT)
    try:
        viewer.open(str(replay.resolve()))
        time.sleep(5)  # the viewer answers before it has loaded and drawn all
        viewer.set_time("time", duration=at, play_state="paused")
        time.sleep(5)
        viewer.save_screenshot(str(out))
    finally:
        viewer.quit()
    picture = Image.open(out).convert("RGB")
    picture.crop((0, 36, *picture.size)).save(out, optimize=True)  # without the window's title bar


if __name__ == "__main__":
    cli.run(main)
