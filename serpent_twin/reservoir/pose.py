"""Score readouts on the pose of a grid point's arm under the published protocol."""

import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm import mjcf
from serpent_twin.arm.control import random_targets
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import Windows
from serpent_twin.recording.simulated_arm import SimulatedArm, generators
from serpent_twin.reservoir.drive import steady_timestep
from serpent_twin.reservoir.grid_point import DROP, WINDOW, GridPoint, Measuring
from serpent_twin.sessions import Session
from serpent_twin.sim.twin import Twin
from serpent_twin.training.split import split
from serpent_twin.training.training_run import TrainingRun

PUBLISHED_RATE = 4.0
"""[Hz] P. At another rate the whole protocol goes faster or slower: velocities in proportion."""


def errors(point: GridPoint, measuring: Measuring) -> dict[str, Any]:
    """Marker distances of each readout [mm] on a session that it never saw.

    Raises SerpentError when the simulation becomes unstable or a motor switches itself off.
    """
    sessions = [session(point, measuring, n) for n in range(1, measuring.sessions + 1)]
    train, steer, test = split(sessions).windows(WINDOW, DROP)
    return {name: _score(name, point, measuring, train, steer, test) for name in measuring.readouts}


def session(point: GridPoint, measuring: Measuring, number: int) -> Session:
    """Session 1, 2, … of the protocol, in memory, at the point's rate if none is given for sessions."""
    for_targets, for_loads, for_cameras, _ = generators(point.seed, (number,))
    rate = measuring.session_rate or point.rate
    prior_runtime = (number - 1) * measuring.session_steps / rate
    twin = _twin(point, rate, prior_runtime)
    arm = SimulatedArm.of(twin, point.parameters, for_loads, for_cameras)
    targets = random_targets(measuring.session_steps, for_targets)
    return arm.session(targets, rate, {"session": number}, arm.gain * rate / PUBLISHED_RATE)


def _twin(point: GridPoint, rate: float, prior_runtime: float) -> Twin:
    """The arm with time steps that are steady, a whole number of them to a control period."""
    model = point.design.spec().compile()
    longest = steady_timestep(point.parameters.strand_stiffness, mjcf.TIMESTEP, mjcf.TIMESTEP)
    period = 1 / rate
    model.opt.timestep = period / np.ceil(period / longest - 1e-9)
    return Twin(point.design, model=model, prior_runtime=prior_runtime)


def _score(
    name: str, point: GridPoint, measuring: Measuring, train: Windows, steer: Windows, test: Windows
) -> dict[str, Any]:
    estimator = TrainingRun(name, WINDOW, Path(), point.seed, measuring.epochs).untrained()
    if estimator.trained.takes("epochs"):
        import torch

        torch.set_num_threads(1)  # the last digits depend on their number
    rng = np.random.default_rng([point.seed, WINDOW, zlib.crc32(name.encode())])
    estimator.trained.fit(train, steer, rng)
    estimate = np.concatenate([estimator.follow(each).marker for each in test.sessions])
    return asdict(score(estimate, test.marker))
