"""Define the columns and metadata of a session log."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.tables.log import Log

SCHEMA_VERSION = 1
FEWEST_HZ, MOST_HZ = 1e-3, 1e5
"""Control steps per second that a log may have: far beyond those of any arm, and finite"""


@dataclass(frozen=True)
class Field:
    """One array of a session: the columns that hold it, its shape in a row, its unit."""

    columns: tuple[str, ...]
    shape: tuple[int, ...]
    unit: str


def _motor(quantity: str, unit: str) -> Field:
    return Field(tuple(f"motor{i}_{quantity}" for i in range(1, N_MOTORS + 1)), (N_MOTORS,), unit)


_JOINTS = range(1, N_JOINTS + 1)
FIELDS: Mapping[str, Field] = {
    "time": Field(("time",), (), "s"),
    "motor_position": _motor("position", "rad"),
    "motor_velocity": _motor("velocity", "rad/s"),
    "motor_load": _motor("load", "1"),
    "motor_velocity_command": _motor("velocity_command", "rad/s"),
    "joint_target": Field(tuple(f"joint{i}_target" for i in _JOINTS), (N_JOINTS,), "rad"),
    "marker": Field(tuple(f"marker{i}_{x}" for i in _JOINTS for x in "xyz"), (N_JOINTS, 3), "m"),
}
COLUMNS: tuple[str, ...] = tuple(name for f in FIELDS.values() for name in f.columns)
UNITS: Mapping[str, str] = {name: f.unit for f in FIELDS.values() for name in f.columns}


class _Column:
    """Read a column of a session as an attribute of its name."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, session: Log, owner: type | None = None) -> Array:
        return session.columns[self.name]


@dataclass(frozen=True, eq=False)
class Session(Log):
    """One session of the arm: a row's command acts between this row and the next.

    Its columns are those of `FIELDS`, of all motors or markers together, and further ones, (T,) each. Its
    metadata are schema_version, backend, arm, session, rate_hz, and whatever the recorder added.
    """

    motor_position = _Column()
    """Measured motor angles, multi-turn [rad], (T, 10)."""
    motor_velocity = _Column()
    """Measured [rad/s], (T, 10)."""
    motor_load = _Column()
    """Fraction of the stall torque, −1 … 1, (T, 10)."""
    motor_velocity_command = _Column()
    """Sent after this reading [rad/s], (T, 10)."""
    joint_target = _Column()
    """The controller's target [rad], (T, 9)."""
    marker = _Column()
    """Markers in the base frame [m], (T, 9, 3); NaN where lost."""

    def __post_init__(self) -> None:
        where, rows = self.path or self.name, np.shape(self.columns.get("time", ()))[:1]
        if "rate_hz" in self.metadata:
            rate_of(self.metadata, str(where))
        for name in {**FIELDS, **self.columns}:
            found = np.shape(self.columns.get(name, ()))
            expected = (*rows, *(FIELDS[name].shape if name in FIELDS else ()))
            if found != expected:
                raise SerpentError(f"{where}: {name} has shape {found}, expected {expected}.")

    @property
    def extra(self) -> dict[str, Array]:
        """Further columns of the file by name, (T,) each."""
        return {name: values for name, values in self.columns.items() if name not in FIELDS}

    @property
    def name(self) -> str:
        """File name without its ending, such as `session_01`, unless a label is given."""
        number = f"session_{self.metadata.get('session', 0):02d}"
        return self.label or (self.path.stem if self.path else number)

    @property
    def rate_hz(self) -> float:
        """Control steps per second."""
        return rate_of(self.metadata, str(self.path or self.name))

    @property
    def readings(self) -> Array:
        """Motor angles, velocities and loads of the rows in which a motor turns, (≤ T, 30); of all rows where
        none does.
        """
        return turning(self.motor_position, self.motor_velocity, self.motor_load)

    @property
    def prior_runtime(self) -> float:
        """How long the arm ran before [s]: from the log, else as if a run's sessions were of one length."""
        if "prior_runtime_s" in self.metadata:
            return float(self.metadata["prior_runtime_s"])
        number = int(self.metadata.get("session", 1))
        return (number - 1) * (float(self.time[-1] - self.time[0]) + 1 / self.rate_hz)


def turning(angle: Array, velocity: Array, load: Array) -> Array:
    """Motor angles, velocities and loads, (T, 10) each, of the rows in which a motor turns, (≤ T, 30); of all
    rows where none does.
    """
    turns = (velocity != 0).any(axis=1)
    return np.concatenate([angle, velocity, load], axis=1)[turns if turns.any() else slice(None)]


def rate_of(metadata: Mapping[str, Any], where: str) -> float:
    """Control steps per second in a log's metadata, or a `SerpentError` that names `where`."""
    rate: Any = metadata.get("rate_hz")
    is_number = isinstance(rate, int | float | np.number) and not isinstance(rate, bool)
    if not is_number or not FEWEST_HZ <= rate <= MOST_HZ:
        told = repr(rate) if isinstance(rate, str) else str(rate)
        told = told if len(told) < 30 else f"{told[:20]} …"
        raise SerpentError(
            f"{where}: rate_hz is {told}, expected a number from {FEWEST_HZ:g} to {MOST_HZ:g}."
        )
    return float(rate)


def session_from_rows(rows: Sequence[Mapping[str, Any]], metadata: dict[str, Any]) -> Session:
    """A session in memory out of rows, each a mapping of the names in `FIELDS` to arrays of one row."""
    return Session(
        None, metadata, {name: np.array([row[name] for row in rows], float) for name in FIELDS}
    )


def session_from_columns(
    path: Path | None, metadata: dict[str, Any], columns: Mapping[str, np.ndarray]
) -> Session:
    """A session out of the flat columns of a file, (T,) each."""
    wide = {
        name: np.stack([columns[c] for c in f.columns], axis=-1).reshape(-1, *f.shape)
        for name, f in FIELDS.items()
    }
    extra = {name: column for name, column in columns.items() if name not in UNITS}
    return Session(path, metadata, wide | extra)


def columns_of(session: Session) -> dict[str, np.ndarray]:
    """The flat columns of a session, (T,) each: the 77 in the file's order, then the extra ones."""
    flat = {name: session.columns[name].reshape(len(session), -1) for name in FIELDS}
    columns = {c: flat[name][:, k] for name, f in FIELDS.items() for k, c in enumerate(f.columns)}
    return columns | session.extra
