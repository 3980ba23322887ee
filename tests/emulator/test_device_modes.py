"""Test what servos do in their operating modes, as the manual has it."""

import numpy as np
import pytest
from sdk_client import OK, RANGE, RESULT_FAIL

from serpent_twin.emulator.device_options import DeviceOptions, build
from serpent_twin.hardware.control_table import TABLE

UNIT = 0.229 / 60 * 4096  # [counts/s] of a word of velocity
TRAPEZOIDAL, ONGOING, ARRIVED = 0b110000, 0b10, 0b01


class Bench:
    """A servo without the arm, in process, and time that passes when it is told to."""

    def __init__(self):
        self.servos = build(DeviceOptions(lockstep=True, count=1)).servos

    def write(self, **words):
        """The last error."""
        error = OK
        for name, value in words.items():
            item = TABLE[name]
            error = self.servos.write(0, item.address, item.pack(value))
        return error

    def read(self, name):
        self.servos.refresh()
        return self.servos.table[0][name]

    def run(self, seconds):
        """Positions and velocities of the trajectory and of the motor, every 0.1 s, by name."""
        names = (
            "position_trajectory",
            "velocity_trajectory",
            "present_position",
            "present_velocity",
        )
        rows = []
        for _ in range(round(seconds / 0.1)):
            self.servos.advance(0.1)
            rows.append([self.read(name) for name in names])
        return dict(zip(names, np.array(rows).T, strict=True))


@pytest.fixture
def bench():
    return Bench()


@pytest.mark.parametrize("rise", [0, 400])
def test_a_time_based_profile_takes_the_milliseconds_of_profile_velocity(bench, rise):
    bench.write(drive_mode=4, operating_mode=4, torque_enable=1)
    bench.write(profile_acceleration=rise, profile_velocity=2000, goal_position=2348)
    rows = bench.run(2.5)
    t1, cruise = rise / 1e3, 300 / (2 - rise / 1e3)
    assert rows["position_trajectory"][9] == pytest.approx(
        2198, abs=1
    )  # half-way, after half of it
    assert rows["velocity_trajectory"][9] == pytest.approx(cruise / UNIT, abs=0.51)
    assert rows["position_trajectory"][18] == pytest.approx(
        2348 - cruise * (0.1 if not t1 else 0.1**2 / 2 / t1), abs=1
    )
    assert (rows["position_trajectory"][20:] == 2348).all()
    assert (rows["velocity_trajectory"][20:] == 0).all()
    assert np.abs(rows["present_position"] - rows["position_trajectory"]).max() <= 6
    assert rows["present_position"][-1] == pytest.approx(2348, abs=2)


def test_a_velocity_based_profile_accelerates_as_the_manual_has_it(bench):
    """t₁ = 64 ms · V/A: 64 · 30 / 4 = 480 ms. Moving Status says what the servo does."""
    bench.write(operating_mode=4, torque_enable=1, profile_acceleration=4, profile_velocity=30)
    bench.write(goal_position=2648)
    assert (bench.read("moving"), bench.read("moving_status")) == (1, TRAPEZOIDAL | ONGOING)
    rows = bench.run(2.5)
    assert rows["velocity_trajectory"][:4] == pytest.approx(
        30 * np.arange(1, 5) * 0.1 / 0.48, abs=1
    )
    assert rows["velocity_trajectory"][7] == 30
    ends = 600 / (30 * UNIT) + 0.48
    done = np.arange(1, 26) * 0.1 > ends
    assert (rows["position_trajectory"][done] == 2648).all()
    assert (rows["position_trajectory"][~done] < 2648).all()
    assert (bench.read("moving"), bench.read("moving_status")) == (0, TRAPEZOIDAL | ARRIVED)


def test_a_new_goal_under_way_keeps_the_velocity(bench):
    bench.write(operating_mode=4, torque_enable=1, profile_acceleration=4, profile_velocity=30)
    bench.write(goal_position=2648)
    bench.run(1.0)
    before = bench.read("position_trajectory"), bench.read("velocity_trajectory")
    bench.write(goal_position=2048)
    assert (bench.read("position_trajectory"), bench.read("velocity_trajectory")) == before
    rows = bench.run(4.0)
    assert np.diff(rows["velocity_trajectory"]).min() >= -30 * 0.1 / 0.48 - 1
    assert rows["present_position"][-1] == pytest.approx(2048, abs=2)


