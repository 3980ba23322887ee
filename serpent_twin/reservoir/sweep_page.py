"""Report a sweep: its points with units, what bodies compute and remember, how well poses are estimated."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from serpent_twin.numerals import counted
from serpent_twin.reservoir import sweep_figures as figures
from serpent_twin.reservoir.sweep_figures import AXES, RIGID
from serpent_twin.reservoir.sweep_rows import SweepRow, error_of, readouts
from serpent_twin.runs.report import Report, Section, Table, versions_text

_MEASURES: Mapping[str, Callable[[SweepRow], float]] = {
    "capacity": lambda row: row.total,
    "beyond the taps": lambda row: row.useful_total,
    "mean delay, periods": lambda row: row.mean_delay,
    "consistency": lambda row: row.consistency,
}
_NOTE = (
    "Means over seeds; in brackets, how far they span. Capacity is what motor angles and loads hold of their "
    "inputs, in inputs; beyond the taps, what they add to the last commands; mean delay is of the linear "
    "memory, in command periods; consistency is 1 where a replica repeats all. mm: mean marker distance of a "
    "readout on a session that it never saw."
)


def page(name: str, rows: Sequence[SweepRow], facts: Mapping[str, str]) -> Report:
    """The report of the points in a folder of that name."""
    grid = [row for row in rows if np.isfinite(row.stiffness)]
    rigid = [row for row in rows if not np.isfinite(row.stiffness)]
    sections = [Section("Points", _same(grid), (points_table(rows),))]
    if any(np.isfinite(row.capacity).any() for row in grid):
        sections += [
            Section("What the body computes", "", (figures.by_degree(grid, rigid),)),
            Section("What it remembers", "", (figures.memory(grid),)),
        ]
    if readouts(grid):
        sections.append(Section("Pose error of readouts", "", (figures.pose_error(grid),)))
    if failed := [row for row in rows if row.failed]:
        sections.append(Section("What could not be measured", "", (failed_table(failed),)))
    varied = " and ".join(AXES[n].name for n in _varied(rows)) or counted(len(rows), "point")
    return Report(f"Sweep of {varied} in {name}", lead(rows), tuple(sections), facts)


def lead(rows: Sequence[SweepRow]) -> str:
    """Describe where each measure is best, in a sentence or two."""
    told = []
    groups = _groups(rows)
    for name in readouts(rows):
        means = {key: _mean(of, error_of(name)) for key, of in groups.items()}
        if known := {key: mean for key, mean in means.items() if np.isfinite(mean)}:
            at = min(known, key=lambda key: known[key])
            told.append(f"{name} {known[at]:.1f} mm{_where(at, rows)}")
    told = [f"Least mean marker distances: {', '.join(told)}."] if told else []
    useful = {key: _mean(of, _MEASURES["beyond the taps"]) for key, of in groups.items()}
    if known := {key: mean for key, mean in useful.items() if np.isfinite(mean)}:
        at = max(known, key=lambda key: known[key])
        most = (
            f"Beyond the taps, motor angles and loads hold most{_where(at, rows)}: {known[at]:.2f}"
        )
        told.append(f"{most} of {_mean(groups[at], _MEASURES['capacity']):.1f} capacities.")
    measured = f"{counted(len(rows), 'point')}, {counted(len({row.seed for row in rows}), 'seed')}."
    return " ".join([measured, *told])


def points_table(rows: Sequence[SweepRow]) -> Table:
    """One line a set of values, means over seeds."""
    body = any(np.isfinite(row.capacity).any() for row in rows)
    numbers = dict(_MEASURES) if body else {}
    numbers |= {f"{name} mm": error_of(name) for name in readouts(rows)}
    columns = {
        head: lambda of, cell=cell: cell(of[0]) for head, cell in _varied_columns(rows).items()
    }
    columns |= {head: partial(_cell, value=value) for head, value in numbers.items()}
    return Table.of(_groups(rows).values(), columns, _NOTE)


def failed_table(rows: Sequence[SweepRow]) -> Table:
    """What failed at which point."""
    why = {"seed": lambda row: f"{row.seed}", "what failed": lambda row: row.failed}
    return Table.of(rows, _varied_columns(rows) | why)


def _varied_columns(rows: Sequence[SweepRow]) -> dict[str, Callable[[SweepRow], str]]:
    """A column for each quantity that is varied; a rigid cable has no slack, and its hinges' damping does
    not count.
    """

    def cell(row: SweepRow, name: str) -> str:
        rigid = not np.isfinite(row.stiffness) and name in ("slack", "damping")
        return "" if rigid else _value(name, getattr(row, name))

    varied = _varied(rows) or ["stiffness"]
    return {f"{AXES[n].name} {AXES[n].unit}": partial(cell, name=n) for n in varied}


def facts(table: Mapping[str, Any]) -> dict[str, str]:
    """The origin of the points."""
    origin = table["provenance"]
    told = {name: str(value) for name, value in origin["measuring"].items() if value is not None}
    return told | {"commit": str(origin["git_commit"]), "versions": versions_text(origin)}


def _varied(rows: Sequence[SweepRow]) -> list[str]:
    """What differs from point to point; on rigid cables only the commands and the noise count."""
    of = [row for row in rows if np.isfinite(row.stiffness)] or rows
    names = [name for name in AXES if len({getattr(row, name) for row in of}) > 1]
    stiffness = [] if len(of) == len(rows) or "stiffness" in names else ["stiffness"]
    return stiffness + names


def _same(rows: Sequence[SweepRow]) -> str:
    """What no point varies, in a sentence."""
    held = [n for n in AXES if rows and n not in _varied(rows)]
    told = [f"{AXES[n].name} {AXES[n].text(getattr(rows[0], n))} {AXES[n].unit}" for n in held]
    return f"The same at all points: {', '.join(told)}." if told else ""


def _groups(rows: Sequence[SweepRow]) -> dict[tuple[float, ...], list[SweepRow]]:
    """Rows that differ by their seeds alone, by all that is varied."""
    found: dict[tuple[float, ...], list[SweepRow]] = {}
    for row in rows:
        found.setdefault(tuple(getattr(row, name) for name in AXES), []).append(row)
    return found


def _where(at: tuple[float, ...], rows: Sequence[SweepRow]) -> str:
    values = dict(zip(AXES, at, strict=True))
    told = [f"{_value(n, values[n])} {AXES[n].unit}" for n in _varied(rows)]
    return f" at {', '.join(told)}" if told else ""


def _value(name: str, value: float) -> str:
    return AXES[name].text(value) if np.isfinite(value) else RIGID


def _mean(rows: Sequence[SweepRow], value: Callable[[SweepRow], float]) -> float:
    known = [number for row in rows if np.isfinite(number := value(row))]
    return float(np.mean(known)) if known else float("nan")


def _cell(rows: Sequence[SweepRow], value: Callable[[SweepRow], float]) -> str:
    known = [number for row in rows if np.isfinite(number := value(row))]
    if not known:
        return ""
    span = f" [{min(known):.2f} … {max(known):.2f}]" if len(known) > 1 else ""
    return f"{np.mean(known):.2f}{span}".replace("-", "−")
