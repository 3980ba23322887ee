"""Measure how much logs excite each motor and joint, and what motion would show an effect better."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.estimates import key
from serpent_twin.machines.case import Case
from serpent_twin.numerals import capital, listed
from serpent_twin.residual import ANGLE, Comparison, Measure

STILL = 0.01
"""Range of an angle [rad] up to which it counts as still: some counts of a servo's encoder"""
_STILL = 1e-9
"""Range below which a quantity that is no angle counts as still, in its unit"""
_RELATED = 0.1
"""Least correlation of where an effect shows with a motion that is suggested"""
_ALL = "move all joints further and faster"
_SLOW = "hold poses for longer, in longer sessions"
_ADVISED = 6
_LENGTHS = ("rad", "m")
"""Effects for which a motion is sought"""


@dataclass(frozen=True)
class InputExcitation:
    """How far one motor or joint moves in the logs."""

    name: str
    range: float
    """Range of its angle [rad], or of the quantity that its measure names"""
    speed: float
    """Root mean square of its rate [rad/s]"""
    measure: Measure = ANGLE
    """What it is"""

    @property
    def still(self) -> bool:
        """Whether it never moves, so that no log of any length would say what its motion shows."""
        return self.range < (STILL if self.measure == ANGLE else _STILL)

    def numbers(self) -> dict[str, Any]:
        """The figures for JSON, units in the keys."""
        unit = key(self.measure.base)
        return {
            "name": self.name,
            "_".join(filter(None, ("range", unit))): self.range,
            "_".join(filter(None, ("speed_rms", unit, "per_s"))): self.speed,
            "moves": not self.still,
        }


def excitation(comparison: Comparison) -> tuple[InputExcitation, ...]:
    """Excitation of every motor, as logged, then of every joint, as simulated."""
    return tuple(
        InputExcitation(name, float(np.nanmax(angle) - np.nanmin(angle)), _rms(speed), of)
        for name, angle, speed, of in _inputs(comparison)
    )


def _inputs(c: Comparison) -> Iterator[tuple[str, Array, Array, Measure]]:
    """Names, angles and velocities of motors and joints, (S, T) each, and what they are."""
    kinds = (
        (c.motor_names, c.motor_angle, c.motor_velocity, c.motors),
        (c.joint_names, c.joint_angle, None, (ANGLE,) * len(c.joint_names)),
    )
    for names, angles, speeds, measures in kinds:
        if angles is None:
            continue
        speeds = np.array(np.gradient(angles, c.period, axis=1)) if speeds is None else speeds
        for k, name in enumerate(names):
            yield name, angles[..., k], speeds[..., k], measures[k]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def advice(case: Case[Any], pieces: Any, without: Comparison, hidden: Mapping[str, Array]) -> str:
    """A sentence on the motion that would show effects that are hidden in these logs; nothing for none.

    `hidden` holds what each effect changes of the residual of these segments, (N,): the motion that this
    follows most, of those in their comparison `without` any, is what there should be more of. An effect whose
    memory outlives a segment shows where poses are held.
    """
    if not hidden:
        return ""
    still = [each.name for each in excitation(without) if each.still]
    wanted: dict[str, list[str]] = {}
    for name, change in list(hidden.items())[:_ADVISED]:
        motion = _SLOW
        if not case.candidates[name].remembers:
            motion = _motion(without, _by_row(pieces, without, change))
        wanted.setdefault(motion, []).append(name.replace("_", " "))
    told = [f"to show {listed(names)}, {motion}" for motion, names in wanted.items()]
    text = "; ".join([f"move {listed(still)}", *told] if still else told)
    return f"{capital(text)}."


def _motion(without: Comparison, change: Array) -> str:
    """The motion that the change of each row, (S, T), follows most, in the imperative; all of them where it
    follows none.
    """
    if not np.isfinite(change).all() or np.ptp(change) < 1e-12:
        return _ALL
    best, most = _ALL, _RELATED
    for motion, feature in _motions(without):
        if np.ptp(feature) > 1e-9:
            related = float(np.corrcoef(feature.ravel(), change.ravel())[0, 1])
            best, most = (motion, related) if related > most else (best, most)
    return best


def _by_row(pieces: Any, without: Comparison, change: Array) -> Array:
    """How much each row of a comparison changes, all channels weighing alike, (S, T). A comparison may have
    segments in blocks of some rows, without those in which nothing is measured.
    """
    rows, measured = without.time.shape[1], pieces.measured
    whole = measured.shape[1] // rows * rows
    values, known = (
        np.reshape(each.reshape(measured.shape)[:, :whole], (-1, rows, measured.shape[2]))
        for each in (change.astype(float), np.isfinite(measured))
    )
    if len(values) > len(without.time):
        values = values[known.any(axis=(1, 2))]
    size = np.maximum((values**2).mean(axis=(0, 1)), 1e-30)
    return np.sqrt((values**2 / size).sum(axis=-1))


def _motions(c: Comparison) -> Iterator[tuple[str, Array]]:
    """What there could be more of, in the imperative, and how much of it is in each row, (S, T)."""
    speeds = []
    for name, angle, speed, _ in _inputs(c):
        speeds.append(np.abs(speed))
        yield f"move {name} faster", speeds[-1]
        yield f"move {name} further", np.abs(angle - np.median(angle))
    if c.load_predicted is not None:
        for name, load in zip(c.load_names, np.moveaxis(c.load_predicted, 2, 0), strict=True):
            more = f"move {name} further" if c.load.base in _LENGTHS else f"put more load on {name}"
            yield more, np.abs(load)
    if speeds:
        yield "hold poses for longer", _held(np.max(speeds, axis=0), c.period)


def _held(speed: Array, period: float) -> Array:
    """How long nothing has moved by more than a tenth of its usual speed [s], (S, T)."""
    rests = speed < 0.1 * max(_rms(speed), 1e-12)
    rows = np.arange(speed.shape[1])
    last = np.maximum.accumulate(np.where(rests, -1, rows), axis=1)
    return period * (rows - last)