@pytest.mark.parametrize(("drive_mode", "slope"), [(0, 100 / 0.64), (4, 100 / 0.01)])
def test_velocity_mode_ramps_by_profile_acceleration(bench, drive_mode, slope):
    """Velocity-based 10 · 214.577 rev/min² is 100 words in 0.64 s; time-based it is 10 ms."""
    bench.write(drive_mode=drive_mode, operating_mode=1, torque_enable=1, profile_acceleration=10)
    bench.write(goal_velocity=100)
    rows = bench.run(1.0)
    wanted = np.minimum(100, slope * np.arange(1, 11) * 0.1)
    assert rows["velocity_trajectory"] == pytest.approx(
        wanted, abs=0.02 * slope + 1 if slope < 200 else 0
    )
    assert rows["present_velocity"][-1] == pytest.approx(100, abs=2)


def test_time_based_profiles_have_a_longest_time(bench):
    assert bench.write(profile_velocity=32_767) == OK
    assert bench.write(drive_mode=4, profile_velocity=32_738) == RANGE
    assert bench.write(profile_acceleration=32_737) == OK


@pytest.mark.parametrize("goal", [300, -300])
def test_pwm_mode_applies_a_voltage(bench, goal):
    """No-load speed 61 rpm at full voltage, less friction."""
    bench.write(operating_mode=16)
    assert bench.read("goal_pwm") == 885  # Operating Mode (11) resets it to PWM Limit (36)
    bench.write(torque_enable=1)
    assert bench.read("goal_pwm") == 0
    bench.run(0.5)
    assert bench.read("present_velocity") == 0
    bench.write(goal_pwm=goal)
    bench.run(0.3)
    assert bench.read("present_pwm") == pytest.approx(goal, abs=1)
    speed = bench.read("present_velocity") * 0.229
    assert 0.4 < speed / (61 * goal / 885) < 1
    bench.write(goal_pwm=0)
    bench.run(0.3)
    assert bench.read("present_velocity") == 0
    assert bench.read("velocity_trajectory") == 0


def test_goal_pwm_and_its_limit_bound_the_voltage_in_other_modes(bench):
    bench.write(pwm_limit=400, operating_mode=1, torque_enable=1, goal_velocity=265)
    bench.run(0.4)
    assert bench.read("present_pwm") == pytest.approx(400, abs=1)
    bench.write(goal_pwm=0)
    bench.run(0.4)
    assert bench.read("present_pwm") == 0
    assert bench.read("present_velocity") == 0


def test_clear_takes_the_goal_along(bench):
    """Otherwise the motor would turn back by a turn."""
    bench.write(operating_mode=4, torque_enable=1, goal_position=-100)
    bench.run(2.0)
    assert bench.read("present_position") == pytest.approx(-100, abs=1)
    assert bench.servos.clear_turns(0) == OK
    assert bench.read("goal_position") == 3996
    rows = bench.run(1.0)
    assert rows["present_position"] == pytest.approx([3996] * 10, abs=1)
    bench.write(profile_velocity=10, goal_position=3000)
    assert bench.servos.clear_turns(0) == RESULT_FAIL  # in progress


@pytest.mark.parametrize(
    ("mode", "offset", "reads"),
    [(3, 1024, 3072), (3, -1024, 1024), (3, 1025, 2048), (3, -2000, 2048), (4, 2000, 4048)],
)
def test_position_mode_ignores_a_homing_offset_of_more_than_a_quarter_turn(
    bench, mode, offset, reads
):
    bench.write(operating_mode=mode, homing_offset=offset)
    assert bench.read("present_position") == reads
    bench.write(operating_mode=1)
    assert bench.read("present_position") == 2048 + offset


def test_a_change_of_mode_puts_gains_profile_and_goal_pwm_back(bench):
    gains = [name for name in TABLE if name.endswith("_gain")]
    assert len(gains) == 7
    changed = dict.fromkeys(gains, 300) | {"profile_velocity": 9, "profile_acceleration": 9}
    bench.write(**changed, goal_pwm=100, pwm_limit=500)
    bench.write(operating_mode=3)  # the mode it is in
    assert all(bench.read(name) == value for name, value in changed.items())
    bench.write(operating_mode=1)
    assert all(bench.read(name) == TABLE[name].default for name in changed)
    assert bench.read("goal_pwm") == 500


def test_without_a_position_gain_nothing_moves(bench):
    bench.write(position_p_gain=0, torque_enable=1, profile_velocity=30, goal_position=2500)
    assert (bench.run(1.0)["present_position"] == 2048).all()
