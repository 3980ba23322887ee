"""Test how noise is told from motion: by what is left where a twin follows quick motions."""

import numpy as np
import pytest

from serpent_twin.machines.machine import Output
from serpent_twin.machines.model.description import MeasuredColumns
from serpent_twin.machines.model.noise import quieter
from serpent_twin.residual import ANGLE, POSITION

S, T = 4, 120
RNG = np.random.default_rng(3)
SITES = [
    MeasuredColumns(columns=tuple(f"{name}_{axis}" for axis in "xyz"), unit="m", site=name)
    for name in ("near", "far")
]
ELBOW = MeasuredColumns(columns=("elbow",), unit="rad", joint="elbow")


def outputs(several, taken):
    """The channels of what is measured, all taken to be so noisy."""
    return tuple(
        Output(name, POSITION if each.site else ANGLE, taken)
        for each in several
        for name in each.columns
    )


def test_sites_of_the_same_cameras_have_the_noise_of_the_least_noisy():
    """The far one swings by what its twin does not follow; noise is 0.1, 0.2 and 0.3 mm along the axes."""
    noise = 1e-4 * np.array([1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 20.0])
    off = noise * RNG.standard_normal((S, T, 7))
    off[..., 3:6] += 5e-3 * RNG.standard_normal((S, T, 1))
    several = [*SITES, ELBOW]
    seen = off + np.linspace(0, 0.2, T)[:, None]
    found = np.array([each.noise for each in quieter(several, outputs(several, 1.0), seen, off)])
    assert found[:3] == pytest.approx(noise[:3], rel=0.25)
    assert (found[3:6] == found[:3]).all()
    assert found[6] == pytest.approx(2e-3, rel=0.25)


def test_noise_is_never_more_than_it_was_taken_for_and_stays_where_it_is_stated():
    off = 1e-3 * RNG.standard_normal((S, T, 1))
    told = [MeasuredColumns(columns=("elbow",), unit="rad", joint="elbow", noise=0.5)]
    assert quieter(told, outputs(told, 0.5), off, off)[0].noise == 0.5
    assert quieter([ELBOW], outputs([ELBOW], 1e-4), off, off)[0].noise == 1e-4
    few = off[:, :3]
    assert quieter([ELBOW], outputs([ELBOW], 0.5), few, few)[0].noise == 0.5
