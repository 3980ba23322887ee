"""Make a machine whose logs are runs of columns traceable."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.engine.exact_xml import to_xml
from serpent_twin.errors import SerpentError
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import Declared, Output, ParameterVector, Quantity, effects_at
from serpent_twin.machines.measured import twin_file
from serpent_twin.residual import Comparison, Measure
from serpent_twin.runs.files import write_json, write_whole
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments, Stretch, cut


class RunMachine(ABC):
    """You provide columns, outputs, `spec` and `respond`; this cuts runs, compares and writes."""

    name: str
    """The rig's"""
    drives: Mapping[str, str]
    """Display name of each angle that drives the machine, by its column"""
    motors: tuple[Measure, ...] = ()
    """What the drives' columns are, if not all are angles"""
    markers: tuple[str, ...]
    """Display names of the measured parts of the pose"""
    others: tuple[str, ...] = ()
    """Display names of what the further outputs are of, where these are not the drives"""
    joints: tuple[str, ...]
    """Display names of the hinges whose angles are the first outputs; empty where none is measured"""
    columns: tuple[str, ...]
    """Columns that a simulation reads, the drives' among them"""
    outputs: tuple[Output, ...]
    """All coordinates of each marker, then perhaps others of one measure: torques, motors' angles"""
    every: int
    """One row is used of this many"""
    block: float
    """Seconds of a block that is judged as one sample: longer than the correlation time of errors"""
    window: tuple[float, float] | None
    """Seconds into which a run is cut, and those simulated before each; None for whole runs"""
    segments: tuple[int, int]
    """How many runs a fit uses at most while it searches, and the last fit"""
    attachable: bool = False
    """Whether `serpent_twin.attach` lets the effects of its twins act in other programs"""
    weak_rounds: int = 8
    """At most so many rounds along weak directions end the last fit"""
    steps_of_derivative: int = 2
    """Few: a derivative is one more simulation for each free parameter"""

    @property
    @abstractmethod
    def first(self) -> Mapping[str, Any]:
        """First guesses from the logs; the coordinates `declared` are relative to them."""

    @property
    @abstractmethod
    def declared(self) -> tuple[Declared, ...]:
        """What calibration fits."""

    @property
    @abstractmethod
    def quantities(self) -> tuple[Quantity, ...]:
        """The physical quantity of each coordinate."""

    @property
    @abstractmethod
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the machine may have."""

    @abstractmethod
    def spec(self, declared: Array, effects: Sequence[Effect]) -> mujoco.MjSpec:
        """The twin as MJCF."""

    @abstractmethod
    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """The outputs that twins predict, (D, S, T, C); not finite where a simulation gave up."""

    def write_calibration(self, spec: mujoco.MjSpec, declared: Array) -> list[str]:
        """Write into a spec to be given away what calibration found beside the model's numbers; names of
        what MJCF cannot express.
        """
        return []

    def pieces(self, sessions: Sequence[Log]) -> Segments:
        """The runs, whole or in windows."""
        outputs = [each.name for each in self.outputs]
        if not self.window:
            return cut([Stretch.whole(run) for run in sessions], self.columns, outputs, self.every)
        parts = [part for run in sessions for part in _windows(run, *self.window)]
        if not parts:
            raise SerpentError(
                f"{', '.join(run.name for run in sessions)}: shorter than {sum(self.window):g} s, which one "
                "window takes. Give longer runs."
            )
        return cut(parts, self.columns, outputs, self.every)

    def alike(self, points: Sequence[ParameterVector]) -> list[list[int]]:
        """Those with the same effects."""
        groups: dict[tuple[str, ...], list[int]] = {}
        for n, point in enumerate(points):
            groups.setdefault(tuple(point.effects), []).append(n)
        return list(groups.values())

    def coarse_step(self, points: Sequence[ParameterVector]) -> None:
        """None: a run is simulated row by row."""
        return

    def derivatives(
        self, point: ParameterVector, pieces: Segments, noise: Array
    ) -> dict[str, Array]:
        """None: finite differences give all of them."""
        return {}

    @property
    def error_before_change(self) -> float:
        """Unknown."""
        return 0.0

    def pose_noise(self, pieces: Segments) -> Array:
        """The least noise of each coordinate."""
        pose = len(self.markers) * self.outputs[0].measure.dimension
        return np.array([each.noise for each in self.outputs[:pose]])

    def measured_again(
        self, pieces: Segments, point: ParameterVector, rng: np.random.Generator
    ) -> Segments:
        """The same segments: runs start from what drives them, or from an encoder."""
        return pieces

    def block_rows(self, pieces: Segments) -> int:
        """Rows of a block of which the error hardly follows that of the block before."""
        return max(8, round(self.block / float(np.median(pieces.period))))

    def compare(self, point: ParameterVector | None, pieces: Segments) -> Comparison:
        """Measured beside predicted, in blocks that are judged one by one."""
        at = point or ParameterVector.nominal(self.declared)
        predicted = self.respond([at], pieces)[0]
        rows = min(self.block_rows(pieces), pieces.time.shape[1])
        n = pieces.time.shape[1] // rows

        def blocks(values: Array) -> Array:
            return values[:, : n * rows].reshape(len(values) * n, rows, *values.shape[2:])

        known = np.isfinite(blocks(pieces.measured)).any(axis=(1, 2))
        drive = np.stack([pieces.column[column] for column in self.drives], axis=-1)
        speed = np.gradient(drive, axis=1) / pieces.period[:, None, None]
        markers = len(self.markers) * self.outputs[0].measure.dimension
        measured, other = (blocks(v)[known] for v in (pieces.measured, predicted))
        shape = (*measured.shape[:2], len(self.markers), -1)
        loads = {
            "load_measured": measured[..., markers:],
            "load_predicted": other[..., markers:],
            "load": self.outputs[-1].measure,
            "load_names": self.others,
            "load_counts": np.ones((*measured.shape[:2], len(self.outputs) - markers), bool),
        } if len(self.outputs) > markers else {}  # fmt: skip
        return Comparison(
            session=tuple(np.repeat(np.array(pieces.session), n)[known].tolist()),
            time=blocks(pieces.time)[known],
            marker_measured=measured[..., :markers].reshape(shape),
            marker_predicted=other[..., :markers].reshape(shape),
            marker=self.outputs[0].measure,
            motor_angle=blocks(drive)[known],
            motor_velocity=blocks(speed)[known],
            joint_angle=other[..., : len(self.joints)] if self.joints else None,
            marker_names=self.markers,
            motor_names=tuple(self.drives.values()),
            motors=self.motors,
            joint_names=self.joints,
            **loads,
        )

    def write(
        self, point: ParameterVector, noise: Array, path: Path, about: Mapping[str, Any]
    ) -> None:
        """Write the twin's parameters as PATH, and what MJCF can express of it as PATH.xml."""
        there = effects_at(point)
        spec = self.spec(point.declared, there)
        spec.compile()
        declared = {
            each.name: (float(value), each.unit)
            for each, value in zip(self.declared, point.declared, strict=True)
        }
        told = twin_file.to_dict(self.name, self.first, declared, there)
        write_json(path, told | dict(about))
        left = [effects.name_of(e) for e in there if not e.absent and not e.export(spec)]
        more = self.write_calibration(spec, point.declared)
        notes = [f"only twin.json has {', '.join(each)}" for each in (left, more) if each]
        if left and self.attachable:
            notes[0] += f"; serpent_twin.attach adds {'it' if len(left) == 1 else 'them'}"
        note = ". ".join(notes)
        text = f"<!-- {note or 'all effects are here'}. -->\n{to_xml(spec, path.parent)}"
        write_whole(path.with_suffix(".xml"), text)


def _windows(run: Log, seconds: float, before: float) -> list[Stretch]:
    """A run cut into windows, each with the seconds before it, in which nothing counts as measured.

    The first `before` seconds of the run, and a rest that is shorter than a window, are in none.
    """
    lead, length = round(before / run.period), round(seconds / run.period)
    starts = range(lead, len(run) - length + 1, length)
    return [Stretch(run, at - lead, at + length, (at, at + length)) for at in starts]
