"""Load a robot with its logs, and find what its model lacks, from Python and without files.

import serpent_twin as st

robot = st.Machine.load("robot.xml", logs="logs/*.csv")
found = st.trace(robot, minutes=3)
found.twin.save("twin")
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from serpent_twin import machines, matching
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.identification import first_picture, page
from serpent_twin.identification.diagnosis import Diagnosis
from serpent_twin.identification.run import Trace, run
from serpent_twin.identification.summary import summary
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.rig import read_logs
from serpent_twin.numerals import counted
from serpent_twin.residual import Comparison
from serpent_twin.runs.provenance import provenance
from serpent_twin.runs.report import Report, as_html, as_png, write

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class LoggedMachine:
    """A robot: its model, how its logs are read, and the logs."""

    rig: machines.Rig = field(repr=False)
    """Reads logs and opens them"""
    logs: tuple[Path, ...]
    """Files, the oldest first"""
    sessions: tuple[Any, ...] = field(repr=False)
    """The recordings in them"""
    description: str = field(repr=False, default="")
    """The text of machine.toml, where it was made here"""

    @classmethod
    def load(
        cls, robot: str | Path, logs: str | Path | Sequence[str | Path] = ()
    ) -> "LoggedMachine":
        """Load an MJCF, a URDF or a machine.toml, and logs: files, folders or a pattern.

        Without a machine.toml, columns are matched to the model as `serpent-twin init` does it. Raises a
        `SerpentError` where that leaves something open, or a log cannot be read.
        """
        path, found = Path(robot), _files(logs)
        if path.is_dir() and (path / "machine.toml").exists():
            path = path / "machine.toml"
        if path.suffix == ".toml":
            rig = machines.find(machines.named("", path))
            return cls(rig, found, tuple(read_logs(rig, found)))
        matched = matching.describe(path, found)
        if matched.undecided:
            raise SerpentError(
                f"what the columns mean is not clear: {'; '.join(matched.undecided)}. Write a machine.toml "
                f"by `serpent-twin init {robot} …`, edit these lines, and load that."
            )
        rig = _described(matched)
        return cls(rig, found, tuple(read_logs(rig, found)), matched.text)

    def open(self) -> tuple[Case[Any], Any]:
        """The machine with first guesses from all of its logs, and these in segments."""
        case = self.rig.open(list(self.sessions))
        return case, case.pieces(list(self.sessions))


@dataclass(frozen=True)
class Simulated:
    """What was measured beside what a twin predicts, S segments of T rows of M quantities."""

    comparison: Comparison = field(repr=False)
    """All that is measured and predicted, in SI units"""

    @property
    def time(self) -> Array:
        """Time within the session [s], (S, T)."""
        return self.comparison.time

    @property
    def residual(self) -> Mapping[str, Array]:
        """Measured minus predicted of each joint, site or other number, in SI units, (S, T, D) by name."""
        one, found = self.comparison, dict[str, Array]()
        if one.marker_measured is not None and one.marker_predicted is not None:
            left = one.marker_measured - one.marker_predicted
            found = {name: left[:, :, n] for n, name in enumerate(one.marker_names)}
        if one.load_measured is not None and one.load_predicted is not None:
            left = one.load_measured - one.load_predicted
            found |= {name: left[:, :, n, None] for n, name in enumerate(one.load_names)}
        return found

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square of the residual by name, in SI units."""
        return {
            name: float(np.sqrt(np.nanmean((left**2).sum(axis=-1))))
            for name, left in self.residual.items()
        }

    @property
    def figure(self) -> "Figure":
        """The session that differs most: measured, predicted and the difference, the inputs below."""
        return first_picture.first_picture(self.comparison).drawing

    def _repr_png_(self) -> bytes:
        """The figure in a notebook."""
        return as_png(self.figure)


