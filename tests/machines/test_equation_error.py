"""Test what rows of a motion say without simulation, on a pendulum whose accelerations are known."""

from dataclasses import replace

import numpy as np
import pytest
from example import Example
from msgspec.structs import replace as replaced
from scipy.integrate import solve_ivp

from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.in_rows import in_rows
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.description import MeasuredColumns
from serpent_twin.machines.model.equation_error import says_accelerations
from serpent_twin.machines.model.starts import angle_of, rate_of

MASS, LENGTH, ROTOR, DAMPING = 0.5, 0.2, 0.004, 0.02  # [kg], [m], [kg m²], [N m s/rad]
STIFFNESS, BRAKES, GRAVITY = 8.0, 0.3, 9.81  # [N m/rad], [N m s/rad], [m/s²]
INERTIA = MASS * LENGTH**2 + ROTOR
NOISE, RATE, SECONDS = 5e-4, 100.0, 15.0  # [rad], [Hz], [s]
PENDULUM = f"""<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 -{GRAVITY}"/>
  <worldbody><body name="bob">
    <joint name="hinge" axis="0 1 0" damping="{DAMPING}" armature="{ROTOR}"/>
    <inertial pos="0 0 -{LENGTH}" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/>
    <geom size="0.01" contype="0" conaffinity="0"/>
    <site name="tip" pos="0 0 -{LENGTH}"/>
  </body></worldbody>
  <actuator><position name="servo" joint="hinge" kp="{STIFFNESS}" kv="{BRAKES}"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "pendulum.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [{ actuator = "servo", column = "goal", unit = "rad" }]
measured = [{ joint = "hinge", columns = ["angle"], unit = "rad" }]
"""


def acceleration(angle, rate, goal, friction=0.0):
    """Closed form [rad/s²]."""
    drive = STIFFNESS * (goal - angle) - (BRAKES + DAMPING) * rate - friction * np.tanh(rate / 1e-3)
    return (drive - MASS * GRAVITY * LENGTH * np.sin(angle)) / INERTIA


def goal_at(time, seed):
    rng = np.random.default_rng(seed)
    waves = zip(rng.uniform(0.1, 1.2, 4), rng.uniform(0, 6, 4), strict=True)
    return 0.25 * sum(np.sin(2 * np.pi * hz * time + phase) for hz, phase in waves)


def write_logs(folder, late=0.0, friction=0.0):
    """Two sessions by scipy, of goals that are held from row to row and come late."""
    Example(PENDULUM, TOML).write(folder)
    (folder / "logs").mkdir()
    for seed in range(2):
        time = np.arange(0.0, SECONDS, 1 / RATE)
        goals = goal_at(time, seed)

        def rates(t, y, goals=goals):
            row = int(np.clip(np.floor((t - late) * RATE + 1e-9), 0, len(goals) - 1))
            return [y[1], acceleration(*y, goals[row], friction)]

        begun = [goals[0], 0.0]
        found = solve_ivp(rates, (0, time[-1]), begun, t_eval=time, max_step=0.005, rtol=1e-5)
        read = found.y[0] + NOISE * np.random.default_rng(100 + seed).standard_normal(len(time))
        rows = "\n".join(
            f"{t:.4f},{u:.9f},{x:.9f}" for t, u, x in zip(time, goals, read, strict=True)
        )
        (folder / "logs" / f"run_{seed}.csv").write_text(f"t,goal,angle\n{rows}\n")


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """The machine with logs of the model as it is."""
    folder = tmp_path_factory.mktemp("exact")
    write_logs(folder)
    return folder


def opened(folder):
    """The case of a motion, that of its rows, and the sessions."""
    rig = open_machine(folder / "machine.toml")
    runs = rig.read(folder / "logs")
    case = rig.open(runs)
    return case, rig.in_rows(case, runs), runs


def leaders(folder):
    """What rows say is missing: the likeliest of each, with all that it may be in its place."""
    _, rows, runs = opened(folder)
    notes = Checkpoints(folder / "stages", rows.clock)
    told = in_rows(rows, runs, notes, lambda _: None)()
    assert {*told.scores} <= {*rows.candidates}
    return [dict(slot) for slot in told.slots]


