"""Compute the errors and latencies of a session's live estimates."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.live.follower import LATENCY, Follower
from serpent_twin.readouts.score import distances
from serpent_twin.recording.loop import Row

Rows = NDArray[np.intp]


class Course:
    """Rows of a session, as far as its figures need them."""

    def __init__(self, rows: int) -> None:
        self.rows = 0
        self.time, self.latency_ms = np.full((2, rows), np.nan)
        self.measured = np.full((rows, N_JOINTS, 3), np.nan)
        self.missed: int | None = None

    def see(self, row: Row) -> None:
        """Store a logged row."""
        k, self.rows = self.rows, self.rows + 1
        self.time[k], self.latency_ms[k] = row["time"], row[LATENCY]
        self.measured[k] = row["marker"]

    def end(self, account: Mapping[str, Any]) -> None:
        """Store the timing of the loop, in real time."""
        self.missed = account["loop"]["missed_deadlines"]


def figures(course: Course, follower: Follower, period: float) -> dict[str, Any]:
    """Figures of a session and of what was estimated in it, JSON-ready; None where unknown."""
    rows = course.rows
    latency = course.latency_ms[:rows]
    where = np.flatnonzero(np.isfinite(latency))
    return {
        "rows": rows,
        "rows_estimated": len(where),
        "duration_s": float(course.time[rows - 1]),
        "latency_ms": _times(latency),
        "update_ms": _times(follower.update_ms[where]),
        "estimates_later_than_a_period": int((latency[where] > 1e3 * period).sum()),
        "missed_deadlines": course.missed,
        "mean_spread_mm": _mean(1e3 * follower.belief(where).spread),
        "weighed": follower.weighed(),
    } | _against(course.measured[:rows], follower, where)


def told(found: Mapping[str, Any]) -> str:
    """The main figures as lines of text."""
    lines = [
        f"{found['rows_estimated']} of {found['rows']} rows estimated at {found['rate_hz']:g} Hz."
    ]
    if (late := found["latency_ms"]) is not None:
        lines.append(
            "From reading to estimate: "
            + ", ".join(f"{name} {late[name]:.2f} ms" for name in ("mean", "median", "p99", "max"))
            + f"; {found['estimates_later_than_a_period']} took longer than a period."
        )
    if found["missed_deadlines"] is not None:
        lines.append(f"Missed deadlines of the loop: {found['missed_deadlines']}.")
    if found["mean_error_mm"] is not None:
        lines.append(f"Mean marker error {found['mean_error_mm']:.2f} mm against the cameras.")
    if found["mean_spread_mm"] is not None:
        lines.append(f"Expected by the readout: {found['mean_spread_mm']:.2f} mm rms.")
    if found["coverage_95"] is not None:
        lines.append(f"Its 95 % ellipsoids held {100 * found['coverage_95']:.1f} % of the markers.")
    for name, each in found["weighed"].items():
        lines.append(
            f"By loads at the end: {name} {each['value']:.4f} ± {each['std']:.4f} {each['unit']}."
        )
    return "\n".join(lines)


def _against(measured: Array, follower: Follower, where: Rows) -> dict[str, float | None]:
    """Errors against the markers that cameras measured meanwhile."""
    belief = follower.belief(where)
    error = distances(belief.marker, measured[where])
    seen = np.isfinite(error)
    known = seen.any() and np.isfinite(belief.covariance[seen]).all()
    return {
        "markers_seen": int(np.isfinite(measured).all(axis=-1).sum()),
        "mean_error_mm": _mean(1e3 * error),
        "coverage_95": belief.coverage(measured[where]) if known else None,
    }


def _times(took: Array) -> dict[str, float] | None:
    took = took[np.isfinite(took)]
    if not took.size:
        return None
    return {
        "mean": float(took.mean()),
        "median": float(np.median(took)),
        "p99": float(np.quantile(took, 0.99)),
        "max": float(took.max()),
        "first": float(took[0]),
    }


def _mean(values: Array) -> float | None:
    values = values[np.isfinite(values)]
    return float(values.mean()) if values.size else None