@dataclass(frozen=True)
class CorrectedTwin:
    """The model with what a trace found."""

    case: Case[Any] = field(repr=False)
    point: ParameterVector = field(repr=False)
    about: Mapping[str, Any] = field(repr=False)
    """Where it comes from"""

    def save(self, folder: str | Path) -> Path:
        """Write twin.json and twin.xml into a folder, which is made; returns the path of twin.json."""
        path = Path(folder) / "twin.json"
        if path.exists():
            raise SerpentError(f"{path} exists, and is not overwritten. Name another folder.")
        path.parent.mkdir(parents=True, exist_ok=True)
        self.case.write(self.point, path, self.about)
        return path


@dataclass(frozen=True, eq=False, repr=False)
class TracedMachine(Diagnosis):
    """What a trace found: effects, errors, cautions, and the corrected twin."""

    twin: CorrectedTwin = field(kw_only=True)
    """The model with what was found"""

    def __str__(self) -> str:
        """What was found in one screen."""
        return summary(self, self.twin.case.candidates)

    def report(self, folder: str | Path) -> Path:
        """Write report.html and its figures into a folder; returns the path of the page."""
        return write(self._page(), Path(folder))

    def _page(self) -> Report:
        case = self.twin.case
        priors = {each.name: each.prior for each in case.declared}
        return page.page(self, {}, case.candidates, priors, case.track_record)

    def _repr_html_(self) -> str:
        """The report in a notebook."""
        return as_html(self._page())


def trace(
    robot: LoggedMachine,
    minutes: float = 60.0,
    held_out: int = 1,
    seed: int = 0,
    discover: bool = True,
) -> TracedMachine:
    """Find what a robot's model lacks: calibrate, name effects one by one, judge them on held-out logs.

    After so many minutes no further effect is sought. The last `held_out` logs are not fitted to.
    """
    sessions = list(robot.sessions)
    if len(sessions) <= held_out:
        raise SerpentError(
            f"of {counted(len(sessions), 'log')}, {held_out} cannot be held out: one must be fitted. "
            "Give more logs."
        )
    with tempfile.TemporaryDirectory() as folder:
        config = Trace(robot.logs, Path(folder), seed=seed, discover=discover, minutes=minutes)
        training, judging = sessions[:-held_out], sessions[-held_out:]
        tracer, _, found = run(config, robot.rig, training, judging)
    assert tracer.final is not None
    about = {"arm": found.arm, "provenance": provenance() | {"seed": seed}}
    return TracedMachine(**vars(found), twin=CorrectedTwin(tracer.case, tracer.final, about))


def simulate(robot: LoggedMachine, twin: CorrectedTwin | None = None) -> Simulated:
    """Simulate a robot's logs by its nominal model, or by a twin; each segment starts as it was measured."""
    if twin is None:
        case, pieces = robot.open()
        return Simulated(case.compare(None, pieces))
    return Simulated(twin.case.compare(twin.point, twin.case.pieces(list(robot.sessions))))


def residual(robot: LoggedMachine, twin: CorrectedTwin | None = None) -> dict[str, float]:
    """Root mean square of what a robot's nominal model, or a twin, leaves of its logs, by name [SI]."""
    return simulate(robot, twin).rms


def _files(logs: str | Path | Sequence[str | Path]) -> tuple[Path, ...]:
    """The files and folders that one or several names or patterns give, sorted within each."""
    given = [logs] if isinstance(logs, str | Path) else list(logs)
    found = list[Path]()
    for each in map(str, given):
        path = Path(each)
        several = [path] if path.exists() else sorted(path.parent.glob(path.name))
        if not several:
            raise SerpentError(f"no file is named {each}. Give the logs of the robot.")
        found += several
    if not found:
        raise SerpentError('no logs are given. Name the robot\'s logs: logs="logs/*.csv".')
    return tuple(found)


def _described(matched: matching.Matched) -> machines.Rig:
    """The machine of a description that no file holds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / matched.robot.resolve().parent.name / "machine.toml"
        path.parent.mkdir()
        path.write_text(matched.text, encoding="utf-8")
        model = matched.robot
        if matched.without_meshes:
            model = path.with_name("robot.xml")
            model.write_text(matched.without_meshes, encoding="utf-8")
        return open_machine(path, model.resolve())
