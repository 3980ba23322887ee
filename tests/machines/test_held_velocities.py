"""Test which logged velocities say how joints move, where rows are of torques."""

import held_models
import numpy as np
import pytest
from example import Example, assert_named_alone
from held_models import MJCF, PERIOD, TOML, motion

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.known_motion import change_column, rate_column
from serpent_twin.machines.rig import NOTES

COARSE = 2e-3  # steps of the encoders [rad]
NOISE = 1e-3  # of the velocities [rad/s]
VELOCITIES = """    { joint = "shoulder", columns = ["v1"], unit = "rpm" },
    { joint = "elbow", columns = ["v2"], unit = "deg/s" },
]
"""


def true(seed, rows):
    """Velocities [rad/s], (T, 2)."""
    return motion(seed, rows)[1]


def late(seed, rows):
    """Velocities that are 2 rows late."""
    v = true(seed, rows)
    return np.r_[v[:1], v[:1], v[:-2]]


def differenced(seed, rows):
    """Differences of the encoders' readings over a row."""
    read = COARSE * np.round(motion(seed, rows)[0] / COARSE)
    return np.diff(read, axis=0, prepend=read[:1]) / PERIOD


def log(path, seed, velocity=true, more=lambda q, v, a: 0.0, rows=2000):
    """Write a log of angles, torques and velocities."""
    held_models.log(path, seed, more=more, step=COARSE, rows=rows)
    head, *lines = path.read_text().splitlines()
    v = velocity(seed, rows)
    if velocity is not differenced:
        v = v + NOISE * np.random.default_rng(seed).standard_normal(v.shape)
    v = v * [60 / (2 * np.pi), 180 / np.pi]
    some = [f"{line},{one:.9f},{two:.9f}" for line, (one, two) in zip(lines, v, strict=True)]
    path.write_text("\n".join([f"{head},v1,v2", *some]) + "\n")
    return path


EXAMPLE = Example(MJCF, TOML.removesuffix("]\n") + VELOCITIES, log)
WITHOUT = Example(MJCF, TOML, log)


def read(folder, example, velocity):
    """A log as it is used: rates and accelerations of both joints, (T, 2), what they are off by, rms, and
    what is said.
    """
    rig = open_machine(example.write(folder))
    (run,) = rig.read(log(folder / "log.csv", 0, velocity))
    of = [
        np.stack([run.columns[column(name)] for name in ("q1", "q2")], axis=1) / run.period**n
        for n, column in ((1, rate_column), (2, change_column))
    ]
    rows = np.rint(run.time / PERIOD).astype(int)
    inner = slice(len(rows) // 10, -len(rows) // 10)
    off = [
        np.sqrt(np.mean((found - motion(0)[n][rows])[inner] ** 2, axis=0))
        for n, found in enumerate(of, 1)
    ]
    return of, np.array(off), run.metadata[NOTES][-1]


@pytest.mark.parametrize("velocity", [true, late])
def test_quiet_velocities_are_used_without_their_delay(tmp_path, velocity):
    _, with_them, said = read(tmp_path, EXAMPLE, velocity)
    _, without, _ = read(tmp_path / "without", WITHOUT, velocity)
    assert np.all(with_them < 0.6 * without)
    assert "'v1' is differentiated once" in said and "'v2' is differentiated once" in said
    assert ("without its delay of 10 ms" in said) == (velocity is late)


def test_velocities_that_a_driver_made_of_the_angles_change_nothing(tmp_path):
    with_them, _, said = read(tmp_path, EXAMPLE, differenced)
    without, *_ = read(tmp_path / "without", WITHOUT, differenced)
    np.testing.assert_array_equal(with_them, without)
    assert "'v1' is not used" in said and "'v2' is not used" in said


def test_a_velocity_is_no_channel_where_rows_are_of_torques(tmp_path):
    case, *_ = EXAMPLE.opened(tmp_path, 0)
    assert [each.name for each in case.machine.outputs] == ["i1", "i2"]


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ('unit = "rpm"', 'unit = "m/s"', "joint 'shoulder' is in rad/s"),
        ('{ joint = "elbow", columns = ["v2"]', '{ joint = "wrist", columns = ["v2"]',
         "there are: shoulder"),
        ('{ joint = "elbow", columns = ["v2"]', '{ joint = "shoulder", columns = ["v2"]', "measured already"),
        ('    { joint = "elbow", columns = ["q2"], unit = "deg" },\n', "", "whose angle no column has"),
    ],
)  # fmt: skip
def test_a_wrong_description_is_refused(tmp_path, before, after, says):
    path = EXAMPLE.write(tmp_path)
    assert before in EXAMPLE.toml
    path.write_text(EXAMPLE.toml.replace(before, after))
    with pytest.raises(SerpentError, match=says):
        open_machine(path)


@pytest.mark.slow
def test_friction_is_named_by_rates_that_are_logged(tmp_path):
    def friction(q, v, a):
        return np.c_[0 * v[:, 0], 0.1 * np.sign(v[:, 1])]

    found = EXAMPLE.traced(tmp_path, 3, more=friction)
    assert_named_alone(found, "hinge_friction@elbow", "coulomb", 0.1)
