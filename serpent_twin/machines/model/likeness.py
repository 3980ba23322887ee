"""Refuse columns that follow the model with the other sign, in another unit or on another clock, or that are
each other's.
"""

from collections.abc import Iterator
from itertools import combinations

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION, DriveColumn, MeasuredColumns
from serpent_twin.machines.model.doubts import FEWEST
from serpent_twin.tables.segments import Segments
from serpent_twin.units import TO_SI

_ALIKE, _ABOUT = 0.9, 1.4
"""Correlation with the model from which on a column is the same motion; the ratio to another unit's"""
_GEARED = 8.0
"""Factor by which a torque differs from the model's where a gear, or a torque constant, is missing or there
twice: masses are not as wrong as that
"""
_LATE = 0.5
"""Longest delay of a servo: it looks like another sign where a motion is quick [s]"""
_EARLY, _FARTHEST = 0.2, 1.0
"""Longest time by which a servo may move before its command until two clocks are suspected; longest time by
which a motion before or after its command is searched [s]
"""
_SAME = 0.98
"""Correlation of one motion on two clocks"""


def require_units(machine: Described, pieces: Segments, found: Array) -> None:
    """Refuse a column that follows the model, (S, T, C), or else the servo of its joint, but with the other
    sign, in another unit or before it is told to.
    """
    at, by_session = 0, _by_session(pieces)
    for each in machine.about.measured:
        parts = slice(at, at := at + len(each.columns))
        measured, like = pieces.measured[..., parts], found[..., parts]
        usual = np.median([abs(_correlation(measured[n], like[n])[0]) for n in by_session.values()])
        known = bool(usual > _ALIKE)
        for session, of in by_session.items():
            if why := _amiss(machine, each, pieces.take(of), measured[of], like[of], known):
                columns = ", ".join(map(repr, each.columns))
                raise SerpentError(f"{machine.path}: {columns} of {session} {why}")


def _by_session(pieces: Segments) -> dict[str, list[int]]:
    """Segments of each session."""
    found = dict[str, list[int]]()
    for n, session in enumerate(pieces.session):
        found.setdefault(session, []).append(n)
    return found


def require_own(machine: Described, pieces: Segments, found: Array) -> None:
    """Refuse two columns that follow what the model, (S, T, C), or the servo of its joint, shows of each
    other.
    """
    names = [each for each in machine.about.measured for _ in each.columns]
    alone = {n: each for n, each in enumerate(names) if len(each.columns) == 1}
    shown = {n: _shown(machine, each, n, pieces, found) for n, each in alone.items()}
    for i, j in combinations(alone, 2):
        one, other = alone[i], alone[j]
        if one.measure != other.measure:
            continue
        first, second = pieces.measured[..., [i]], pieces.measured[..., [j]]
        own = max(_best(first, shown[i]), _best(second, shown[j]))
        if min(_best(first, shown[j]), _best(second, shown[i])) > _ALIKE > own:
            raise SerpentError(
                f"{machine.path}: {one.columns[0]!r} moves as the model's {' '.join(other.of)} does, and "
                f"{other.columns[0]!r} as its {' '.join(one.of)}. Exchange these columns, or those of their "
                "drives, in machine.toml."
            )


def _best(measured: Array, several: list[Array]) -> float:
    """The best correlation of a motion with some others, (S, T, 1) each."""
    return max(_correlation(measured, each)[0] for each in several)


def _shown(
    machine: Described, each: MeasuredColumns, at: int, pieces: Segments, found: Array
) -> list[Array]:
    """What the model shows of a measured thing, and what its servos are told, (S, T, 1) each."""
    goals = [goal for _, goal in _servos(machine, each.joint, pieces)]
    return [found[..., [at]], *goals]


