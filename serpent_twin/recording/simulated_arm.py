"""Set a twin up as an arm is: behind a bus, in front of cameras, with a controller."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arm.parameters import Parameters
from serpent_twin.arrays import Array
from serpent_twin.emulator.cameras import SimulatedMocap
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.recording.loop import TargetSteering, record
from serpent_twin.sessions.session import SCHEMA_VERSION, Session, session_from_rows
from serpent_twin.sim.twin import Twin


def generators(
    seed: int | Sequence[int], spawn_key: tuple[int, ...] = ()
) -> list[np.random.Generator]:
    """Generators of a session's targets, loads, cameras and pushes: what one draws does not shift another."""
    seeds = np.random.SeedSequence(seed, spawn_key=spawn_key).spawn(4)
    return [np.random.default_rng(each) for each in seeds]


@dataclass(frozen=True)
class SimulatedArm:
    """A twin behind a simulated bus, and cameras that measure it."""

    bus: SimulatedBus
    """Its motors"""
    cameras: SimulatedMocap
    """Its markers"""
    gain: float
    """Gain of the arm's P controller [1/s]"""

    @classmethod
    def of(
        cls,
        twin: Twin,
        parameters: Parameters,
        for_loads: np.random.Generator,
        for_cameras: np.random.Generator,
        marker_loss: float = 0.0,
    ) -> "SimulatedArm":
        """Arm with the noise and the gain of its parameters; a share of the marker readings is lost."""
        bus = SimulatedBus(twin, for_loads, parameters.load_noise)
        cameras = SimulatedMocap(twin, for_cameras, parameters.marker_noise, marker_loss)
        return cls(bus, cameras, parameters.controller_gain)

    def session(
        self, targets: Array, rate_hz: float, about: Mapping[str, Any], gain: float | None = None
    ) -> Session:
        """One session in memory along joint targets [rad], (steps, 9); `about` is its metadata.

        `gain` [1/s] takes the place of the arm's own.
        """
        with self.bus:
            gain = self.gain if gain is None else gain
            steering = TargetSteering(targets, gain)
            rows = list(record(self.bus, self.cameras, steering, 1 / rate_hz))
        whole = {"schema_version": SCHEMA_VERSION} | dict(about) | {"rate_hz": rate_hz}
        return session_from_rows(rows, whole)
