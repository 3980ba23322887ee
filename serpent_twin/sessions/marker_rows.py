"""Say what is wrong with rows whose markers no pose of the arm explains."""

import numpy as np

from serpent_twin.arm.geometry import markers
from serpent_twin.arrays import Array
from serpent_twin.numerals import listed
from serpent_twin.sessions import suspect_markers
from serpent_twin.sessions.finding import spans_text
from serpent_twin.sessions.posed_markers import CLOSE, posed

POSSIBLE = 5e-3  # m rms of rows once a fault is undone
BRIDGED = 3  # rows between two of a kind that are reported with them
ALL = 0.8  # share of the rows that is reported as all
HALVED = 0.5  # of what poses miss a row by: so much less, and the row has the fault, too
STILL = 0.2  # of the motion that a marker should have


def what_is_wrong(
    marker: Array, start: Array, left: Array, bad: np.ndarray, looked: np.ndarray
) -> str:
    """The fault in one sentence or two. `left` (N,) is what poses miss markers (N, 9, 3) by [m], `bad` (N,)
    where that is too much, `looked` (N,) the rows' numbers.
    """
    miss = (
        f"The nearest poses of the arm miss the markers by {1e3 * np.median(left[bad]):.0f} mm rms"
    )
    best = suspect_markers.found(marker[bad], start[bad], POSSIBLE)
    if best is None:
        return (
            f"{miss}, {_where(bad, looked)}, and no single fault of scale, frame, order or place explains "
            "it: they are of another machine, in another frame, or their labels are mixed up. "
            f"{suspect_markers.LABELS} {suspect_markers.FRAME}"
        )
    suspect, remains = best
    undone = suspect.undo(marker)
    wrong = bad | ((left > CLOSE) & (posed(undone, start)[1] < HALVED * left))
    how = _how_far(marker[wrong], start[wrong], undone[wrong])
    return (
        f"{suspect.text}, {_where(wrong, looked)}{how}. {miss} as they are, and by {1e3 * remains:.1f} mm "
        f"once that is undone. {suspect.advice}"
    )


def _where(wrong: np.ndarray, looked: np.ndarray) -> str:
    if wrong.mean() > ALL:
        return "in all rows"
    if len(looked) > 1 and np.diff(looked).min() > 1:  # only some rows were looked at
        return f"in {wrong.mean():.0%} of the rows, from row {looked[wrong][0]} on"
    return f"in {spans_text(looked[wrong], BRIDGED)}"


def _how_far(marker: Array, start: Array, undone: Array) -> str:
    """Clause on how far markers that are elsewhere are off, and whether they stand still."""
    gone = np.flatnonzero(np.isnan(undone).all(axis=(0, 2)) & np.isfinite(marker).any(axis=(0, 2)))
    if len(gone) == 0:
        return ""
    expected = markers(posed(undone, start)[0])
    far = 1e3 * np.nanmedian(np.linalg.norm(marker - expected, axis=-1)[:, gone], axis=0)
    still = [k + 1 for k in gone.tolist() if spread(marker[:, k]) < STILL * spread(expected[:, k])]
    text = f", {listed(far.round().astype(int))} mm from its place"
    return f"{text}, and marker {listed(still)} stands still" if still else text


def spread(place: Array) -> float:
    """How far a marker moves about its mean place [m], rms, from (N, 3) with NaN."""
    place = place[np.isfinite(place).all(axis=-1)]
    return float(np.sqrt(place.var(axis=0).sum())) if len(place) else float("nan")