def _amiss(
    machine: Described,
    each: MeasuredColumns,
    pieces: Segments,
    measured: Array,
    found: Array,
    known: bool,
) -> str:
    """What is wrong with what is measured of a session, (S, T, c), where the model shows (S, T, c).

    Unless the model is `known` to follow most sessions with either sign, one session that follows it with the
    other sign is chance: a model may lack friction, and a session be short.
    """
    period = float(np.median(pieces.period)) if machine.about.rows == MOTION else np.inf
    late, thing = int(np.ceil(_LATE / period)), f"the model's {' '.join(each.of)}"
    sign, ratio = _alike(measured, found, late)
    sign = sign if known else max(sign, 0)
    by_model = _unlike(each.unit, sign, ratio, "its unit")
    if machine.about.held and sign > 0 and not by_model and abs(np.log(ratio)) > np.log(_GEARED):
        return (
            f"would fit {thing} if it were {ratio:.3g} times as large, as where a gear or a torque "
            "constant is missing or counts twice. Multiply its scale in machine.toml by that, or mend the "
            "gear in the model."
        )
    if sign > 0 and not by_model and abs(np.log(ratio)) < np.log(_ABOUT):
        return ""
    for drive, goal in _servos(machine, each.joint, pieces):
        if ahead := _ahead(measured, goal, period):
            when = "before" if ahead > 0 else "after"
            return (
                f"moves {abs(ahead) * period:.2g} s {when} {drive.column!r} tells it to, as on two clocks. "
                "Put both on one clock: `log import` does so."
            )
        sign, ratio = _alike(measured, goal, late)
        own = _unlike(each.unit, sign, ratio, "its unit")
        of_drive = _unlike(drive.unit, sign, 1 / ratio, f"the unit of {drive.column!r}")
        if own and of_drive and sign > 0:
            return f"would fit {thing} {own.partition('. ')[0]}, or {of_drive}"
        if own or of_drive:
            return f"would fit {thing} {own or of_drive}"
    return f"would fit {thing} {by_model}" if by_model else ""


def _servos(
    machine: Described, joint: str, pieces: Segments
) -> Iterator[tuple[DriveColumn, Array]]:
    """The drives of a joint's servos, and where these are told to be, (S, T, 1)."""
    model = machine.model
    for each in machine.commanded if joint else ():
        n = model.actuator(each.actuator).id
        turns = model.actuator_trntype[n] == mujoco.mjtTrn.mjTRN_JOINT
        there = turns and model.actuator_trnid[n, 0] == model.joint(joint).id
        if there and machine.is_servo(each.actuator):
            yield each, pieces.column[each.column][..., None] / model.actuator_gear[n, 0]


def _alike(measured: Array, like: Array, late: int) -> tuple[int, float]:
    """Whether a motion (S, T, C) is the same as another, 1, or its opposite, −1, and how many times larger
    the other is; 0 for another motion, or one that may be as late as so many rows.
    """
    at_once, ratio = _correlation(measured, like)
    if at_once > _ALIKE:
        return 1, ratio
    opposite = at_once < -_ALIKE
    shifted = (_correlation(measured[:, n:], like[:, :-n])[0] for n in range(1, late + 1))
    return -int(opposite and all(each < _ALIKE for each in shifted)), ratio


def _ahead(measured: Array, goal: Array, period: float) -> int:
    """Rows by which a motion (S, T, 1) precedes what it follows, negative if it comes after; 0 where it may
    be as commanded.
    """
    early, late, last = (int(each / period) for each in (_EARLY, _LATE, _FARTHEST))
    now, _ = _correlation(measured, goal)
    if now > _ALIKE:
        return 0
    by = {}
    for n in range(1, min(last, measured.shape[1] // 2)):
        by[n] = _correlation(measured[:, :-n], goal[:, n:])[0]
        by[-n] = _correlation(measured[:, n:], goal[:, :-n])[0]
    best = max(by, key=by.__getitem__, default=0)
    return best if not -late <= best <= early and by[best] > _SAME else 0


def _correlation(a: Array, b: Array) -> tuple[float, float]:
    """Correlation of two motions (S, T, C), and how many times larger the second is; correlation 0 where
    little is known.
    """
    known = np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
    if known.sum() < FEWEST:
        return 0.0, 1.0
    a, b = (each[known] - each[known].mean(axis=0) for each in (a, b))
    power, other = float((a**2).sum()), float((b**2).sum())
    if power == 0 or other == 0:
        return 0.0, 1.0
    return float((a * b).sum()) / np.sqrt(power * other), np.sqrt(other / power)


def _unlike(unit: str, sign: int, ratio: float, which: str) -> str:
    """How a motion would be so many times as large, and what to do; nothing where it is already."""
    if sign < 0:
        return (
            "with the other sign. Turn the sign of its scale, or of its drive's, in machine.toml."
        )
    factor, of = TO_SI[unit]
    far = {
        other: abs(np.log(ratio * factor / size))
        for other, (size, kind) in TO_SI.items()
        if kind == of
    }
    best = min(far, key=far.__getitem__)
    if not sign or best == unit or not far[best] < np.log(_ABOUT) < far[unit]:
        return ""
    return f"if {which} were {best}, not {unit}. State the unit in machine.toml."
