"""Say what a picture shows of one row of a session: the pose, the markers and how far these lie off."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.playback.drawn_arm import DrawnPose, Markers, Pencil
from serpent_twin.playback.marker_looks import CORRECTED, ESTIMATED, MEASURED, NOMINAL
from serpent_twin.playback.offscreen import Image
from serpent_twin.playback.shown import ShownSession


def draw(shown: ShownSession, row: int, pencil: Pencil) -> Image:
    """Picture of a row of a session."""
    seen = shown.session
    posed = shown.corrected or shown.nominal
    pose = DrawnPose(seen.motor_position[row], posed.joint_angle[row], float(posed.jaw_angle[row]))
    title = f"{seen.metadata.get('arm')}, {seen.name}, {seen.time[row]:.2f} s"
    return pencil.picture(title, pose, list(markers(shown, row)))


def markers(shown: ShownSession, row: int) -> Iterator[Markers]:
    """Measured markers, and those of each twin and of the readout, in a row of a session."""
    measured = shown.session.marker[row]
    yield Markers("measured", MEASURED, measured)
    predicted = shown.nominal.marker[row]
    yield Markers(f"nominal twin{_off(predicted, measured)}", NOMINAL, predicted)
    if shown.corrected:
        predicted = shown.corrected.marker[row]
        yield Markers(f"corrected twin{_off(predicted, measured)}", CORRECTED, predicted)
    guess = shown.guess
    if guess and len(found := np.flatnonzero(guess.row == row)):
        estimated = guess.marker[found[0]]
        name = f"estimate of {guess.name}{_off(estimated, measured)}"
        yield Markers(name, ESTIMATED, estimated)


def row_at(shown: ShownSession, time: float) -> int:
    """The row nearest to a time [s], which must lie within the session."""
    clock = shown.session.time
    if not clock[0] <= time <= clock[-1]:
        raise SerpentError(
            f"{shown.path} is of {clock[0]:g} … {clock[-1]:g} s, and {time:g} s was asked for. Give a time "
            "within the session."
        )
    return int(np.abs(clock - time).argmin())


def already_there(out: Path, what: str, made: Callable[[Path], bool]) -> bool:
    """Whether a file is what would be written, as `made` finds; any other file there is an error."""
    if not out.exists():
        return False
    if out.is_file() and made(out):
        return True
    raise SerpentError(
        f"{out} exists and is not {what} of this session, readout and twin. Give another --out, or delete "
        "the file first."
    )


def says(name: str) -> Callable[[Path], bool]:
    """Whether a file has a name somewhere in it."""
    return lambda path: name.encode() in path.read_bytes()


def _off(predicted: Array, measured: Array) -> str:
    """Mean distance of the markers seen, in words."""
    far = np.linalg.norm(predicted - measured, axis=-1)
    far = far[np.isfinite(far)]
    return f": markers {1e3 * far.mean():.1f} mm off" if far.size else ""
