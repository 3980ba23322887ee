"""Read what each point of a sweep found, in numbers that are compared."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.reservoir.grid_point import GridPoint, Measuring
from serpent_twin.runs.files import finite


@dataclass(frozen=True, eq=False)
class SweepRow:
    """One grid point: capacities of motor angles and loads together, and the pose error from them."""

    stiffness: float
    """[N/m], infinite on rigid cables"""
    slack: float
    """[m]"""
    damping: float
    """[N m s/rad]"""
    rate: float
    """[Hz]"""
    amplitude: float
    """[rad]"""
    load_noise: float
    """Share of the stall torque"""
    seed: int
    capacity: Array
    """Capacity by degree from 1, (D,); NaN in all where the simulation failed"""
    useful: Array
    """Capacity by degree of channels and taps together, minus that of the taps, (D,)"""
    noiseless: Array
    """Capacity by degree of noiseless joint angles and loads, with the taps, minus that of the taps, (D,)"""
    memory: Array
    """Linear memory, all inputs added up, at delays from 0, (K,)"""
    mean_delay: float
    """Mean delay of the linear memory [command periods]"""
    forgetting: float
    """Rate at which joints and loads, without noise, forget where they began [1/s]"""
    consistency: float
    """[1]"""
    overlap: float
    """Share of the markers' variance that lies in what the channels hold [1]"""
    pose_mm: Mapping[str, float]
    """Mean marker distance by readout"""
    failed: str
    """What failed, in words"""

    @property
    def total(self) -> float:
        """Capacity of all degrees."""
        return float(self.capacity.sum())

    @property
    def beyond_linear(self) -> float:
        """Capacity of degrees from 2."""
        return float(self.capacity[1:].sum())

    @property
    def useful_total(self) -> float:
        """What the channels add to the taps."""
        return float(self.useful.sum())

    @property
    def noiseless_total(self) -> float:
        """What the body adds to the taps."""
        return float(self.noiseless.sum())

    @property
    def even(self) -> float:
        """Capacity of even degrees."""
        return float(self.capacity[1::2].sum())

    def numbers(self) -> dict[str, Any]:
        """All of it, as the results.json of an experiment has it; `row_from` reads it again."""
        return {key: finite(getattr(self, name)) for name, key in _KEYS.items()}


_KEYS = {
    "stiffness": "stiffness_n_m",
    "slack": "slack_m",
    "damping": "damping_n_m_s_per_rad",
    "rate": "rate_hz",
    "amplitude": "amplitude_rad",
    "load_noise": "load_noise",
    "seed": "seed",
    "capacity": "capacity_by_degree",
    "useful": "useful_by_degree",
    "noiseless": "useful_by_degree_noiseless",
    "memory": "memory_by_delay",
    "mean_delay": "mean_delay_steps",
    "forgetting": "forgetting_per_s",
    "consistency": "consistency",
    "overlap": "marker_overlap",
    "pose_mm": "pose_mm",
    "failed": "failed",
}
"""A row's names in JSON, with units"""


def row_of(point: GridPoint, content: Mapping[str, Any], measuring: Measuring) -> SweepRow:
    """The row of a grid point's file."""
    body = content["body"]
    both = body["channels"]["both"] if body else None
    degrees, delays = len(measuring.delays), measuring.memory_delay + 1
    return SweepRow(
        stiffness=np.inf if point.stiffness is None else point.stiffness,
        slack=point.slack,
        damping=point.damping,
        rate=point.rate,
        amplitude=point.amplitude,
        load_noise=point.load_noise,
        seed=point.seed,
        capacity=_degrees(both["capacity"]) if both else np.full(degrees, np.nan),
        useful=_degrees(both["beyond_taps"]) if both else np.full(degrees, np.nan),
        noiseless=_degrees(body["noiseless"]["beyond_taps"]) if body else np.full(degrees, np.nan),
        memory=np.sum(both["memory"]["profile"], axis=0) if both else np.full(delays, np.nan),
        mean_delay=_number(both["memory"]["mean_delay_periods"] if both else None),
        forgetting=_number(body["contraction_rate_per_s"] if body else None),
        consistency=_number(both["consistency"] if both else None),
        overlap=_number(both["marker_overlap"] if both else None),
        pose_mm={name: each["mean_mm"] for name, each in (content["pose"] or {}).items()},
        failed="; ".join(f"{part}: {why}" for part, why in content["failed"].items()),
    )


def row_from(numbers: Mapping[str, Any]) -> SweepRow:
    """The row whose `numbers` these are."""
    row: dict[str, Any] = {name: _known(numbers[key]) for name, key in _KEYS.items()}
    if np.isnan(row["stiffness"]):  # rigid cables
        row["stiffness"] = np.inf
    return SweepRow(**row)


def _known(value: Any) -> Any:
    """What JSON holds, with NaN in place of null and arrays in place of lists."""
    if isinstance(value, list):
        return np.array([_known(each) for each in value])
    if isinstance(value, Mapping):
        return {name: _known(each) for name, each in value.items()}
    return np.nan if value is None else value


def _degrees(of: Mapping[str, Any]) -> Array:
    return np.array(list(of["by_degree"].values()))


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def values(rows: Sequence[SweepRow], value: Callable[[SweepRow], float]) -> Array:
    """A number of every row by slack, stiffness and seed, ascending, (L, K, S); NaN where there is none."""
    where = [(row.slack, row.stiffness, row.seed) for row in rows]
    axes = [sorted(set(axis)) for axis in zip(*where, strict=True)]
    found = np.full([len(axis) for axis in axes], np.nan)
    for row, at in zip(rows, where, strict=True):
        found[tuple(axis.index(each) for axis, each in zip(axes, at, strict=True))] = value(row)
    return found


def readouts(rows: Sequence[SweepRow]) -> list[str]:
    """Names of the readouts that were scored anywhere."""
    return list(dict.fromkeys(name for row in rows for name in row.pose_mm))


def steady_readouts(rows: Sequence[SweepRow]) -> list[str]:
    """Names of the readouts that were scored wherever any was."""
    scored = [row.pose_mm for row in rows if row.pose_mm]
    return [name for name in readouts(rows) if all(name in each for each in scored)]


def error_of(readout: str) -> Callable[[SweepRow], float]:
    """The function that takes a readout's error [mm] from a row."""
    return lambda row: row.pose_mm.get(readout, float("nan"))
