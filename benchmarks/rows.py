"""Keep what a benchmark measures: a line on the screen, and a row of its JSON file."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.runs.files import write_json


class BenchmarkRows:
    """What one benchmark measured."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []
        self.load_before = os.getloadavg()[0]

    def add(self, what: str, value: float, unit: str = "", aim: str = "") -> None:
        """Print a number, and keep it; a ratio has no unit, and an aim is optional."""
        self.rows.append({"what": what, "value": float(value), "unit": unit, "aim": aim})
        print(f"{what}: {told(value, unit)}{f' (aim: {aim})' if aim else ''}", flush=True)

    def write(self, path: Path | None) -> None:
        """Write all rows, and how busy the machine was before; nothing without a path."""
        if path:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_json(path, {"rows": self.rows, "load_before": self.load_before})


def told(value: float, unit: str) -> str:
    """A number of three digits at least, with its unit."""
    digits = f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return f"{digits} {unit}".strip()


def seconds(of: Callable[[], object]) -> float:
    """How long a call takes."""
    start = time.perf_counter()
    of()
    return time.perf_counter() - start


def ratio(one: Callable[[], float], other: Callable[[], float], rounds: int) -> float:
    """The median of one over the other."""
    return float(np.median([one() / other() for _ in range(rounds)]))
