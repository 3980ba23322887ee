"""Compare a machine's runs with its twin."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import mujoco
import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import (
    Candidate,
    Declared,
    ParameterVector,
    Quantity,
    Stopwatch,
    effects_at,
)
from serpent_twin.machines.measured import twin_file
from serpent_twin.machines.measured.recording import Recording
from serpent_twin.machines.measured.runs import Runs, cut, windows
from serpent_twin.residual import Comparison, Measure
from serpent_twin.runs.files import write_whole

_AT_ONCE = 4.0e6  # numbers that one call keeps in memory


@dataclass(frozen=True)
class Output:
    """A quantity that is measured and that the twin predicts."""

    column: str
    """Of the logs"""
    measure: Measure
    """How its error is told"""
    noise: float
    """Least standard deviation by which its error is weighed, in the column's unit"""


class Machine(Protocol):
    """What a rig with runs provides."""

    @property
    def name(self) -> str:
        """The rig's."""
        ...

    @property
    def first(self) -> Mapping[str, Any]:
        """First guesses from the logs; `declared` counts from them."""
        ...

    @property
    def drives(self) -> Mapping[str, str]:
        """Display name of each angle that drives the machine, by its column."""
        ...

    @property
    def markers(self) -> tuple[str, ...]:
        """Display names of the measured parts of the pose."""
        ...

    @property
    def joints(self) -> tuple[str, ...]:
        """Display names of the hinges whose angles are the first outputs; empty where none is measured."""
        ...

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that a simulation reads, the drives' among them."""
        ...

    @property
    def outputs(self) -> tuple[Output, ...]:
        """All coordinates of each marker, then perhaps others of one measure: torques, motors' angles."""
        ...

    @property
    def declared(self) -> tuple[Declared, ...]:
        """What calibration fits."""
        ...

    @property
    def quantities(self) -> Sequence[Quantity]:
        """What each of them stands for."""
        ...

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """What the machine may have."""
        ...

    @property
    def every(self) -> int:
        """Of so many rows, one is used."""
        ...

    @property
    def block(self) -> float:
        """Seconds that are judged as one: longer than the correlation time of errors."""
        ...

    @property
    def window(self) -> tuple[float, float] | None:
        """Seconds into which a run is cut, and those simulated before each; None for whole runs."""
        ...

    @property
    def segments(self) -> tuple[int, int]:
        """How many runs a fit uses at most while it searches, and the last fit."""
        ...

    def spec(self, declared: Array, effects: Sequence[Effect]) -> mujoco.MjSpec:
        """The twin as MJCF."""
        ...

    def respond(self, points: Sequence[ParameterVector], runs: Runs) -> Array:
        """The outputs that twins predict, (D, S, T, C); not finite where a simulation gave up."""
        ...


