"""Draw a session as a video: the arm, and its markers as measured and as predicted."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from serpent_twin.errors import SerpentError
from serpent_twin.extras import requires
from serpent_twin.playback.moments import already_there, draw, row_at, says
from serpent_twin.playback.offscreen import Image
from serpent_twin.playback.shown import ShownSession
from serpent_twin.runs.files import replacing

FRAMES, RATE = 240, 12
"""Pictures of a video at most, and pictures a second: 20 s"""


def draw_video(shown: ShownSession, out: Path, between: tuple[float, float] | None = None) -> None:
    """Write an MP4 of a session, or of the part between two times [s], unless it is there."""
    with requires("view", "A video"):
        import imageio_ffmpeg
    _require_ffmpeg(imageio_ffmpeg)
    from serpent_twin.playback.drawn_arm import pencil

    rows = frames(shown, between)
    name = shown.identity("video", rows.tolist())
    if already_there(out, "the video", says(name)):
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    with pencil(fine=False) as drawing, _written(imageio_ffmpeg, out, name) as film:
        for row in tqdm(rows, unit="picture", desc="video"):
            film.send(draw(shown, int(row), drawing))


def frames(shown: ShownSession, between: tuple[float, float] | None = None) -> np.ndarray:
    """Rows of a session, or of a part of it [s], that a video shows: evenly spaced, at most `FRAMES`."""
    clock = shown.session.time
    first, last = (row_at(shown, each) for each in between or (clock[0], clock[-1]))
    if last <= first:
        raise SerpentError(
            f"a video needs two times that rise, at least a row of {shown.path} apart, and was given "
            f"{between}."
        )
    return np.linspace(first, last, min(FRAMES, last - first + 1)).round().astype(int)


def _require_ffmpeg(ffmpeg: Any) -> None:
    try:
        ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise SerpentError(
            "a video needs ffmpeg, which is not here. Install it, or name it in IMAGEIO_FFMPEG_EXE."
        ) from error


class _Film:
    """A video that is written: its size is that of the first picture."""

    def __init__(self, ffmpeg: Any, part: Path, name: str) -> None:
        self._ffmpeg, self._part, self._name = ffmpeg, part, name
        self._writer: Any = None

    def send(self, picture: Image) -> None:
        """Add a picture."""
        if self._writer is None:
            height, width = picture.shape[:2]
            self._writer = self._ffmpeg.write_frames(
                str(self._part), (width, height), fps=RATE, macro_block_size=2,
                output_params=["-f", "mp4", "-metadata", f"comment={self._name}"],
            )  # fmt: skip
            self._writer.send(None)
        self._writer.send(np.ascontiguousarray(picture))

    def close(self) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.close()


@contextmanager
def _written(ffmpeg: Any, out: Path, name: str) -> Iterator[_Film]:
    """A video file, which appears when it is whole."""
    with replacing(out) as part:
        part.touch()
        film = _Film(ffmpeg, part, name)
        try:
            yield film
            film.close()
        except OSError as error:  # ffmpeg ended, most likely as the disk is full
            raise SerpentError(
                f"{out} could not be written whole. Make room on the disk, then run it again."
            ) from error
