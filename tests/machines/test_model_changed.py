"""Test that what was changed about a machine is found from its twin of before, drives' zeros aside."""

import json

import numpy as np
import pytest
from example import Example, table
from scipy.integrate import solve_ivp

from serpent_twin.errors import SerpentError
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine

GRAVITY, MASS, LENGTH, INERTIA = (
    9.81,
    0.4,
    0.3,
    0.01,
)  # [m/s²], [kg] at the end of a rod, [m], [kg m²]
GAIN, DAMPING, RATE, SECONDS = 12.0, 0.6, 50.0, 8.0
MJCF = f"""<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body name="rod">
    <joint name="hinge" axis="0 -1 0" armature="{INERTIA}"/>
    <inertial pos="{LENGTH} 0 0" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/>
    <site name="end" pos="{LENGTH} 0 0"/>
  </body></worldbody>
  <actuator><position name="servo" joint="hinge" kp="{GAIN}" kv="{DAMPING}" ctrlrange="-2 2"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
steps = 8
candidates = ["command_delay"]
changes = ["payload@end", "command_delay"]
time = { column = "t", unit = "s" }
drive = [{ actuator = "servo", column = "goal", unit = "rad" }]
measured = [{ joint = "hinge", columns = ["angle"], unit = "rad", noise = 0.0005 }]
uncertain = [
  { number = "mass", of = ["rod"] },
  { number = "armature", of = [] },
  { number = "actuator gain", of = [] },
  { number = "actuator damping", of = [] },
]
"""
DELAY, LOAD, MOVED = 0.06, 0.09, 0.02  # [s], [kg], [rad]


def log(path, load=0.0, zero=0.0, seed=0):
    """A rod on a servo that obeys late, by its equation of motion."""
    rng, time = np.random.default_rng(seed), np.arange(0, SECONDS, 1 / RATE)
    knots = rng.uniform(-0.6, 0.6, 12)
    goal = np.interp(time, np.linspace(0, SECONDS, 12), knots)
    mass = MASS + load

    def change(t, state):
        angle, rate = state
        told = goal[int(np.clip((t - DELAY) * RATE + 1e-6, 0, len(goal) - 1))] + zero
        force = GAIN * (told - angle) - DAMPING * rate - mass * GRAVITY * LENGTH * np.cos(angle)
        return rate, force / (INERTIA + mass * LENGTH**2)

    begin = [goal[0] - 0.1, 0.0]
    found = solve_ivp(change, (0, SECONDS), begin, t_eval=time, max_step=0.004, rtol=1e-7)
    seen = found.y[0] + 5e-4 * rng.standard_normal(len(time))
    return table(path, "t,goal,angle", np.c_[time, goal, seen])


def found(case, runs, start):
    """A fit of all that is free."""
    pieces = case.pieces(runs)
    case = case.reweighted(start, pieces)
    return fit(case, pieces, start, free_parameters(case, list(start.effects)), 2, 40)


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """A machine that obeys late, and the twin.json of a fit to its log."""
    folder = tmp_path_factory.mktemp("changed")
    rig = open_machine(Example(MJCF, TOML).write(folder))
    runs = rig.read(log(folder / "bare.csv"))
    case = rig.open(runs)
    start = ParameterVector.nominal(case.declared, {"command_delay": np.array([0.04])})
    fitted = found(case, runs, start)
    case.write(fitted.point, folder / "twin.json", {"error": 0.5})
    return rig, folder / "twin.json"


def test_a_load_is_found_and_all_else_is_as_before_but_the_zero(before, tmp_path):
    rig, twin = before
    since = rig.changed(twin)
    runs = since.read(log(tmp_path / "loaded.csv", LOAD, MOVED, seed=1))
    case = since.open(runs)
    assert set(case.candidates) == {"payload@end"}  # it obeys late already
    assert [each.name for each in case.declared] == ["zero of servo"]
    assert case.machine.error_before_change == 0.5
    start = ParameterVector.nominal(case.declared, {"payload@end": np.array([0.03, 0.0])})
    fitted = found(case, runs, start)
    value, low, high = fitted.interval("payload@end", 0)
    assert value == pytest.approx(LOAD, rel=0.1) and low < LOAD < high
    was = json.loads(twin.read_text())["declared"]["zero of servo"]["value"]
    (zero,) = case.quantities
    assert zero.start == pytest.approx(was)
    assert zero.after(fitted.point.declared[0]) - was == pytest.approx(np.degrees(MOVED), abs=0.3)


def test_the_twin_that_is_written_is_whole(before, tmp_path):
    """It has the numbers and effects of before, and predicts as the changed machine does."""
    rig, twin = before
    since = rig.changed(twin)
    case = since.open(runs := since.read(log(tmp_path / "loaded.csv", LOAD, MOVED, seed=1)))
    point = ParameterVector(np.array([0.7]), {"payload@end": np.array([LOAD, 0.0])})
    case.write(point, tmp_path / "twin.json", {})
    was, now = (json.loads(path.read_text()) for path in (twin, tmp_path / "twin.json"))
    assert now["declared"].keys() == was["declared"].keys() and len(now["effects"]) == 2
    moved = {n for n in was["declared"] if was["declared"][n] != now["declared"][n]}
    assert moved == {"zero of servo"}
    again = rig.changed(tmp_path / "twin.json").open(runs)
    pieces = case.pieces(runs)
    nominal = ParameterVector.nominal(again.declared)
    one, other = again.machine.respond([nominal], pieces), case.machine.respond([point], pieces)
    after = slice(25, None)  # starts are improved by the gains of another nominal twin
    np.testing.assert_allclose(one[:, :, after], other[:, :, after], atol=2e-4)
    assert not again.candidates


def test_a_twin_of_another_machine_is_refused(before, tmp_path):
    rig, twin = before
    runs = rig.read(log(tmp_path / "log.csv"))
    other = tmp_path / "twin.json"
    about = json.loads(twin.read_text())
    other.write_text(json.dumps(about | {"kind": "jaw"}))
    with pytest.raises(SerpentError, match='kind is the text "jaw"; it must be'):
        rig.changed(other).open(runs)
    declared = {n: of for n, of in about["declared"].items() if n != "zero of servo"}
    other.write_text(json.dumps(about | {"declared": declared}))
    with pytest.raises(SerpentError, match=r"lacks .*zero of servo"):
        rig.changed(other).open(runs)