@dataclass(frozen=True)
class RunCase:
    """Runs of one machine."""

    machine: Machine
    noise: Array
    """Weighs each output, in its column's unit, (C,)"""
    unseen: Mapping[str, str] = field(default_factory=dict)
    clock: Stopwatch = field(default_factory=Stopwatch)

    @property
    def declared(self) -> Sequence[Declared]:
        """The coordinates of the fit."""
        return self.machine.declared

    @property
    def quantities(self) -> Sequence[Quantity]:
        """What each of them stands for."""
        return self.machine.quantities

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """What the machine may have."""
        return self.machine.candidates

    @property
    def segments(self) -> tuple[int, int]:
        """How many runs a fit uses while it searches, and the last."""
        return self.machine.segments

    @property
    def channels(self) -> int:
        """Numbers that a residual has for each row."""
        return len(self.machine.outputs)

    def pieces(self, sessions: Sequence[Recording]) -> Runs:
        """The runs, whole or in windows."""
        of, outputs = self.machine, [each.column for each in self.machine.outputs]
        if of.window:
            needed = sum(of.window)
            whole = [part for run in sessions for part in windows(run, *of.window, outputs)]
            if not whole:
                raise SerpentError(
                    f"{', '.join(run.name for run in sessions)}: shorter than {needed:g} s, which one "
                    "window takes. Give longer runs."
                )
            sessions = whole
        return cut(sessions, of.columns, outputs, of.every)

    def take(self, pieces: Runs, which: Sequence[int]) -> Runs:
        """Some of the runs."""
        return pieces.take(which)

    def residual(
        self, points: Sequence[ParameterVector], pieces: Runs, rough: bool = False
    ) -> Array:
        """Measured minus predicted over noise, (points, S, T · C)."""
        at_once = max(1, int(_AT_ONCE / pieces.measured.size))
        groups: dict[tuple[str, ...], list[int]] = {}
        for n, point in enumerate(points):
            groups.setdefault(tuple(point.effects), []).append(n)
        out = np.empty((len(points), len(pieces), pieces.measured[0].size), np.float32)
        for group in groups.values():
            for n in range(0, len(group), at_once):
                some = group[n : n + at_once]
                predicted = self._respond([points[k] for k in some], pieces)
                out[some] = self._weigh(predicted, pieces)
        return out

    def _respond(self, points: Sequence[ParameterVector], pieces: Runs) -> Array:
        with self.clock:
            return self.machine.respond(points, pieces)

    def _weigh(self, predicted: Array, pieces: Runs) -> Array:
        known = np.isfinite(pieces.measured)
        error = np.where(known, (pieces.measured - predicted) / self.noise, 0.0)
        error[~np.isfinite(predicted).all(axis=(1, 2, 3))] = np.nan
        return error.reshape(*error.shape[:2], -1).astype(np.float32)

    def jacobian(self, point: ParameterVector, pieces: Runs) -> Array:
        """NaN: finite differences tell all of them."""
        return np.full((len(self.declared), len(pieces), pieces.measured[0].size), np.nan)

    def reweighted(self, point: ParameterVector, pieces: Runs) -> "RunCase":
        """Weigh every output by the rms that this twin leaves of it."""
        error = pieces.measured - self._respond([point], pieces)[0]
        left = np.sqrt(np.nanmean(error**2, axis=(0, 1)))
        least = [each.noise for each in self.machine.outputs]
        return replace(self, noise=np.maximum(left, least))

    def compare(self, point: ParameterVector | None, pieces: Runs) -> Comparison:
        """Measured beside predicted, in blocks that are judged one by one."""
        at = point or ParameterVector(np.zeros(len(self.declared)))
        predicted = self._respond([at], pieces)[0]
        rows = max(8, round(self.machine.block / float(np.median(pieces.period))))
        n = max(1, pieces.time.shape[1] // rows)
        rows = min(rows, pieces.time.shape[1])

        def blocks(values: Array) -> Array:
            return values[:, : n * rows].reshape(len(values) * n, rows, *values.shape[2:])

        known = np.isfinite(blocks(pieces.measured)).any(axis=(1, 2))
        of = self.machine
        drive = np.stack([pieces.column[column] for column in of.drives], axis=-1)
        speed = np.gradient(drive, axis=1) / pieces.period[:, None, None]
        markers = len(of.markers) * of.outputs[0].measure.dimension
        measured, other = (blocks(v)[known] for v in (pieces.measured, predicted))
        shape = (*measured.shape[:2], len(of.markers), -1)
        loads = {
            "load_measured": measured[..., markers:],
            "load_predicted": other[..., markers:],
            "load": of.outputs[-1].measure,
            "load_counts": np.ones((*measured.shape[:2], len(of.outputs) - markers), bool),
        } if len(of.outputs) > markers else {}  # fmt: skip
        return Comparison(
            session=tuple(np.repeat(np.array(pieces.session), n)[known].tolist()),
            time=blocks(pieces.time)[known],
            marker_measured=measured[..., :markers].reshape(shape),
            marker_predicted=other[..., :markers].reshape(shape),
            marker=of.outputs[0].measure,
            motor_angle=blocks(drive)[known],
            motor_velocity=blocks(speed)[known],
            joint_angle=other[..., : len(of.joints)] if of.joints else None,
            marker_names=of.markers,
            motor_names=tuple(of.drives.values()),
            joint_names=of.joints,
            **loads,
        )

    def expected(
        self,
        fit: ParameterVector,
        drawn: Sequence[ParameterVector],
        pieces: Runs,
        rng: np.random.Generator,
    ) -> float:
        """Mean error of twins drawn from the fit's covariance."""
        of = self.machine
        size = of.outputs[0].measure.dimension
        seen = slice(0, len(of.markers) * size)
        truth = self._respond([fit], pieces)[0, ..., seen]
        known = np.isfinite(pieces.measured[..., seen])
        noise = np.array([each.noise for each in of.outputs[seen]]) * rng.standard_normal(
            truth.shape
        )
        error = self._respond(drawn, pieces)[..., seen] + noise - truth
        error = np.where(known, error, np.nan).reshape(*error.shape[:-1], len(of.markers), size)
        return of.outputs[0].measure.scale * float(np.nanmean(np.linalg.norm(error, axis=-1)))

    def write(self, point: ParameterVector, path: Path, about: Mapping[str, Any]) -> None:
        """Write the twin's parameters as PATH, and what MJCF can express of it as PATH.xml."""
        there = effects_at(point)
        spec = self.machine.spec(point.declared, there)
        spec.compile()
        declared = {
            each.name: (float(value), each.unit)
            for each, value in zip(self.declared, point.declared, strict=True)
        }
        told = twin_file.to_dict(self.machine.name, self.machine.first, declared, there)
        write_whole(path, json.dumps(told | dict(about), indent=1) + "\n")
        python = [effects.name_of(effect) for effect in there if effect.acts()]
        note = f"MJCF cannot express {', '.join(python)}" if python else "all effects are here"
        write_whole(path.with_suffix(".xml"), f"<!-- {note}. -->\n{spec.to_xml()}")
