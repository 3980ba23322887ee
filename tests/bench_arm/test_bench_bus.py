"""A bench arm on its bus does what it does in a recorded session, and carries what it takes up."""

from dataclasses import replace

import numpy as np
import pytest

import bench_arm
from bench_arm.bus import BenchBus, BenchCameras
from bench_arm.record import SUBSTEPS
from bench_arm.session import GAIN, RATE
from serpent_twin.arm.control import random_targets
from serpent_twin.recording.loop import TargetSteering, record

ROWS = 24


@pytest.fixture(scope="module")
def arm():
    drawn = bench_arm.draw(np.random.default_rng(4))
    return replace(drawn, marker_noise=0.0, load_noise=0.0, marker_loss=0.0)


@pytest.fixture(scope="module")
def targets():
    return random_targets(ROWS, np.random.default_rng(2))


def driven(arm, targets, effects=bench_arm.NONE, rate=RATE):
    bus = BenchBus(arm, effects)
    with bus:
        steering = TargetSteering(targets, GAIN)
        return list(record(bus, BenchCameras(bus), steering, 1 / rate))


@pytest.mark.parametrize("latency", [0.0, 0.06])
def test_on_the_bus_an_arm_does_what_it_does_in_a_session(arm, targets, latency):
    effects = replace(bench_arm.NONE, mocap_latency=latency, motor_latency=latency)
    spec = bench_arm.SessionSpec(arm, effects, 1, 0, target=targets)
    (session,) = bench_arm.simulate([spec], ROWS, SUBSTEPS)
    rows = driven(arm, targets, effects)
    for name, on_bus in (
        ("marker", "marker"),
        ("motor_position", "motor_position"),
        ("motor_load", "motor_load"),
        ("motor_velocity_command", "motor_velocity_command"),
    ):
        found = np.stack([row[on_bus] for row in rows])
        np.testing.assert_allclose(found, session[name], atol=1e-9)


def test_a_late_reading_is_of_before_the_last_step_at_a_high_rate(arm):
    late = replace(bench_arm.NONE, mocap_latency=0.1)
    still = np.repeat(np.full((1, 9), 0.2), 60, axis=0)
    plain, seen = (
        np.stack([row["marker"] for row in driven(arm, still, effects, rate=50.0)])
        for effects in (bench_arm.NONE, late)
    )
    np.testing.assert_allclose(seen[25:], plain[20:-5], atol=1e-9)


def test_what_is_taken_up_pulls_the_arm_down(arm):
    bus = BenchBus(arm)
    bent = np.cumsum(np.where(np.arange(10) % 2, 0.2, 0.0))
    bus.write_velocity(bent)
    bus.wait(1.0)
    bus.write_velocity(np.zeros(10))
    bus.wait(3.0)
    before = bus.frames[0][-1]
    bus.take_up(0.05)
    bus.wait(3.0)
    after = bus.frames[0][-1]
    assert after[0] - before[0] > 5e-4  # x hangs down
