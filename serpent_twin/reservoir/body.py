"""Simulate an arm and its sensors along the inputs that measure it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.reservoir import channels, drive, rigid, streams
from serpent_twin.reservoir.drive import HeldResponse
from serpent_twin.reservoir.grid_point import GridPoint, Measuring
from serpent_twin.reservoir.rank import STREAMS_PER_CHANNEL

STREAMS = STREAMS_PER_CHANNEL * channels.COUNT


@dataclass(frozen=True, eq=False)
class ReservoirResponse:
    """Response of one arm: B stretches of K command periods, replicas of the first n, and streams."""

    inputs: Array
    """Inputs of the stretches, on [−1, 1], (B, K, 9)"""
    motion: HeldResponse
    """Response in the stretches"""
    read: Array
    """Channels of the stretches as read, (B, K, 20)"""
    replica: HeldResponse
    """Response in the first n stretches from other initial poses, each at rest on its motors' angles"""
    replica_read: Array
    """Channels of the replicas as read, (n, K, 20)"""
    differing: Array
    """Channels as read after streams that differ, (STREAMS, 20)"""
    alike: Array
    """Channels as read after streams whose last inputs are alike, (STREAMS, 20)"""


def simulate(point: GridPoint, measuring: Measuring) -> ReservoirResponse:
    """Drive a point's arm. Raises SerpentError when the simulation becomes unstable."""
    seeds = np.random.SeedSequence(point.seed).spawn(4)
    for_inputs, for_replicas, for_streams, for_noise = map(np.random.default_rng, seeds)
    B, rows = measuring.stretches, measuring.rows(point.steps)
    u = for_inputs.uniform(-1, 1, (B, 1 + measuring.washout + rows, N_JOINTS))
    again = u[: -(-measuring.repeated // rows)].copy()
    again[:, 0] = for_replicas.uniform(-1, 1, again[:, 0].shape)
    drawn = [
        streams(for_streams, STREAMS, 1 + measuring.stream, N_JOINTS, alike)
        for alike in (0, measuring.taps)
    ]
    move = _mover(point)
    streamed = move(np.concatenate(drawn))  # first: an unstable twin shows soon
    moved = move(np.concatenate([u, again]))
    noise = point.parameters.load_noise
    seen, last = (channels.read(m, noise, for_noise) for m in (moved, streamed))
    return ReservoirResponse(
        inputs=u[:, 1:],
        motion=_some(moved, slice(None, B)),
        read=seen[:B],
        replica=_some(moved, slice(B, None)),
        replica_read=seen[B:],
        differing=last[:STREAMS, -1],
        alike=last[STREAMS:, -1],
    )


def _mover(point: GridPoint) -> Callable[[Array], HeldResponse]:
    """The simulation of a grid point's arm along inputs on [−1, 1]."""
    if point.stiffness is None:
        return lambda u: rigid.move(point.amplitude * u)
    return lambda u: drive.drive(point.design, point.amplitude * u, point.rate)


def _some(motion: HeldResponse, stretches: slice) -> HeldResponse:
    return HeldResponse(**{name: values[stretches] for name, values in vars(motion).items()})
