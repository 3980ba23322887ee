"""Undo possible faults of the markers one by one, and find which leaves a possible arm."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import Rigid, fit_rigid
from serpent_twin.sessions.marker_fit import MarkerFit, fit
from serpent_twin.sessions.posed_markers import missed

LABELS = "Correct the labels, in Motive or by --labels, and export or record again."
FRAME = "Find the base frame again: python -m serpent_twin.mocap frame --help."
CAMERAS = (
    "Calibrate the cameras with their wand's true length, or name the unit that the numbers have."
)
COLUMNS = "Correct what wrote these columns."
GLUED = "Put it back where it belongs, or label it again."
AXES = "xyz"
ROWS = 16  # rows on which each suspect is tried
UNITS = {1e3: "millimetres", 1e2: "centimetres", 1 / 0.0254: "inches", 1e-3: "kilometres"}
ODD_SCALE = 0.028  # reported from here: links built 2 % off make one of 80 arms 2.1 % larger
ODD_TURN, ODD_SHIFT = np.radians(6), 6e-3  # rad, m: reported from these values
ALIKE, SPARE = 1.5, 5e-4  # a simpler fault may leave this many times the least, + m

Undo = Callable[[Array], Array]


@dataclass(frozen=True)
class Suspect:
    """A fault and how to undo it."""

    text: str
    """What is wrong, in words that begin a sentence."""
    advice: str
    """What to do."""
    rank: int
    """Simpler faults have lower ones."""
    undo: Undo
    """Markers (N, 9, 3) with the fault → without."""


def found(marker: Array, start: Array, possible: float) -> tuple[Suspect, float] | None:
    """The simplest fault without which rows (N, 9, 3) are within `possible` [m] of a pose, and what then
    remains [m]; None if no single fault explains them.
    """
    some = np.unique(np.linspace(0, len(marker) - 1, min(ROWS, len(marker))).round().astype(int))
    marker, start = marker[some], start[some]
    suspects = [*_listed(marker, start)]
    undone = np.stack([suspect.undo(marker) for suspect in suspects])
    joint = joints_from_markers(undone, np.broadcast_to(start, (*undone.shape[:-2], N_JOINTS)))
    left = np.nanmedian(missed(joint, undone), axis=-1)
    limit = min(possible, ALIKE * float(np.nanmin(left)) + SPARE)
    good = [(s.rank, float(r), n) for n, (s, r) in enumerate(zip(suspects, left, strict=True))]
    good = [each for each in good if each[1] <= limit]
    if not good:
        return None
    _, least, n = min(good)
    return suspects[n], least


def _listed(marker: Array, start: Array) -> Iterator[Suspect]:
    yield from _frames(marker, start)
    yield from _axes()
    yield from _swapped()
    yield from _reordered(marker, start)
    yield from _coordinates()
    yield from _elsewhere()


def _frames(marker: Array, start: Array) -> Iterator[Suspect]:
    """Another scale, another frame, or both, also behind a mirror."""
    expected = markers(start)
    if not _spread(marker) > 0:
        return
    for mirror in (np.array([1, 1, 1]), np.array([1, 1, -1])):
        seen, what = marker * mirror, ["mirrored"] * bool(mirror[2] < 0)
        scale = _spread(seen) / _spread(expected)
        ways = [(0, fit(seen, start, scale=True, scaled=scale))]
        for rank, free in ((5, False), (6, True)):
            size = scale if free else 1.0
            try:
                rigid = fit_rigid(seen / size, expected)
            except SerpentError:  # too few markers for a frame
                continue
            best = fit(seen, start, frame=True, scale=free, to_base=rigid, scaled=size)
            ways.append((rank, _as_motor_1(best, start)))
        for rank, best in ways:
            words = [*what, *odd(best)]
            if words:
                text = f"The markers are {' and '.join(words)}"
                yield Suspect(text, advice(best), rank + 3 * bool(what), _undone(best, mirror))


def _undone(best: MarkerFit, mirror: Array) -> Undo:
    return lambda marker: best.undone(marker * mirror)


def _as_motor_1(best: MarkerFit, start: Array) -> MarkerFit:
    """The fit with the turn about joint 1, which no marker shows, from motor 1."""
    bend = float(np.mean(best.joint[:, 0] - start[:, 0]))
    c, s = np.cos(-bend), np.sin(-bend)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    to_base = Rigid(turn @ best.to_base.rotation, turn @ best.to_base.translation)
    joint = best.joint - bend * (np.arange(N_JOINTS) == 0)
    return MarkerFit(best.offset, best.rms, to_base, best.scale, joint)


def _spread(marker: Array) -> float:
    centre = np.nanmean(marker, axis=(0, 1))
    return float(np.sqrt(np.nanmean((marker - centre) ** 2)))


def odd(best: MarkerFit) -> list[str]:
    """What is odd about scale and frame of a fit, in words after `The markers are`."""
    words = []
    units = [unit for factor, unit in UNITS.items() if abs(best.scale / factor - 1) < 0.05]
    if units:
        words = [f"{best.scale:.4g} times as far apart as the arm's, as if in {units[0]}"]
    elif abs(best.scale - 1) > ODD_SCALE:
        words = [f"{best.scale:.3f} times as far apart as the arm's"]
    if best.turned > ODD_TURN:
        words.append(f"turned by {np.degrees(best.turned):.0f}°")
    if best.shifted / best.scale > ODD_SHIFT:
        words.append(f"shifted by {1e3 * best.shifted / best.scale:.0f} mm")
    return words


def advice(best: MarkerFit) -> str:
    """What to do about a fit's odd scale, frame or both."""
    if abs(best.scale - 1) <= ODD_SCALE:
        return FRAME
    return f"{CAMERAS} {FRAME}" if best.turned > ODD_TURN else CAMERAS