def test_rows_say_accelerations_in_closed_form(exact):
    """Every row by itself: the state that was read, and the mean of the goals before and after it; then the
    same weights of rows as for the readings.
    """
    _, rows, runs = opened(exact)
    pieces = rows.pieces(runs)
    nominal = ParameterVector.nominal(rows.declared)
    found = rows.machine.respond([nominal], pieces)[0, ..., 0] * rows.machine.usual[0]
    angle, rate, goal = (
        pieces.column[name] for name in (angle_of("hinge"), rate_of("hinge"), "goal")
    )
    mean = (goal[:, :-1] + goal[:, 1:]) / 2
    weights = rows.machine.filter
    of_rows = np.lib.stride_tricks.sliding_window_view(
        acceleration(angle[:, 1:], rate[:, 1:], mean), len(weights), axis=1
    )
    aside = len(weights) // 2
    inside = found[:, 1 + aside : found.shape[1] - aside]
    np.testing.assert_allclose(inside, of_rows @ np.array(weights), rtol=1e-6, atol=1e-6)
    assert np.isnan(pieces.measured[:, :aside]).all() and sum(weights) == pytest.approx(1)


def test_measured_accelerations_are_those_of_the_model_that_made_the_log(exact):
    _, rows, runs = opened(exact)
    pieces = rows.pieces(runs)
    off = (
        pieces.measured - rows.machine.respond([ParameterVector.nominal(rows.declared)], pieces)[0]
    )
    known = np.isfinite(off)
    assert known.mean() > 0.4 and np.sqrt(np.mean(off[known] ** 2)) < 0.05


def test_derivatives_by_numbers_are_those_of_long_steps(exact):
    _, rows, runs = opened(exact)
    pieces, point = rows.pieces(runs), ParameterVector.nominal(rows.declared)
    slopes = rows.machine.derivatives(point, pieces, np.ones(1))
    assert {*slopes} == {each.name for each in rows.declared}
    name = "actuator gain of servo"
    k = [each.name for each in rows.declared].index(name)
    step = 1e-3 * (np.arange(len(rows.declared)) == k)
    ahead, back = rows.machine.respond([point.after(step), point.after(-step)], pieces)
    np.testing.assert_allclose(slopes[name], (ahead - back) / 2e-3, rtol=1e-3, atol=1e-4)


def test_late_goals_and_friction_are_told_apart(tmp_path):
    write_logs(tmp_path, late=0.02, friction=0.1)
    friction, late = leaders(tmp_path)
    assert next(iter(friction)) == "hinge_friction@hinge" and [*late] == ["command_delay"]
    assert friction["hinge_friction@hinge"][0] == pytest.approx(0.1, rel=0.3)
    assert late["command_delay"][0] == pytest.approx(0.02, rel=0.7)


def test_friction_alone(tmp_path):
    write_logs(tmp_path, friction=0.15)
    (only,) = leaders(tmp_path)
    assert only["hinge_friction@hinge"][0] == pytest.approx(0.15, rel=0.05)


def test_nothing_is_missing(exact):
    assert leaders(exact) == []


def test_what_rows_cannot_tell_is_no_candidate(exact):
    """A delay of a reading is no state, and a lag or a bending link adds one."""
    case, rows, _ = opened(exact)
    lacking = {*case.candidates} - {*rows.candidates}
    assert "servo_lag" in lacking and "hinge_friction@hinge" in rows.candidates
    assert all(name.startswith(("servo_lag", "link_flex", "cable_creep")) for name in lacking)


@pytest.mark.parametrize(
    "measured",
    [
        {"site": "tip", "columns": ("x", "y", "z"), "unit": "m"},
        {"joint": "hinge", "columns": ("angle",), "unit": "rad", "ratio": 0.1},
        {"joint": "hinge", "columns": ("angle",), "unit": "rad/s"},
    ],
    ids=["a site", "an uncertain scale", "a velocity"],
)
def test_rows_without_known_angles_say_too_little(tmp_path, measured):
    described = open_machine(Example(PENDULUM, TOML).write(tmp_path)).described
    about = replaced(described.about, measured=(MeasuredColumns(**measured),))
    assert says_accelerations(described)
    assert not says_accelerations(replace(described, about=about))
    assert not says_accelerations(replace(described, about=replaced(described.about, lead=1.0)))
