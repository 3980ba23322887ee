"""Find the base in the cameras' frame while the arm hangs straight."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, markers
from serpent_twin.arrays import Array, known_mean
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import Rigid, fit_rigid
from serpent_twin.hardware.natnet_live import NatNet, NatNetMocap
from serpent_twin.numerals import counted
from serpent_twin.stored import within

STILL = 0.002  # m: by how much a still marker's mean may differ between two halves of the recording
MOST = 0.003  # m: a marker further from its place is mislabelled, misplaced, or the arm is not straight
FEWEST = 30  # frames to decide that the arm is still
SWING = 0.005  # m: standard deviation that cameras' noise never makes
SHOWN = 0.5  # share of the frames that must show a marker


@dataclass(frozen=True)
class Straight(Checked):
    """Find the base frame: Motive streams while the arm hangs straight and still, all angles zero.

    The nine markers are compared with where they belong. Nothing is written if one is lost, moves,
    or is further off than --placed-within. Joint 1 must be at zero: the markers turn about it as one
    body, so its angle becomes the frame's, unseen.
    """

    out: Path = Path("frame.json")
    """File for the transform from the cameras' to the base frame; an existing one is kept, and refused."""
    seconds: Annotated[float, within(0.1, 2, "s")] = 1.0
    """How long to look [s], up to 2; at least 30 frames must come in."""
    natnet: NatNet = field(default=NatNet())
    """Where Motive streams."""
    placed_within: Annotated[float, within(1e-4, 1, "m")] = MOST
    """How far from their places the markers may sit on the links [m]; more lets a bent arm pass."""


def measure(config: Straight) -> tuple[Rigid, list[str], Array]:
    """The cameras → base transform, the labels, and each marker's residual [m], (9,)."""
    if config.out.exists():
        raise SerpentError(
            f"{config.out} exists already and is kept: move it away, or name another --out."
        )
    with NatNetMocap(config.natnet) as cameras:
        time.sleep(config.seconds)
        frames = [f for f in cameras.frames if f.arrival > time.monotonic() - config.seconds]
        labels, wanted = cameras.labels, cameras.ids
    nowhere = np.full(3, np.nan)
    seen = np.array([[frame.markers.get(key, nowhere) for key in wanted] for frame in frames])
    rigid, left = fit_straight(seen.reshape(-1, N_JOINTS, 3), labels, config.placed_within)
    return rigid, labels, left


def fit_straight(
    seen: Array, labels: list[str], placed_within: float = MOST
) -> tuple[Rigid, Array]:
    """Fit frames (T, 9, 3) in which the arm hangs straight; raises and names what is wrong."""
    if len(seen) < FEWEST:
        raise SerpentError(
            f"no frame was found: {counted(len(seen), 'frame')} of the cameras came in, and "
            f"{FEWEST} are needed to "
            "see that the arm is still. Look longer with --seconds, or raise the cameras' rate."
        )
    shown = np.isfinite(seen).all(axis=-1)
    _refuse(shown.mean(axis=0) < SHOWN, labels, "hidden from the cameras", "Make them visible.")
    first, second = (known_mean(half, axis=0) for half in np.array_split(seen, 2))
    stray = np.linalg.norm(second - first, axis=-1)
    swing = np.linalg.norm(np.nanstd(seen, axis=0), axis=-1)
    still = (stray <= STILL) & (swing <= SWING)  # false for NaN: lost in one half
    _refuse(~still, labels, "moving or lost for a while", "Wait until the arm hangs still.")
    middle, place = np.nanmean(seen, axis=0), markers(np.zeros(N_JOINTS))
    rigid = fit_rigid(middle, place)
    left = np.linalg.norm(rigid.apply(middle) - place, axis=-1)
    sizes = ", ".join(f"{label} {1e3 * size:.1f}" for label, size in zip(labels, left, strict=True))
    _refuse(
        left > placed_within,
        labels,
        f"more than {1e3 * placed_within:.0f} mm from where a straight arm has them",
        f"Residuals in mm: {sizes}. Straighten the arm, or correct the order of the labels.",
    )
    return rigid, left


def _refuse(bad: np.ndarray, labels: list[str], fault: str, advice: str) -> None:
    if bad.any():
        named = ", ".join(f"{n + 1} ({labels[n]})" for n in np.flatnonzero(bad))
        raise SerpentError(
            f"no frame was found: marker {named} {'are' if bad.sum() > 1 else 'is'} {fault}. {advice}"
        )