def _rearranged(source: np.ndarray, sign: Array) -> Undo:
    """Take each coordinate from another one, (9, 3) of 27, with a sign, or leave it out where that is NaN."""
    return lambda marker: marker.reshape(*marker.shape[:-2], -1)[..., source] * sign


def _as_it_is() -> tuple[np.ndarray, Array]:
    return np.arange(3 * N_JOINTS).reshape(N_JOINTS, 3), np.ones((N_JOINTS, 3))


def _axes() -> Iterator[Suspect]:
    """Columns that hold other axes of the base frame, or one with the other sign."""
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        if order == (0, 1, 2) and signs == (1, 1, 1):
            continue
        source, sign = _as_it_is()
        source[:, order], sign[:, order] = source.copy(), signs
        held = ", ".join(f"{'−' * (s < 0)}{AXES[a]}" for a, s in zip(order, signs, strict=True))
        text = f"x, y, z of the markers are {held} of the base frame"
        even = sum(a > b for a, b in combinations(order, 2)) % 2 == 0
        if sum(signs) == 1 and order == (0, 1, 2):
            text = f"The axis {AXES[signs.index(-1)]} of the markers is mirrored"
        elif even != (np.prod(signs) > 0):
            text += ", mirrored"
        yield Suspect(text, FRAME, 0, _rearranged(source, sign))


def _swapped() -> Iterator[Suspect]:
    """Two markers, or one coordinate of them."""
    for i, j in combinations(range(N_JOINTS), 2):
        pair = f"arkers {i + 1} and {j + 1} are swapped"
        source, sign = _as_it_is()
        source[[i, j]] = source[[j, i]]
        yield Suspect(f"M{pair}", LABELS, 1, _rearranged(source, sign))
        for axis in range(3):
            source, sign = _as_it_is()
            source[[i, j], axis] = source[[j, i], axis]
            yield Suspect(f"{AXES[axis]} of m{pair}", COLUMNS, 2, _rearranged(source, sign))


def _reordered(marker: Array, start: Array) -> Iterator[Suspect]:
    """Markers in the order in which they are nearest to where the motors let expect them."""
    from scipy.optimize import linear_sum_assignment

    known = np.flatnonzero(np.isfinite(marker).any(axis=(0, 2)))
    far = np.linalg.norm(marker[:, None, known] - markers(start)[:, :, None], axis=-1)
    places, columns = linear_sum_assignment(np.nanmedian(far, axis=0))
    source, sign = _as_it_is()
    where = source.copy()
    source[places] = where[known[columns]]
    sign[np.setdiff1d(np.arange(N_JOINTS), places)] = np.nan
    if (places != known[columns]).any():
        order = source[:, 0] // 3 + 1
        held = ", ".join(
            "–" if np.isnan(s) else f"{n}" for n, s in zip(order, sign[:, 0], strict=True)
        )
        text = f"Markers 1 … 9 of the arm are the log's {held}"
        yield Suspect(text, LABELS, 3, _rearranged(source, sign))


def _coordinates() -> Iterator[Suspect]:
    """Coordinates of one marker that are swapped or have the wrong sign."""
    for k in range(N_JOINTS):
        for a, b in combinations(range(3), 2):
            source, sign = _as_it_is()
            source[k, [a, b]] = source[k, [b, a]]
            text = f"{AXES[a]} and {AXES[b]} of marker {k + 1} are swapped"
            yield Suspect(text, COLUMNS, 3, _rearranged(source, sign))
        for axis in range(3):
            source, sign = _as_it_is()
            sign[k, axis] = -1
            text = f"{AXES[axis]} of marker {k + 1} has the wrong sign"
            yield Suspect(text, COLUMNS, 3, _rearranged(source, sign))


def _elsewhere() -> Iterator[Suspect]:
    """One or two markers that are not where the others say."""
    for which in [(k,) for k in range(N_JOINTS)] + list(combinations(range(N_JOINTS), 2)):
        source, sign = _as_it_is()
        sign[list(which)] = np.nan
        names = " and ".join(str(k + 1) for k in which)
        text = (
            f"Marker {names} is elsewhere" if len(which) == 1 else f"Markers {names} are elsewhere"
        )
        yield Suspect(text, GLUED, 4 if len(which) == 1 else 8, _rearranged(source, sign))
