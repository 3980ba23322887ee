"""Where is the base, seen from the cameras, while the arm hangs straight?"""

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from serpent_twin.arm import N_JOINTS, Array, markers
from serpent_twin.errors import SerpentError
from serpent_twin.mocap.frame import Rigid, fit_rigid
from serpent_twin.mocap.natnet.live import NatNet, NatNetMocap

STILL = 0.002  # m: by how much a still marker's mean may differ between two halves of the look
MOST = 0.010  # m: a marker further from its place is mislabelled, misplaced, or the arm is not straight
SWING = 0.005  # m: standard deviation that cameras' noise never makes
SHOWN = 0.5  # share of the frames that must show a marker


@dataclass(frozen=True)
class Straight:
    """Find the base frame: Motive streams while the arm hangs straight and still, all angles zero.

    The nine markers are compared with where they belong. Nothing is written if one is lost, moves,
    or is more than 10 mm off.
    """

    out: Path = Path("frame.json")
    """File for the transform from the cameras' to the base frame."""
    seconds: float = 1.0
    """How long to look [s], up to 2."""
    natnet: NatNet = field(default=NatNet())
    """Where Motive streams."""


def measure(config: Straight) -> tuple[Rigid, list[str], Array]:
    """The cameras → base transform, the labels, and each marker's residual [m], (9,)."""
    if not 0 < config.seconds <= 2:
        raise SerpentError(f"--seconds is {config.seconds:g}; give a time of 0 … 2 s.")
    with NatNetMocap(config.natnet) as cameras:
        time.sleep(config.seconds)
        frames = [f for f in cameras.frames if f.arrival > time.monotonic() - config.seconds]
        labels, wanted = cameras.labels, cameras.ids
    nowhere = np.full(3, np.nan)
    seen = np.array([[frame.markers.get(key, nowhere) for key in wanted] for frame in frames])
    rigid, left = fit_straight(seen.reshape(-1, N_JOINTS, 3), labels)
    return rigid, labels, left


def fit_straight(seen: Array, labels: list[str]) -> tuple[Rigid, Array]:
    """Fit frames (T, 9, 3) in which the arm hangs straight; raises and names what is wrong."""
    shown = np.isfinite(seen).all(axis=-1)
    share = shown.mean(axis=0) if len(seen) else np.zeros(N_JOINTS)
    _refuse(share < SHOWN, labels, "hidden from the cameras", "Make them visible.")
    halves = [np.nanmean(half, axis=0) for half in np.array_split(seen, 2)]
    stray = np.linalg.norm(halves[1] - halves[0], axis=-1)
    swing = np.linalg.norm(np.nanstd(seen, axis=0), axis=-1)
    _refuse((stray > STILL) | (swing > SWING), labels, "moving", "Wait until the arm hangs still.")
    middle, place = np.nanmean(seen, axis=0), markers(np.zeros(N_JOINTS))
    rigid = fit_rigid(middle, place)
    left = np.linalg.norm(rigid.apply(middle) - place, axis=-1)
    sizes = ", ".join(f"{label} {1e3 * size:.1f}" for label, size in zip(labels, left, strict=True))
    _refuse(
        left > MOST,
        labels,
        "more than 10 mm from where a straight arm has them",
        f"Residuals in mm: {sizes}. Straighten the arm, or correct the order of the labels.",
    )
    return rigid, left


def _refuse(bad: np.ndarray, labels: list[str], fault: str, advice: str) -> None:
    if bad.any():
        named = ", ".join(f"{n + 1} ({labels[n]})" for n in np.flatnonzero(bad))
        raise SerpentError(
            f"no frame was found: marker {named} {'are' if bad.sum() > 1 else 'is'} {fault}. {advice}"
        )
