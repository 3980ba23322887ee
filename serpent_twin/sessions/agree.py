"""Check that a session found in a take agrees with its prediction, marker by marker."""

from collections.abc import Mapping, Sequence

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import Rigid
from serpent_twin.numerals import counted
from serpent_twin.sessions.film import Film
from serpent_twin.sessions.labels import CLEARER, GATE, stretches

SAME_ARM = GATE / 2  # m rms over all markers; four arms unlike the twin leave 14 … 19 mm
FRAME_OFF = 0.05  # m: mean shift of the markers by another frame; the four arms make 14 … 17 mm
FRAME_TURNED = np.radians(20)  # the four arms make 7 … 9°


def refuse_names(
    film: Film, expected: Array, owner: Mapping[int, int], names: Sequence[str]
) -> None:
    """Raise if a named column shows, for a while or always, what is clearly another marker.

    `expected` (T, 9, 3) is the prediction in the cameras' frame, `owner` maps columns to markers.
    """
    wrong = []
    for column, marker in owner.items():
        parts, far = stretches(film, expected, column)
        nearest = far.argmin(axis=1)
        least = far.min(axis=1)
        odd = (nearest != marker) & (least < GATE) & (least < CLEARER * far[:, marker])
        for other in np.unique(nearest[odd]):
            part = np.concatenate([parts[n] for n in np.flatnonzero(odd & (nearest == other))])
            wrong.append(
                f"{names[column]!r}, given as marker {marker + 1}, looks like marker {other + 1} in "
                f"{counted(len(part), 'frame')} from {film.time[part[0]]:.2f} s of the cameras' clock on"
            )
    if wrong:
        raise SerpentError(
            f"the take's labels do not fit the motion: {'; '.join(wrong)}. Correct the labels in "
            "Motive and export again, or give the true order with --labels."
        )


def refuse_another_arm(marker: Array, seen: Array) -> None:
    """Raise if markers (K, 9, 3), `seen` in the base frame, are too far from the prediction."""
    square = ((seen - marker) ** 2).sum(axis=-1)
    each = np.array([rms(column) for column in square.T])
    whole = rms(square)
    if not whole <= SAME_ARM or (each > GATE).any():
        sizes = ", ".join(f"{n} {1e3 * r:.0f}" for n, r in enumerate(each, 1) if np.isfinite(r))
        raise SerpentError(
            f"the take's markers are {1e3 * whole:.0f} mm rms from where the motors put them, more "
            f"than {1e3 * SAME_ARM:.0f} mm, or one of them more than {1e3 * GATE:.0f} mm (by marker, "
            f"in mm: {sizes}). Check that the take is of this arm and session, the arm's zero, and "
            "the labels."
        )


def refuse_frame(given: Rigid, source: str, fitted: Rigid, points: Array) -> None:
    """Raise if a given camera → base frame is not that of the arm at `points` (..., 3) of the cameras."""
    shift = np.linalg.norm(given.apply(points) - fitted.apply(points), axis=-1)
    off = float(shift[np.isfinite(shift)].mean()) if np.isfinite(shift).any() else 0.0
    cosine = (np.trace(given.rotation @ fitted.rotation.T) - 1) / 2
    turned = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if off > FRAME_OFF or turned > FRAME_TURNED:
        raise SerpentError(
            f"by the {source}, the markers are {1e3 * off:.0f} mm away from where the motors say they "
            f"are, and turned by {np.degrees(turned):.0f}°; up to "
            f"{1e3 * FRAME_OFF:.0f} mm and {np.degrees(FRAME_TURNED):.0f}° are believed. The cameras "
            "were calibrated again, or it is another base's frame: find it again, or leave it out."
        )


def rms(square: Array) -> float:
    """Root of the mean of known squares; NaN if there are none."""
    known = square[np.isfinite(square)]
    return float(np.sqrt(known.mean())) if known.size else float("nan")
