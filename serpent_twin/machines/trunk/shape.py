"""Define the parameters of a trunk, and their first guesses from its logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from msgspec import defstruct
from msgspec.structs import asdict

from serpent_twin.arrays import Array
from serpent_twin.machines.machine import Declared, Quantity, by_coordinate
from serpent_twin.stored import Form, many, take, within
from serpent_twin.tables.log import Log

MOTORS, DISKS = range(1, 7), range(1, 4)
ENDS_AT = (2, 3, 1, 3, 1, 2)
"""Disk at which each motor's two cables end: the limits of 51, 81 and 31° in the trunk's motor node."""
GOALS = tuple(f"motor{m}_command" for m in MOTORS)
ANGLES = tuple(f"motor{m}_position" for m in MOTORS)
TURNED = tuple(f"motor{m}_turned" for m in MOTORS)
"""The same, between the rows that first hold them"""
SEEN = tuple(f"disk{k}_{axis}" for k in DISKS for axis in "xyz")
CHANNEL = 0.025
"""Radius on which cables run [m], assumed: only what is wound per radius shows in logs"""
_HOSE, _PULLED = 0.4, 3e-3  # [N m²], [m] assumed
_SETTLES, _RUBS = 0.03, 0.01  # [s] assumed
_END = 0.3  # assumed
_STILL = 0.05  # share of a log's rows, those with the smallest goals, that are taken as rest
_LATEST = 0.4  # [s] that commands may be late
_MOST = 1e6  # of any number of a trunk, in SI units: beyond it a file is damaged


@dataclass(frozen=True)
class ParameterKind:
    """Numbers of one kind."""

    names: tuple[str, ...]
    unit: str
    """Of the fit's coordinates"""
    scale: float
    """SI per unit; 0 where a coordinate is the logarithm of a ratio"""
    prior: float
    step: float


def _of(text: str, which: Sequence[object]) -> tuple[str, ...]:
    return tuple(text.format(each) for each in which)


_PLACES = _of("marker of disk {}", [f"{k} along {axis}" for k in DISKS for axis in "xyz"])
KINDS: Mapping[str, ParameterKind] = {
    "base": ParameterKind(_of("base along {}", "xyz"), "mm", 1e-3, 10.0, 0.5),
    "tilt": ParameterKind(_of("tilt of the base about {}", "xz"), "°", np.pi / 180, 3.0, 0.2),
    "length": ParameterKind(_of("length of segment {}", DISKS), "mm", 1e-3, 10.0, 0.5),
    "wound": ParameterKind(_of("cable wound per radian, to disk {}", DISKS), "log m", 0.0, 0.1, 0.02),
    "direction": ParameterKind(_of("direction of motor {}'s cables", MOTORS), "°", np.pi / 180, 8.0, 0.5),
    "hose": ParameterKind(("stiffness of the hose",), "log N m²", 0.0, 1.0, 0.05),
    "weight": ParameterKind(("weight of the trunk",), "log kg", 0.0, 1.0, 0.05),
    "pulled": ParameterKind(_of("stretch of motor {}'s cables at rest", MOTORS), "mm", 1e-3, 3.0, 0.2),
    "settles": ParameterKind(("damping of the hose over its stiffness",), "log s", 0.0, 1.0, 0.1),
    "rubs": ParameterKind(("damping of the cables over their stiffness",), "log s", 0.0, 1.0, 0.1),
    "end": ParameterKind(("weight of the end over the hose's",), "log 1", 0.0, 1.0, 0.1),
    "disk": ParameterKind(_PLACES, "mm", 1e-3, 10.0, 0.5),
    "zero": ParameterKind(_of("zero of motor {}", MOTORS), "°", np.pi / 180, 3.0, 0.3),
}  # fmt: skip
_SHOWN = {"log m": ("mm", 1e3), "log s": ("ms", 1e3), "log N m²": ("N m²", 1.0), "log kg": ("kg", 1.0),
          "log 1": ("1", 1.0)}  # fmt: skip
"""Units for people of coordinates that are logarithms, and how many make one of SI"""
Shape = Mapping[str, Array]
"""SI values of every kind. The logs' frame, y up, holds for the base; elsewhere x is down the trunk, y and z
are the logs' x and z."""


def turned(run: Log) -> Log:
    """The servos' angles, interpolated linearly between new readings: the bus is read less often than rows
    are logged.
    """
    angles, time = _columns(run, ANGLES), run.columns["time"]
    new = np.r_[True, (np.diff(angles, axis=0) != 0).any(axis=1)]
    between = [np.interp(time, time[new], angle[new]) for angle in angles.T]
    return replace(run, columns=run.columns | dict(zip(TURNED, between, strict=True)))


