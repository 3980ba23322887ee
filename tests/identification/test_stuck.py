"""Test that a joint that stands still where the twin's turns is found, and others are not."""

from types import SimpleNamespace

import numpy as np
import pytest

from serpent_twin.identification.discovery.stuck import STANDS, held_by_friction, stuck
from serpent_twin.machines.places import PlaceResponse, PlacesInRow

S, T, C = 6, 160, 5
NOISE = 0.01  # [rad]
LOW, HIGH = 0.1, 0.3  # [rad]
RNG = np.random.default_rng(0)
TIME = np.tile(0.25 * np.arange(T), (S, 1))
TWIN = 0.4 * np.sin(0.6 * TIME + RNG.uniform(0, 6, (S, 1)))


def seen(true):
    """Two joints' measured angles; the first one's true ones are given."""
    noise = NOISE * RNG.standard_normal((2, S, T))
    readings = {
        ("joint_angle", "joint1"): true + noise[0],
        ("joint_angle", "joint2"): TWIN + noise[1],
        ("time", "session"): TIME,
    }
    shows = RNG.standard_normal((2, 1, S, T, C))
    torques = [
        PlaceResponse("joint_torque", f"joint{n}", change) for n, change in enumerate(shows, 1)
    ]
    places = PlacesInRow(readings, torques, twin_angles={"joint1": TWIN, "joint2": TWIN})
    case = SimpleNamespace(
        noise=np.ones(C), take=lambda pieces, used: pieces, places=lambda point, pieces: places
    )
    missing = np.where((true > LOW) & (true < HIGH), 0.03, 0.0)  # [N m]
    residual = (-missing[..., None] * shows[0, 0]).reshape(S, -1)
    fit = SimpleNamespace(point=None, used=(), residual=residual)
    return case, SimpleNamespace(measured=np.zeros((S, T, C))), fit, places


def sticking(held=4.0):
    """A joint that is held where it enters a window, for so long [s]."""
    out, rows = TWIN.copy(), round(held / 0.25)
    for s in range(S):
        t = 1
        while t < T:
            entered = LOW < out[s, t] < HIGH and not LOW < out[s, t - 1] < HIGH
            if entered:
                out[s, t : t + rows] = out[s, t]
                t += rows
            t += 1
    return out


def test_a_joint_that_sticks_is_found_where_it_does_and_told():
    case, pieces, fit, places = seen(sticking())
    (found,) = stuck(case, pieces, fit)
    assert found.joint == "joint1" and found.worth > STANDS
    assert LOW - 0.1 < found.low < 0.2 < found.high < HIGH + 0.1
    assert found.told.startswith("joint1 often stands still between 0.")
    (law,) = held_by_friction(case, pieces, fit, places)
    assert str(law.law) == "joint_friction of joint1: within joint_angle of joint1"
    assert (law.first, law.second) == pytest.approx((found.low, found.high - found.low))
    assert law.size == pytest.approx([0.03])


@pytest.mark.parametrize(
    "off", [0.0, 0.1, 0.1 * np.sin(0.9 * TIME)], ids=["right", "shifted", "moved"]
)
def test_one_that_moves_is_not(off):
    """Nor one that the twin puts elsewhere."""
    assert not stuck(*seen(TWIN + off)[:3])


def test_a_machine_in_its_measured_pose_has_none():
    case, pieces, fit, _ = seen(sticking())
    case.places = lambda point, pieces: None
    assert not stuck(case, pieces, fit)
