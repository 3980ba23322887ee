"""Test that commands and readings that share a wrong unit are refused, and large motions are not."""

import numpy as np
import pytest
import swung_models
from scipy.integrate import solve_ivp
from swung_models import DAMPING, GAIN, LENGTH, MASS

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine

FREE = swung_models.MJCF.replace(' range="-120 120"', "").replace(' ctrlrange="-1 1"', "")
LEVEL = FREE.replace("0 0 -0.25", "0.25 0 0")
INERTIA = MASS * LENGTH**2 + 2 / 5 * MASS * 0.01**2
WEIGHTLESS = FREE.replace("<option ", '<option gravity="0 0 0" ')


def opened(folder, mjcf, unit, times=1.0):
    """A machine whose log has goals and angles in degrees, so many times as large, stated in a unit."""
    toml = swung_models.TOML.replace('"goal_deg", unit = "deg"', f'"goal_deg", unit = "{unit}"')
    toml = toml.replace('["angle"], unit = "rad", noise = 0.0005', f'["angle"], unit = "{unit}"')
    path = swung_models.machine(folder)
    path.write_text(toml)
    path.with_name("lever.xml").write_text(mjcf)
    time = np.arange(0, 12, 0.04)
    goals = 0.5 * np.sin(1.6 * time)
    weight = 0.0 if "gravity" in mjcf else MASS * 9.81 * LENGTH

    def rates(t, state):
        angle, rate = state
        servo = GAIN * (goals[min(int(t / 0.04 + 1e-9), 299)] - angle) - DAMPING * rate
        pulls = weight * (np.cos(angle) if mjcf == LEVEL else -np.sin(angle))
        return [rate, (servo + pulls) / INERTIA]

    start = 0.18 if mjcf == LEVEL else 0.0
    found = solve_ivp(rates, (0, 12), [start, 0], t_eval=time, rtol=1e-8, max_step=0.01)
    noise = 5e-4 * np.random.default_rng(0).standard_normal(len(time))
    columns = np.degrees([-goals, found.y[0] + noise]) * times
    rows = np.c_[1000 * time, columns.T]
    text = "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows)
    (folder / "log.csv").write_text(f"t_ms,goal_deg,angle\n{text}\n")
    rig = open_machine(path)
    return rig.open(rig.read(folder / "log.csv"))


def test_the_right_unit_is_taken(tmp_path):
    assert opened(tmp_path, FREE, "deg")


def test_degrees_that_are_stated_as_radians_are_refused_where_the_lever_weighs(tmp_path):
    with pytest.raises(SerpentError, match=r"'goal_deg' and 'angle'.* in rad move the joint pivot"):
        opened(tmp_path, FREE, "rad")


def test_radians_that_are_stated_as_degrees_are_refused_by_how_the_lever_sags(tmp_path):
    """A level lever sags by 0.18 rad; one that hangs is linear, and shows no unit."""
    assert opened(tmp_path / "hanging", FREE, "deg", 1 / np.degrees(1.0))
    with pytest.raises(SerpentError, match=r"much better if all of them were in rad, not deg"):
        opened(tmp_path, LEVEL, "deg", 1 / np.degrees(1.0))


def test_a_servo_without_load_that_would_turn_many_times_is_asked_for_its_range(tmp_path):
    """Nothing but the size of its motion tells its unit; a range that the model has is believed."""
    with pytest.raises(SerpentError, match=r"or give the joint a range in the model"):
        opened(tmp_path, WEIGHTLESS, "rad")
    wide = WEIGHTLESS.replace('damping="0.12"', 'damping="0.12" range="-2000 2000"')
    assert opened(tmp_path / "wide", wide, "rad")
