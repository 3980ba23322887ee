"""What may be wrong with the markers of a log, and the words that name it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from serpent_twin.arrays import Array


@dataclass(frozen=True)
class Fault:
    """Markers (T, 9, 3) without the fault → with it, and what a refusal says."""

    change: Callable[[Array], Array]
    says: str
    of_take: str = ""
    """What `merge` says where it is in the take, if that is something else."""


def swapped(i: int, j: int, axes=(0, 1, 2), rows=slice(None)) -> Callable[[Array], Array]:
    def change(marker):
        other = marker.copy()
        for axis in axes:
            other[rows, i - 1, axis] = marker[rows, j - 1, axis]
            other[rows, j - 1, axis] = marker[rows, i - 1, axis]
        return other

    return change


def moved(k: int, by) -> Callable[[Array], Array]:
    return lambda marker: marker + np.where(np.arange(9)[:, None] == k - 1, by, 0.0)


def lost(*numbers: int) -> Callable[[Array], Array]:
    which = np.isin(np.arange(9), np.array(numbers) - 1)
    return lambda marker: np.where(which[:, None], np.nan, marker)


def standing(k: int) -> Callable[[Array], Array]:
    def change(marker):
        other, rng = marker.copy(), np.random.default_rng(0)
        place = np.nanmean(marker[:5, k - 1], axis=0)
        other[:, k - 1] = place + 2e-4 * rng.standard_normal((len(marker), 3))
        return other

    return change


def turned(axis: str, degrees: float) -> Callable[[Array], Array]:
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    return lambda marker: marker @ turn.T


LABELS = r"'\d', given as marker \d, looks like marker \d"
FRAME = r"by the frame file|Find the base frame again"
FAULTS = {
    "scaled by 1.2": Fault(lambda m: 1.2 * m, r"1\.(2\d*|19\d) times as far apart as the arm's"),
    "scaled by 1.03": Fault(lambda m: 1.03 * m, r"1\.03\d* times as far apart"),
    "scaled by 0.9": Fault(lambda m: 0.9 * m, r"0\.(9\d*|89\d) times as far apart"),
    "millimetres": Fault(lambda m: 1000 * m, r"10\d\d times as far apart|as if in millimetres"),
    "no marker 9": Fault(lost(9), r"Marker 9 is missing: seen in no row"),
    "no markers 2 and 5": Fault(lost(2, 5), r"Markers 2 and 5 are missing"),
    "markers swapped": Fault(swapped(3, 5), r"Markers 3 and 5 are swapped", LABELS),
    "neighbours swapped": Fault(swapped(8, 9), r"Markers 8 and 9 are swapped", LABELS),
    "x swapped": Fault(swapped(3, 5, (0,)), r"x of markers 3 and 5 are swapped", LABELS),
    "y swapped": Fault(swapped(2, 7, (1,)), r"y of markers 2 and 7 are swapped"),
    "reversed": Fault(lambda m: m[:, ::-1], r"log's 9, 8, 7, 6, 5, 4, 3, 2, 1", LABELS),
    "mirrored": Fault(lambda m: m * [1, 1, -1], r"axis z .* is mirrored", r"are mirrored"),
    "y up": Fault(lambda m: m[..., [0, 2, 1]] * [1, 1, -1], r"are x, z, −y of the base", FRAME),
    "turned": Fault(turned("x", 12), r"turned by 12°", FRAME),
    "turned about joint 1": Fault(turned("z", 20), r"turned by \+2\d°|turned by 2\d°", FRAME),
    "shifted": Fault(lambda m: m + [0.0, 0.0, 0.02], r"shifted by 20 mm", FRAME),
    "one elsewhere": Fault(moved(6, [0.0, 0.04, 0.0]), r"Marker 6 is elsewhere.* 40 mm from its"),
    "one misplaced": Fault(moved(4, [0.015, 0.0, 0.0]), r"Marker 4 sits 1\d mm from its place"),
    "one standing still": Fault(standing(7), r"[Mm]arker 7 stands still"),
}
