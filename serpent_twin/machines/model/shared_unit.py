"""Refuse commands and readings that agree with each other, but were both stated in another unit."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import DriveColumn, MeasuredColumns
from serpent_twin.machines.model.starts import angle_of, rate_of, reading_of
from serpent_twin.machines.model.things import acts_on, joint_type
from serpent_twin.numerals import listed
from serpent_twin.tables.segments import Segments
from serpent_twin.units import TO_SI

_OTHERS = {"hinge": ("rad", "deg"), "slide": ("m", "cm", "mm")}
"""Units that people take for each other"""
_TURNS, _EXTENTS = 4 * np.pi, 3.0
"""How far a hinge without a range is believed to turn under a servo [rad]; how far a slide without a range to
move, in sizes of the model
"""
_OFF, _FITS = 0.1, 0.4
"""Share of a motion's rms that a model leaves from which its units are doubted; that another unit leaves at
most, as a correlation of 0.9 does
"""
_BETTER, _AS_WELL = 3.0, 1.5
"""How many times less another unit leaves; how much more it may leave where the motion is not believed"""


@dataclass(frozen=True)
class _Shared:
    """The joints whose servos and encoders were stated in one unit."""

    unit: str
    kind: str
    """Hinge or slide"""
    drives: tuple[DriveColumn, ...]
    measured: tuple[MeasuredColumns, ...]

    @property
    def others(self) -> list[tuple[str, float]]:
        """Other units, and how many times as large they make a motion."""
        size = TO_SI[self.unit][0]
        return [(u, TO_SI[u][0] / size) for u in _OTHERS[self.kind] if TO_SI[u][0] != size]


def require_shared_unit(
    machine: Described, pieces: Segments, found: Array, shown: Callable[[Segments], Array]
) -> None:
    """Refuse logs whose servos' commands and encoders, both in another unit, are a motion that the model
    follows much better, or that is believable where theirs is not. `found` is what the model shows of the
    pieces, (S, T, C), and `shown` finds it for other ones.

    A servo follows its command in any unit. Gravity, limits of force and ranges of joints are what does not
    scale with the motion.
    """
    for shared in _shared(machine):
        off, believed = _left(machine, shared, pieces, found), _believed(machine, shared, pieces)
        if believed and off < _OFF:
            continue
        for unit, times in shared.others:
            other = _rescaled(machine, shared, pieces, times)
            if not _believed(machine, shared, other):
                continue
            left = _left(machine, shared, other, shown(other))
            better = left < off / _BETTER or (not believed and left < _AS_WELL * off)
            if better and left < _FITS:
                raise SerpentError(_said(machine, shared, pieces, unit, (off, left), believed))


def _shared(machine: Described) -> Iterator[_Shared]:
    """What was stated in each unit."""
    measured = {each.angle_of: each for each in machine.about.measured if each.angle_of}
    servos = [each for each in machine.commanded if machine.is_servo(each.actuator)]
    moved = {each.column: acts_on(machine.model, each.actuator) for each in servos}
    units = dict.fromkeys((joint_type(machine.model, j), e.unit) for j, e in measured.items())
    for kind, unit in (each for each in units if each[0] in _OTHERS):
        of = {
            joint
            for joint, each in measured.items()
            if each.unit == unit and joint_type(machine.model, joint) == kind
        }
        drives = tuple(d for d in servos if d.unit == unit and moved[d.column][1] in of)
        if drives:
            yield _Shared(unit, kind, drives, tuple(measured[joint] for joint in sorted(of)))


def _rescaled(machine: Described, shared: _Shared, pieces: Segments, times: float) -> Segments:
    """The pieces, had the columns been in a unit so many times as large."""
    column, measured = dict(pieces.column), pieces.measured.copy()
    for drive in shared.drives:
        zero = machine.offset(drive)
        column[drive.column] = zero + times * (column[drive.column] - zero)
    for each in shared.measured:
        at = _channel(machine, each)
        measured[..., at] = each.offset + times * (measured[..., at] - each.offset)
        if angle_of(each.joint) in column:
            for name in (angle_of(each.joint), reading_of(each.joint)):
                column[name] = each.offset + times * (column[name] - each.offset)
            column[rate_of(each.joint)] = times * column[rate_of(each.joint)]
    return replace(pieces, column=column, measured=measured)


def _channel(machine: Described, of: MeasuredColumns) -> int:
    """Where the one column of a joint is among the outputs."""
    names = [name for each in machine.about.measured for name in each.columns]
    return names.index(of.columns[0])


def _left(machine: Described, shared: _Shared, pieces: Segments, found: Array) -> float:
    """Share of the motion's rms that a model leaves which shows (S, T, C); infinite where it is unstable. A
    zero of the readings scales with them, and is the same share in all units.
    """
    shares = []
    for at in (_channel(machine, each) for each in shared.measured):
        measured, off = pieces.measured[..., at], pieces.measured[..., at] - found[..., at]
        known = np.isfinite(measured)
        spread = float(np.std(measured[known])) if known.any() else 0.0
        if spread > 0:
            shares.append(float(np.sqrt(np.mean(off[known] ** 2))) / spread)
    left = float(np.sqrt(np.mean(np.square(shares)))) if shares else 0.0
    return left if np.isfinite(left) else np.inf


def _believed(machine: Described, shared: _Shared, pieces: Segments) -> bool:
    """Whether joints may move so far: within their ranges, or where they have none, some turns or sizes of
    the model.
    """
    for each in shared.measured:
        joint, values = (
            machine.model.joint(each.joint),
            pieces.measured[..., _channel(machine, each)],
        )
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        if joint.limited[0]:
            first, last = joint.range
            middle, half = (first + last) / 2, (last - first) / 2
            if max(abs(low - middle), abs(high - middle)) > 1.5 * half:
                return False
        elif high - low > _most(machine, shared.kind):
            return False
    return True


def _most(machine: Described, kind: str) -> float:
    """How far a joint without a range is believed to move [rad or m]."""
    return _TURNS if kind == "hinge" else _EXTENTS * float(machine.model.stat.extent)


def _said(
    machine: Described,
    shared: _Shared,
    pieces: Segments,
    unit: str,
    left: tuple[float, float],
    believed: bool,
) -> str:
    """What is wrong, and what to do."""
    columns = [e.column for e in shared.drives] + [e.columns[0] for e in shared.measured]
    named = listed([repr(name) for name in columns[:6]])
    if believed:
        now, then = (f"{100 * min(each, 9.99):.2g} %" for each in left)
        return (
            f"{machine.path}: the model would follow {named} much better if all of them were in {unit}, not "
            f"{shared.unit}: it leaves {now} of the motion, and {then} then. State the units in machine.toml."
        )
    spans = {
        e.joint: float(np.ptp(v[np.isfinite(v)]))
        for e in shared.measured
        for v in (pieces.measured[..., _channel(machine, e)],)
    }
    joint, span = max(spans.items(), key=lambda each: each[1])
    far = f"{span:.3g} {'rad' if shared.kind == 'hinge' else 'm'}"
    return (
        f"{machine.path}: {named} in {shared.unit} move the joint {joint} by {far}, and the model follows "
        f"them as well in {unit}. State the unit in machine.toml; or give the joint a range in the model, if "
        "it does move so far."
    )
