"""Measure memory, products, separation and consistency of a body as its sensors show it."""

from typing import Any

import numpy as np

from serpent_twin import reservoir
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.reservoir import Capacities, Expansion, channels, label
from serpent_twin.reservoir.body import ReservoirResponse
from serpent_twin.reservoir.grid_point import GridPoint, Measuring

_SETTLED = 1e-6  # [standard deviations] a replica nearer than this is the same but for rounding
_NAMED = 10  # products that a file names


def measure(runs: ReservoirResponse, point: GridPoint, measuring: Measuring) -> dict[str, Any]:
    """All measures by channel set, and of the markers and the body as such; JSON-ready but for rounding."""
    markers = runs.motion.marker.reshape(*runs.inputs.shape[:2], -1)
    found = reservoir.expand(markers, runs.inputs, *_search(measuring))
    floor = channels.floor(point.parameters.load_noise)
    by_set = {
        name: _held(runs.read[..., of], runs.inputs, measuring, found)
        | _repeated(runs, of, measuring.washout)
        | _told_apart(runs, of, floor)
        for name, of in channels.SETS.items()
    }
    return {
        "rows": found.T,
        "channels": by_set,
        "noiseless": _held(_noiseless(runs), runs.inputs, measuring, found),
        "markers": _expanded(found),
        "contraction_rate_per_s": _contraction(runs, 1 / point.rate),
    }


def _noiseless(runs: ReservoirResponse) -> Array:
    """The body's response without sensor noise: joint angles and loads, (B, K, 19)."""
    return np.concatenate([runs.motion.joint_angle, runs.motion.load], axis=-1)


def _search(measuring: Measuring) -> tuple[int, tuple[int, ...], int, float]:
    """Degree, delays, washout, coarsest."""
    return len(measuring.delays), measuring.delays, measuring.washout, measuring.coarsest


def _held(x: Array, u: Array, measuring: Measuring, markers: Expansion) -> dict[str, Any]:
    """Capacities of channels x (B, K, N) for inputs u (B, K, 9), and for the markers."""
    delay, (_, _, washout, coarsest) = measuring.memory_delay, _search(measuring)
    memory = reservoir.memory(x, u, delay, washout, coarsest)
    ipc = reservoir.capacities(x, u, *_search(measuring))
    beyond = reservoir.beyond_taps(x, u, measuring.taps, *_search(measuring))
    return {
        "rank": ipc.r,
        "cut": ipc.cut,
        "memory": {
            "profile": memory.profile,
            "total": memory.total,
            "mean_delay_periods": memory.mean_delay,
        },
        "capacity": _capacity(ipc),
        "beyond_taps": {
            "total": beyond.total,
            "by_degree": _by_degree(beyond.by_degree),
            "taps_alone": beyond.taps.total,
            "cut": beyond.together.cut,
        },
        "marker_overlap": overlap(markers, ipc),
    }


def overlap(markers: Expansion, held: Capacities) -> float:
    """Share of the markers' variance in products that the states hold, each as far as they hold it."""
    capacity = dict(zip(held.products, held.capacity, strict=True))
    shares = zip(markers.products, markers.overall, strict=True)
    return float(sum(share * capacity.get(product, 0.0) for product, share in shares))


def _capacity(ipc: Capacities) -> dict[str, Any]:
    largest = zip(ipc.products[:_NAMED], ipc.capacity, strict=False)
    return {
        "total": ipc.total,
        "by_degree": _by_degree(ipc.by_degree),
        "products": len(ipc.products),
        "largest": {label(product): capacity for product, capacity in largest},
    }


def _expanded(found: Expansion) -> dict[str, Any]:
    """Shares of all markers' variance together."""
    weight = found.variance / found.variance.sum()
    largest = zip(found.products[:_NAMED], found.overall, strict=False)
    return {
        "explained": float(found.explained @ weight),
        "by_degree": _by_degree(found.by_degree @ weight),
        "deviation_mm": 1e3 * np.sqrt(found.variance.reshape(-1, 3).sum(axis=1)),
        "largest": {label(product): share for product, share in largest},
    }


def _by_degree(totals: Array) -> dict[str, float]:
    """A sum for each total degree from 1, by its name."""
    return {str(degree): float(total) for degree, total in enumerate(totals) if degree}


def _repeated(runs: ReservoirResponse, of: slice, washout: int) -> dict[str, Any]:
    """Consistency of the channels between replicas."""
    n = len(runs.replica_read)
    pair = np.stack([runs.read[:n, washout:, of], runs.replica_read[:, washout:, of]])
    replicas = pair.reshape(2, -1, pair.shape[-1])
    return {
        "consistency": float(np.mean(reservoir.channel_consistency(replicas))),
        "consistency_spectrum": reservoir.consistency_spectrum(replicas),
    }


def _told_apart(runs: ReservoirResponse, of: slice, floor: Array) -> dict[str, int]:
    return {
        "kernel_rank": reservoir.state_rank(runs.differing[:, of], floor[of]),
        "generalisation_rank": reservoir.state_rank(runs.alike[:, of], floor[of]),
    }


def _contraction(runs: ReservoirResponse, period: float) -> float:
    """Rate [1/s] at which joints and loads, without noise, forget the pose where they began.

    NaN where they forget it within two command periods.
    """
    n = len(runs.replica.load)
    both = [
        np.concatenate([motion.joint_angle[:n], motion.load[:n]], axis=-1)
        for motion in (runs.motion, runs.replica)
    ]
    # The channels of each stretch count as separate channels.
    replicas = np.stack([np.concatenate(list(each), axis=-1) for each in both])
    try:
        return reservoir.contraction_rate(reservoir.distance(replicas), period, _SETTLED)
    except SerpentError:
        return float("nan")
