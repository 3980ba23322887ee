"""Find the small faults of markers that only many rows together show."""

from collections.abc import Iterator

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, markers
from serpent_twin.arrays import Array
from serpent_twin.sessions import marker_fit, suspect_markers
from serpent_twin.sessions.finding import Finding, spans_text
from serpent_twin.sessions.marker_rows import BRIDGED, STILL, spread

MISPLACED = 11e-3  # m: links that are built 2 % off make a marker seem up to 8.7 off in 80 arms
DOUBTED = 2.5e-3  # m: markers misplaced by less are of no odd frame
SCATTER = 4e-3  # m rms of a coordinate that no places on links explain; cameras: tenths
HALVED = 0.5  # an odd frame is accepted if it leaves this share of the markers' offsets
TURNED = np.radians(10)  # of joint 1 against motor 1, in the mean; arms without fault: up to 4.4°
STRANGE = 0.2  # correlation of joints with motors; arms: 0.55 and more, another session: 0
MOVING, ENOUGH = np.radians(2), 40  # rad of a motor and rows, to say that markers follow it
BLOCK = 100  # rows of a part that is looked at for itself
MOVES = 4e-3  # m: a marker that should move by this much, rms, can be seen to stand still


def faults(marker: Array, start: Array, joint: Array, looked: np.ndarray) -> Iterator[Finding]:
    """What is wrong with markers (N, 9, 3) of rows that poses explain: `start` (N, 9) are the joint angles
    by the motors, `joint` (N, 9) by the markers, `looked` (N,) the rows' numbers.
    """
    found = [*_still(marker, start, looked)] or [*_places(marker, joint)]
    found = found or [*_followed(joint, start)]
    parts = np.array_split(np.arange(len(marker)), min(4, len(marker) // BLOCK) or 1)
    if not found and len(parts) > 1:
        for part in parts:
            where = f", in rows {looked[part[0]]}–{looked[part[-1]]}"
            found += _places(marker[part], joint[part], MISPLACED, where)
    yield from found


def _places(
    marker: Array, joint: Array, doubted: float = DOUBTED, where: str = ""
) -> Iterator[Finding]:
    """Where the markers sit by all rows together, and, if that is `doubted` [m], in which scale and frame."""
    some = np.linspace(0, len(marker) - 1, min(len(marker), marker_fit.ROWS)).round().astype(int)
    marker, joint = marker[some], joint[some]
    plain = marker_fit.fit(marker, joint)
    if plain.misplaced > doubted:
        scaled = marker_fit.fit(marker, joint, scale=True)
        framed = marker_fit.fit(marker, joint, frame=True, scale=True)
        for best in (scaled, framed):
            words = suspect_markers.odd(best)
            if words and best.misplaced < HALVED * plain.misplaced:
                what = f"The markers are {' and '.join(words)}{where}"
                yield Finding("error", f"{what}. {suspect_markers.advice(best)}")
                return
    off = np.linalg.norm(plain.offset, axis=-1)
    for k in np.flatnonzero((off > MISPLACED) & (off > HALVED * off.max())):
        at = ", ".join(f"{1e3 * x:+.0f}" for x in plain.offset[k])
        yield Finding(
            "error",
            f"Marker {k + 1} sits {1e3 * off[k]:.0f} mm from its place on link {k + 1} ({at} mm along "
            f"the link's x, y, z){where}. {suspect_markers.GLUED}",
        )
    if plain.rms > SCATTER:
        yield Finding(
            "error",
            f"The markers scatter by {1e3 * plain.rms:.1f} mm a coordinate about every pose of the arm"
            f"{where}; up to {1e3 * SCATTER:.0f} mm is accepted. Calibrate the cameras again.",
        )


def _still(marker: Array, start: Array, looked: np.ndarray) -> Iterator[Finding]:
    """Markers that stay where they are for long while the motors move them."""
    parts = np.array_split(np.arange(len(marker)), max(1, len(marker) // BLOCK))
    expected = markers(start)
    for k in range(N_JOINTS):
        rows, size = [], 0.0
        for part in parts if len(marker) >= BLOCK else []:
            seen = part[np.isfinite(marker[part, k]).all(axis=-1)]
            want = spread(expected[seen, k])
            if len(seen) > BLOCK / 2 and want > MOVES and spread(marker[seen, k]) < STILL * want:
                rows, size = [*rows, *part], max(size, want)
        if rows:
            where = spans_text(looked[rows], BRIDGED)
            text = f"Marker {k + 1} stands still in {where} while the motors move it by {1e3 * size:.0f} mm"
            yield Finding("error", f"{text} rms. {suspect_markers.GLUED}")


def _followed(joint: Array, start: Array) -> Iterator[Finding]:
    """Whether joint 1 agrees with motor 1, and the joints move as the motors do."""
    turned = float(np.mean(joint[:, 0] - start[:, 0]))
    if abs(turned) > TURNED:
        yield Finding(
            "error",
            f"The markers are turned by {np.degrees(turned):+.0f}° about joint 1's axis, by motor 1. "
            f"Joint 1 was bent when the base frame or the motors' zero was found. {suspect_markers.FRAME}",
        )
    moving = start.std(axis=0) > MOVING
    if len(start) < ENOUGH or moving.sum() < 3:
        return
    a, b = (x[:, moving] - x[:, moving].mean(axis=0) for x in (joint, start))
    size = np.sqrt((a**2).sum(axis=0) * (b**2).sum(axis=0))
    alike = float(np.median((a * b).sum(axis=0) / np.maximum(size, 1e-12)))
    if alike < STRANGE:
        yield Finding(
            "error",
            f"The markers do not move as the motors do: their joint angles correlate by {alike:.2f}, "
            "where an arm's correlate by 0.5 and more. They are of another session, or shifted in time.",
        )
