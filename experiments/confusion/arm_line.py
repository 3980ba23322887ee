"""Keep a line for every arm in a file that goes with the project, so that studies add up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv

from experiments.confusion.arms import BY_FIT, GENERATION
from experiments.confusion.config import Confusion
from experiments.confusion.plan import KNOWN, OUTSIDE, Trial
from experiments.confusion.score import Row, called, coverage, discovered, off, right
from experiments.confusion.stated_limits import times_limit
from serpent_twin import __version__
from serpent_twin.errors import SerpentError
from serpent_twin.runs.files import write_whole

BETWEEN = " + "
"""Names of several effects"""
FAILED = "failed"
"""Called so: an arm whose trace ended in an error"""


@dataclass(frozen=True)
class ArmLine:
    """One arm, what it had, and what the trace said."""

    version: str
    """Version of this project; rates are of one version"""
    commit: str
    """Commit that traced it"""
    source: str
    """twin or bench"""
    seed: int
    """Seed of the study"""
    sessions: int
    """Sessions of the arm, the one that judged included"""
    steps: int
    """Control steps of each session"""
    generation: int
    """Generation of the study, as `confusion.arms` counts them"""
    arm: str
    """The trial's name in the study"""
    kind: str
    """clean, known, pair or outside"""
    there: str
    """Names of the effects that it had, or none"""
    strength: float
    """Strength of the first effect, in its unit"""
    unit: str
    called: str
    """Names of the effects that were found; else unexplained, nothing or failed"""
    right: bool
    discovered: bool
    """Whether a fault outside the catalogue was composed: the right law at its place"""
    unexplained: bool
    off: float
    """How far the first rightly named strength was from the truth, of the truth [1]"""
    held: int
    """Strengths that lay in their 95 % interval"""
    intervals: int
    """Number of intervals judged"""
    parts_held: int
    """Numbers of the arm's parts, whose truth is known, that lay in their 95 % interval"""
    parts: int
    """Number of parts judged; 0 where they were not"""
    calibrated_mm: float
    corrected_mm: float
    """Mean error on the session held out"""
    complete_mm: float
    """What a twin that lacks nothing would leave"""
    seconds: float
    """Duration of the trace"""
    worth: float
    """What the true law of a fault outside the catalogue would have been worth where laws were sought
    [squared standard errors], as earlier versions computed it; else NaN"""
    times_limit: float
    """Strength of its one effect of the catalogue, over the detection limit that was stated of it; NaN where
    none was"""
    limits: str
    """The detection limits that the trace stated, in the unit of each effect's strength: NAME LIMIT, ...;
    of the effect that was there, for its other parameters' true values"""

    @property
    def stated_limits(self) -> dict[str, float]:
        """The detection limit of each effect."""
        pairs = (each.split() for each in self.limits.split(", ") if each)
        return {name: float(limit) for name, limit in pairs}

    @property
    def of_limit(self) -> float:
        """`times_limit`, where that limit is what a fit cannot take up; else NaN."""
        return self.times_limit if self.generation >= BY_FIT else np.nan

    @property
    def key(self) -> tuple[Any, ...]:
        """What identifies an arm traced by a commit."""
        return self.commit, self.source, self.seed, self.sessions, self.steps, self.arm


def line_of(row: Row, trial: Trial, config: Confusion) -> ArmLine:
    """The line of a trial's row of results.jsonl."""
    effects = row.get("truth", {}).get("effects", [])
    first = effects[0] if effects else {"strength": np.nan, "unit": ""}
    failed = FAILED in row
    error = {} if failed else row["error_mm"]
    share = None if failed else coverage([row])["all"]
    named = [each["name"] for each in row.get("named", [])]
    limits = row.get("limits", {})
    alone = trial.kind == KNOWN and bool(effects)
    held, parts = row.get("parts", (0, 0))
    return ArmLine(
        version=__version__,
        commit=row.get("git_commit", "unknown"),
        source=config.source,
        seed=config.seed,
        sessions=trial.sessions,
        steps=config.steps,
        generation=GENERATION,
        arm=trial.id,
        kind=trial.kind,
        there=trial.name,
        strength=first["strength"],
        unit=first["unit"],
        called=FAILED if failed else BETWEEN.join(named) or called(row),
        right=not failed and right(row),
        discovered=not failed and trial.kind == OUTSIDE and discovered(row),
        unexplained=not failed and row["unexplained"],
        off=np.nan if failed else off(row),
        held=share.count if share else 0,
        intervals=share.of if share else 0,
        parts_held=held,
        parts=parts,
        calibrated_mm=_rounded(error.get("calibrated")),
        corrected_mm=_rounded(error.get("corrected")),
        complete_mm=_rounded(error.get("expected")),
        seconds=_rounded(row.get("seconds"), 0),
        worth=_rounded(row.get("worth"), 1),
        times_limit=_rounded(times_limit(first, limits)) if alone else np.nan,
        limits=", ".join(f"{name} {limit:.3g}" for name, limit in sorted(limits.items())),
    )


def add(path: Path, lines: Sequence[ArmLine]) -> None:
    """Add lines to a file, or take the place of those of the same arm and commit."""
    there = {each.key: each for each in (read(path) if path.exists() else [])}
    there |= {each.key: each for each in lines}
    columns = {
        of.name: [getattr(each, of.name) for each in there.values()] for of in fields(ArmLine)
    }
    table, sink = pa.table(columns), pa.BufferOutputStream()
    csv.write_csv(table, sink)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, sink.getvalue().to_pybytes().decode())


def read(path: Path) -> list[ArmLine]:
    """All lines of a file."""
    if not path.exists():
        raise SerpentError(f"{path} does not exist. experiments.confusion --rows {path} makes it.")
    types = {of.name: _ARROW[of.type] for of in fields(ArmLine)}
    how = csv.ConvertOptions(column_types=types, strings_can_be_null=False)
    try:
        table = csv.read_csv(path, convert_options=how)
        lines = table.to_pylist()
        return [ArmLine(**{n: np.nan if v is None else v for n, v in x.items()}) for x in lines]
    except (pa.ArrowInvalid, TypeError) as error:
        raise SerpentError(
            f"{path} holds no lines of experiments.confusion: {error}. Take the file of the repository."
        ) from error


_ARROW: Mapping[Any, pa.DataType] = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
}


def _rounded(value: float | None, digits: int = 3) -> float:
    return round(value, digits) if value is not None else float("nan")
