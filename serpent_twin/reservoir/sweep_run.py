"""Run a sweep from its options, and write its results."""

import itertools
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from tqdm import tqdm

from serpent_twin import stored
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import ABSENT, Checked, RateHz, Seed, Use, Workers, when
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.reservoir.grid_point import GridPoint, Measuring, key
from serpent_twin.reservoir.outcome import Outcome, measured
from serpent_twin.reservoir.sweep_page import facts, page
from serpent_twin.reservoir.sweep_rows import row_of
from serpent_twin.runs.cluster import cluster
from serpent_twin.runs.files import write_json, write_whole
from serpent_twin.runs.processes import processes
from serpent_twin.runs.provenance import provenance, versions
from serpent_twin.runs.report import write
from serpent_twin.runs.run_lock import claimed
from serpent_twin.runs.worker_pool import Pool, execute
from serpent_twin.stored import same_in_json, within

SETTINGS = "sweep.json"
_AGAIN = "Delete it, and the same command measures it again."
_GRID, _WHERE = Group("grid"), Group("computing")


def _bodiless(config: "Sweep") -> str:
    if config.measuring.body:
        return ""
    return "is for what the body remembers, and --no-body leaves that out: leave out one of them."


def _timeless(config: "Sweep") -> str:
    return "" if config.measuring.session_rate is None else _bodiless(config)


@dataclass(frozen=True)
class Sweep(Checked):
    """Measure how memory, computation and pose error change with an arm's cables and its commands.

    Each point of the grid becomes OUT/points/HASH.json, where it came from and how long it took
    OUT/provenance/HASH.json, and the asked grid OUT/table.json, report.html, report.md and figures. A
    second run measures only what is missing; other grids may share the folder. The damping constant is
    given, not the damping ratio.
    """

    out: Path
    """Folder for results; made if it does not exist."""
    stiffness: Annotated[tuple[Annotated[float, within(1.0, 1e9, "N/m")], ...], _GRID] = (
        NOMINAL.strand_stiffness,
    )
    """Stiffness of each strand [N/m]."""
    slack: Annotated[tuple[Annotated[float, within(0.0, 0.2, "m")], ...], _GRID] = (
        NOMINAL.strand_slack,
    )
    """Slack of each strand [m]."""
    damping: Annotated[tuple[Annotated[float, within(0.0, 10.0, "N m s/rad")], ...], _GRID] = (
        NOMINAL.joint_damping,
    )
    """Viscous damping of each hinge [N m s/rad]."""
    rate: Annotated[tuple[RateHz, ...], _GRID, Use(_timeless)] = (4.0,)
    """Commands per second [Hz]."""
    amplitude: Annotated[
        tuple[Annotated[float, within(1e-6, 4.0, "rad")], ...], _GRID, Use(_bodiless)
    ] = (0.07,)
    """Joint targets lie within ± this [rad]; the servos' speed limits it, at 4 Hz to 0.0706."""
    load_noise: Annotated[tuple[Annotated[float, within(0.0, 1.0)], ...], _GRID] = (
        NOMINAL.load_noise,
    )
    """Noise of load readings, standard deviation as a share of the stall torque."""
    seeds: Annotated[tuple[Seed, ...], _GRID] = (0,)
    """Seeds of inputs and noise; points of one seed have the same inputs."""
    steps: Annotated[int, within(1, 1_000_000), Use(_bodiless)] = 20_000
    """Commands that each point is measured over; a capacity needs about 20,000."""
    rigid: Annotated[bool, _GRID, Use(_bodiless)] = False
    """Also measure an arm on rigid cables, for each rate, amplitude and seed, as a control."""
    workers: Annotated[Workers, _WHERE, when(cluster=ABSENT)] = 0
    """Processes side by side; 0 for one a core. The points do not depend on it."""
    cluster: Annotated[str, _WHERE] = ""
    """Address of a Dask scheduler, tcp://HOST:PORT, whose workers measure instead."""
    measuring: Measuring = field(default_factory=Measuring)
    """How points are measured; the same for all points of a folder."""


