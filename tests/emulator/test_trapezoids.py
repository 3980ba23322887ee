"""Test a servo's profiles against closed forms of trapezoids."""

import numpy as np
import pytest

from serpent_twin.emulator import profile
from serpent_twin.emulator.profile import ProfileType


def moved(made):
    """Distance by the velocity alone, integrated by the trapezoidal rule, and the greatest velocity."""
    times = np.linspace(0, made.duration, 20_001)
    speed = np.array([made.at(t)[1] for t in times])
    return np.trapezoid(speed, times), np.abs(speed).max()


@pytest.mark.parametrize("sense", [1, -1])
def test_a_trapezoid_from_rest(sense):
    """t₁ = V/A, and t₃ = distance/V + V/A."""
    made = profile.by_velocity(100, 0, 100 + sense * 3000, 500, 1000)
    assert made.shape is ProfileType.TRAPEZOIDAL
    assert made.duration == pytest.approx(3000 / 500 + 500 / 1000)
    assert made.at(0.25) == pytest.approx((100 + sense * 1000 * 0.25**2 / 2, sense * 250))
    assert made.at(made.duration / 2) == pytest.approx((100 + sense * 1500, sense * 500))
    assert made.at(made.duration + 1) == (100 + sense * 3000, 0)


def test_a_triangle_from_rest():
    """It peaks at √(A · distance), after √(distance/A)."""
    made = profile.by_velocity(0, 0, 90, 500, 1000)
    assert made.shape is ProfileType.TRIANGULAR
    assert made.duration == pytest.approx(2 * np.sqrt(90 / 1000))
    assert made.at(0.3)[1] == pytest.approx(np.sqrt(90 * 1000))


@pytest.mark.parametrize("velocity", [-700.0, -300.0, 0.0, 300.0, 700.0])
@pytest.mark.parametrize("goal", [-2000.0, -5.0, 0.0, 40.0, 2000.0])
def test_from_any_velocity_the_goal_is_reached_within_the_limits(velocity, goal):
    made = profile.by_velocity(0, velocity, goal, 500, 1000)
    distance, fastest = moved(made)
    assert made.at(0) == pytest.approx((0, velocity))
    assert distance == pytest.approx(goal, abs=0.05)
    assert fastest <= max(500, abs(velocity)) + 1e-9
    assert all(abs(phase.acceleration) == 1000 for phase in made.phases if phase.acceleration)
    assert all(phase.duration >= 0 for phase in made.phases)
    last = made.phases[-1]
    assert last.after(last.duration)[1] == pytest.approx(0, abs=1e-9)


def test_without_acceleration_it_is_a_rectangle_and_without_velocity_a_step():
    made = profile.by_velocity(0, 0, -300, 100, 0)
    assert (made.shape, made.duration, made.at(1)) == (ProfileType.RECTANGULAR, 3, (-100, -100))
    assert profile.by_velocity(0, 0, 300, 0, 1000).at(0) == (300, 0)
    assert profile.by_time(0, 0, 300, 0, 0.1).at(0) == (300, 0)
    assert profile.by_velocity(7, 0, 7, 100, 0).duration == 0


@pytest.mark.parametrize(
    ("rise", "shape"),
    [
        (0, ProfileType.RECTANGULAR),
        (0.3, ProfileType.TRAPEZOIDAL),
        (1, ProfileType.TRIANGULAR),
        (5, ProfileType.TRIANGULAR),
    ],
)
def test_a_profile_by_time_takes_its_time(rise, shape):
    """It cruises at distance/(t₃ − t₁), where t₁ is at most half of t₃."""
    made = profile.by_time(10, 0, 610, 2, rise)
    assert (made.shape, made.duration) == (shape, pytest.approx(2))
    assert made.at(1)[1] == pytest.approx(600 / (2 - min(rise, 1)))
    assert made.at(1)[0] == pytest.approx(310)
    assert moved(made)[0] == pytest.approx(600, abs=0.1)
    assert made.at(2) == (610, 0)


def test_by_time_the_velocity_is_continuous_after_a_new_goal():
    made = profile.by_time(0, 200, -50, 2, 0.5)
    assert made.at(0) == (0, 200)
    assert moved(made)[0] == pytest.approx(-50, abs=0.05)


def test_a_ramp_of_velocity():
    made = profile.ramp(0, -20, 60, 4)
    assert [made.at(t)[1] for t in (0, 1, 4, 9)] == [-20, 0, 60, 60]
    assert made.at(6)[0] == pytest.approx(20 * 4 + 60 * 2)
    assert profile.ramp(0, 5, 60, 0).at(0)[1] == 60
