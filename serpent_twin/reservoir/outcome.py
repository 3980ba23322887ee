"""Store the result of one grid point, complete and the same wherever it is measured."""

import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any

from serpent_twin.engine.quiet import quietly
from serpent_twin.errors import SerpentError
from serpent_twin.reservoir import body, measures, pose
from serpent_twin.reservoir.grid_point import GridPoint, Measuring
from serpent_twin.runs.files import finite, json_text
from serpent_twin.runs.provenance import provenance

_DIGITS = 6
_NOTHING = 1e-9  # differences of sums leave less by rounding, which depends on the processor


@dataclass(frozen=True)
class Outcome:
    """One point's file, and what belongs beside it because it differs from run to run."""

    text: str
    """The file's content, JSON; nothing in it depends on where or when it was measured"""
    versions: dict[str, str]
    """Versions of the software that computed the outcome"""
    git_commit: str
    """Commit of this project where the outcome was computed"""
    host: str
    """Name of the machine"""
    seconds: dict[str, float]
    """What simulating, measuring and the pose readouts took [s]"""


@dataclass
class _Parts:
    """Parts of a grid point, each with its time or why it failed."""

    found: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, name: str, make: Callable[[], Any]) -> None:
        began = time.perf_counter()
        try:
            self.found[name] = make()
        except SerpentError as error:
            self.failed[name] = str(error)
        self.seconds[name] = time.perf_counter() - began


def measured(point: GridPoint, measuring: Measuring) -> Outcome:
    """Measure a grid point; what cannot be measured, such as an unstable twin, is stated in its file."""
    with quietly():  # the terminal shows a sweep's progress
        parts = _parts(point, measuring)
    content = {
        "point": point.described(),
        "arm": point.arm,
        "measuring": asdict(measuring),
        "failed": parts.failed,
        "body": parts.found.get("body"),
        "pose": parts.found.get("pose"),
    }
    about = _about()
    text = json_text(rounded(content), ensure_ascii=False)
    return Outcome(
        text, about["versions"], about["git_commit"], platform.node(), rounded(parts.seconds)
    )


def _parts(point: GridPoint, measuring: Measuring) -> _Parts:
    parts = _Parts()
    if measuring.body:
        parts.add("simulation", lambda: body.simulate(point, measuring))
    if runs := parts.found.get("simulation"):
        parts.add("body", lambda: measures.measure(runs, point, measuring))
    if point.stiffness is not None:  # on rigid cables the analytical pose is the pose
        parts.add("pose", lambda: pose.errors(point, measuring))
    return parts


@cache
def _about() -> dict[str, Any]:
    return provenance()


def rounded(value: Any) -> Any:
    """JSON's own kinds of values, numbers to six digits, None for what is not a number.

    The last digits of linear algebra depend on processor and threads.
    """
    return finite(value, lambda x: float(f"{x:.{_DIGITS}g}") if abs(x) > _NOTHING else 0.0)
