"""Known forces on links of a bench arm: as a force from outside acts, stated in the log, and without a trace
where none acts."""

from dataclasses import replace

import numpy as np
import pytest

import bench_arm
from bench_arm.sensors import SessionSpec
from bench_arm.session import RATE, session, simulate
from serpent_twin.sim.pushes import COLUMNS, Push

ROWS, SUBSTEPS = 24, 40


def arm():
    return bench_arm.draw(np.random.default_rng(0))


def run(effects=bench_arm.NONE, pushes=()):
    return simulate([SessionSpec(arm(), effects, 1, 3, pushes=pushes)], ROWS, SUBSTEPS)[0]


def test_a_push_that_lasts_acts_as_a_force_from_outside_does():
    """A push acts from its first row on; an outside force acts before, too, which is forgotten in a while."""
    force = (0.0, 0.3, -0.2)
    size = float(np.linalg.norm(force))
    effects = replace(
        bench_arm.NONE,
        outside_force=size,
        force_direction=tuple(np.array(force) / size),
        force_link=7,
        force_joint=1,
        force_threshold=-9.0,
    )
    outside = run(effects)["marker"]
    pushed = run(pushes=(Push(7, force, 0.0, 60.0),))["marker"]
    free = run()["marker"]
    late = slice(12, None)
    apart = np.nanmean(np.linalg.norm(pushed - free, axis=2)[late])
    assert (
        np.nanmean(np.linalg.norm(pushed - outside, axis=2)[late]) < 0.1 * apart
    )  # friction remembers
    assert apart > 2e-3


def test_the_log_states_a_push_and_shows_nothing_before_it():
    pushes = (Push(9, (0.5, 0.0, 0.0), 3.0, 4.0),)
    arrays, free = run(pushes=pushes), run()
    log = session(arrays, "arm", 1)
    assert set(COLUMNS) == set(log.extra)
    acts = (log.time >= 3.0) & (log.time < 4.0)
    assert (log.extra["push_link"] == 9 * acts).all()
    assert log.extra["push_x"] == pytest.approx(0.5 * acts)
    first = int(3 * RATE)
    assert (arrays["motor_load"][: first + 1] == free["motor_load"][: first + 1]).all()
    assert (arrays["motor_load"][first + 1] != free["motor_load"][first + 1]).any()