def sweep(config: Sweep, points: Sequence[GridPoint] | None = None) -> dict[str, Any]:
    """Measure what is missing of a grid, or of other points; returns what table.json holds."""
    points = grid(config) if points is None else points
    _check(config, points)
    with claimed(config.out, SETTINGS, settings(config)):
        for folder in ("points", "provenance"):
            (config.out / folder).mkdir(exist_ok=True)
        missing = [point for point in points if not _path(config, point).exists()]
        given_up = _measure(config, missing, len(points)) if missing else []
        table = _gather(config, points)
    if given_up:
        names = ", ".join(key(point, config.measuring) for point in given_up)
        raise SerpentError(
            f"{len(given_up)} of {counted(len(points), 'point')} were given up, because every "
            f"worker that tried them "
            f"died, perhaps for want of memory: {names}. The same command tries them again."
        )
    return table


def grid(config: Sweep) -> list[GridPoint]:
    """All points of a grid, each once."""
    arms: list[tuple[float | None, float, float]] = [
        *itertools.product(config.stiffness, config.slack, config.damping)
    ]
    if config.rigid:
        arms.append((None, 0.0, 0.0))
    points = [
        GridPoint(*arm, rate, amplitude, seed, config.steps, noise)
        for arm, noise, rate, amplitude, seed in itertools.product(
            arms, config.load_noise, config.rate, config.amplitude, config.seeds
        )
    ]
    return list(dict.fromkeys(points))


def settings(config: Sweep) -> dict[str, Any]:
    """What all points of a folder share."""
    return {"measuring": asdict(config.measuring), "versions": versions()}


def _check(config: Sweep, points: Sequence[GridPoint]) -> None:
    if not points:
        raise SerpentError("The grid has no points: give at least one value of each kind.")
    config.measuring.check(config.steps)
    for point in points:
        point.check()


def _path(config: Sweep, point: GridPoint, folder: str = "points") -> Path:
    return config.out / folder / f"{key(point, config.measuring)}.json"


def _measure(config: Sweep, missing: Sequence[GridPoint], asked: int) -> list[GridPoint]:
    """Measure points, keeping each as soon as it is there; returns those that were given up."""
    with _pool(config, len(missing)) as pool, _bar(asked, asked - len(missing)) as bar:

        def keep(point: GridPoint, outcome: Outcome) -> None:
            _keep(config, point, outcome)
            bar.update()

        work = partial(measured, measuring=config.measuring)
        watched = sys.stderr.isatty()
        return execute(missing, work, pool, keep, bar.refresh if watched else lambda: None)


def _pool(config: Sweep, jobs: int) -> AbstractContextManager[Pool]:
    if config.cluster:
        return cluster(config.cluster)
    return processes(min(config.workers or os.cpu_count() or 1, jobs))


def _bar(total: int, done: int) -> tqdm:
    return tqdm(total=total, initial=done, unit="point", smoothing=0.1)


def _keep(config: Sweep, point: GridPoint, outcome: Outcome) -> None:
    """Write a point's files, its own last, as that marks it done."""
    own = versions()
    if outcome.versions != own:
        raise SerpentError(
            f"A worker on {outcome.host} computes with {outcome.versions}, this machine with {own}; the "
            "points of a table must be of one kind: install the same versions there."
        )
    about = {name: value for name, value in asdict(outcome).items() if name != "text"}
    write_json(_path(config, point, "provenance"), about)
    write_whole(_path(config, point), outcome.text)


def _gather(config: Sweep, points: Sequence[GridPoint]) -> dict[str, Any]:
    """Write table.json of the requested points that are measured; returns what it holds."""
    paths = [path for path in (_path(config, point) for point in points) if path.exists()]
    table = {
        "points": [{"file": path.name} | _read(path) for path in paths],
        "provenance": settings(config) | provenance(),
    }
    write_json(config.out / "table.json", table, ensure_ascii=False)
    return same_in_json(table)


class _PointFile(stored.Form, frozen=True):
    """What the file of a point holds; what could not be measured is null, and `failed` states why."""

    point: dict[str, Any]
    arm: dict[str, Any]
    measuring: dict[str, Any]
    failed: dict[str, str]
    body: dict[str, Any] | None
    pose: dict[str, Any] | None


def _read(path: Path) -> dict[str, Any]:
    found = stored.read_json(path, advice=_AGAIN)
    stored.take(found, _PointFile, str(path), _AGAIN)
    return found


def report(config: Sweep, table: Mapping[str, Any]) -> Path:
    """Write the report of a grid that was measured; returns its path."""
    measuring = config.measuring
    of = {_path(config, point).name: point for point in grid(config)}
    rows = [row_of(of[each["file"]], each, measuring) for each in table["points"]]
    return write(page(config.out.resolve().name, rows, facts(table)), config.out)