def declared(kinds: Sequence[str]) -> tuple[Declared, ...]:
    """Coordinates of the fit, of these kinds."""
    return tuple(
        Declared(name, kind.unit, kind.prior, kind.step)
        for kind in (KINDS[k] for k in kinds)
        for name in kind.names
    )


def quantities(start: Shape, kinds: Sequence[str]) -> tuple[Quantity, ...]:
    """The physical quantities of these kinds' coordinates, from a start."""
    found: list[Quantity] = []
    for name in kinds:
        kind = KINDS[name]
        unit, per_si = _SHOWN.get(kind.unit, (kind.unit, 1 / (kind.scale or 1.0)))
        for each, value in zip(kind.names, start[name], strict=True):
            found.append(Quantity(each, unit, per_si * float(value), per_si * kind.scale, (each,)))
    return tuple(found)


def moved(start: Shape, kinds: Sequence[str], x: Array) -> Shape:
    """A shape at coordinates from a start, of these kinds."""
    found, value = dict(start), by_coordinate(declared(kinds), x)
    for name in kinds:
        kind = KINDS[name]
        by = np.array([value[each] for each in kind.names])
        found[name] = start[name] + kind.scale * by if kind.scale else start[name] * np.exp(by)
    return found


def first_guess(runs: Sequence[Log]) -> Shape:
    """A straight trunk where the disks hang at rest; cables by how far goals move disks."""
    goal = np.concatenate([_columns(r, GOALS) for r in runs])
    seen = np.concatenate([_columns(r, SEEN) for r in runs])
    few = np.argsort(np.abs(goal).sum(axis=1))[: max(1, round(_STILL * len(goal)))]
    rest = np.median(seen[few], axis=0).reshape(3, 3)
    length = (rest[0, 1] - rest[2, 1]) / 2
    jacobian = _slopes(runs)
    across = np.array([jacobian[m, disk - 1][[0, 2]] for m, disk in enumerate(ENDS_AT)])
    # A segment bent by β moves its end by β L / 2; cables wound by w to one side bend it by w / radius.
    wound = 2 * CHANNEL / length * np.linalg.norm(across, axis=1)
    return {
        "base": rest[0] + [0.0, length, 0.0],
        "tilt": np.zeros(2),
        "length": np.full(3, length),
        "wound": np.full(3, wound[np.equal(ENDS_AT, DISKS[-1])].mean()),
        "direction": np.arctan2(across[:, 1], across[:, 0]),
        "hose": np.array([_HOSE]),
        "weight": np.array([1.0]),
        "pulled": np.full(6, _PULLED),
        "settles": np.array([_SETTLES]),
        "rubs": np.array([_RUBS]),
        "end": np.array([_END]),
        "disk": np.zeros(9),
        "zero": np.zeros(6),
    }


def _values(kind: ParameterKind) -> Any:
    """How values of a kind are stored: those that are scaled by a factor are positive."""
    low = -_MOST if kind.scale else 1 / _MOST
    return Annotated[tuple[Annotated[float, within(low, _MOST)], ...], many(len(kind.names))]


_STORED = defstruct("First", [(n, _values(k)) for n, k in KINDS.items()], bases=(Form,))


def restored(values: Mapping[str, Any], where: str) -> Shape:
    """A shape out of a twin.json; raises a `SerpentError` that begins with `where`."""
    return {n: np.array(v) for n, v in asdict(take(dict(values), _STORED, where)).items()}


def _columns(run: Log, names: Sequence[str]) -> Array:
    return np.stack([run.columns[name] for name in names], axis=1)


def _slopes(runs: Sequence[Log]) -> Array:
    """How far a goal moves each disk, [m/rad], (6, 3, 3): least squares at the delay that fits best."""
    period = float(np.median(np.diff(runs[0].columns["time"])))
    found = []
    for late in range(0, round(_LATEST / period) + 1):
        pairs = [(_columns(r, GOALS)[: len(r) - late], _columns(r, SEEN)[late:]) for r in runs]
        goal, seen = (np.concatenate(each) for each in zip(*pairs, strict=True))
        x = np.c_[goal, np.ones(len(goal))]
        jacobian, *_ = np.linalg.lstsq(x, seen, rcond=None)
        found.append((((seen - x @ jacobian) ** 2).mean(), jacobian[:6]))
    return min(found, key=lambda each: each[0])[1].reshape(6, 3, 3)
