"""A link that a winch pulls by an elastic cable: its motion, what drives the winch, and where it begins."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.from_sites import placed_joints, site_column
from serpent_twin.machines.model.known_motion import LAG, KnownMotion
from serpent_twin.residual.joint_attribution import joint_jacobian

RADIUS, STIFFNESS, INERTIA, DAMPING, FRICTION = 0.02, 2000.0, 4e-3, 2e-2, 0.01
FLAP, HELD = 0.05, 0.004  # [N m/rad], [N m]
ROTOR, VISCOUS = 2e-3, 0.05  # [kg m²], [N m s/rad] of the winch
LAGS, PERIOD = 0.06, 0.25  # [s]
MJCF = f"""<mujoco>
  <option timestep="0.001" gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <site name="base" pos="0.3 0 0" quat="0.7071067811865476 0 0.7071067811865476 0"/>
    <body name="horn" pos="0 0.5 0">
      <inertial pos="0 0 0" mass="0.01" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="winch" axis="0 1 0" armature="{ROTOR}"
             frictionloss="{FRICTION}" damping="{VISCOUS}"/>
    </body>
    <body name="link">
      <inertial pos="0 0 0" mass="0.1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>
      <joint name="hinge" axis="0 1 0" damping="{DAMPING}"/>
      <site name="end" pos="0.2 0 0"/>
      <body name="flap">
        <inertial pos="0 0 0" mass="1e-4" diaginertia="2e-6 2e-6 2e-6"/>
        <joint name="flap" axis="0 1 0" stiffness="{FLAP}" springref="20" frictionloss="{HELD}"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="cable" stiffness="{STIFFNESS}">
      <joint joint="winch" coef="{RADIUS}"/><joint joint="hinge" coef="-{RADIUS}"/>
    </fixed>
  </tendon>
  <actuator><motor joint="winch"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "winch.xml"
rows = "motion"
start = 0.5
time = { column = "t", unit = "s" }
drive = [{ joint = "winch", column = "wound", velocity = "speed", unit = "rad", exact = true }]

[[measured]]
site = "end"
frame = "base"
columns = ["x", "y", "z"]
unit = "mm"
noise = 0.01

[[measured]]
joint = "winch"
columns = ["torque"]
unit = "mN m"
noise = 0.01
"""


def motion(seed=3, rows=80):
    """Velocities that are commanded once a row and taken up with a lag: times, angles, velocities, and the
    angle in between.
    """
    commanded = np.random.default_rng(seed).uniform(-1, 1, rows)
    time, at, speed = PERIOD * np.arange(rows), [0.0], [0.0]
    pieces = []
    for v in commanded[:-1]:
        x, old = at[-1], speed[-1]
        pieces.append(
            lambda t, x=x, v=v, old=old: x + v * t + (old - v) * LAGS * (1 - np.exp(-t / LAGS))
        )
        at.append(float(pieces[-1](PERIOD)))
        speed.append(v + (old - v) * np.exp(-PERIOD / LAGS))

    def between(t):
        row = min(int(t / PERIOD), rows - 2)
        return pieces[row](t - PERIOD * row)

    return time, np.array(at), np.array(speed), between


def swung(time, between):
    """The hinge's angle at some times, by another integrator: I q̈ = −d q̇ + r² k (m − q)."""

    def slope(t, state):
        pull = RADIUS**2 * STIFFNESS * (between(t) - state[0])
        return [state[1], (pull - DAMPING * state[1]) / INERTIA]

    ends = (0.0, time[-1])
    return solve_ivp(slope, ends, [0.0, 0.0], t_eval=time, max_step=PERIOD / 50, rtol=1e-9).y[0]


@pytest.fixture(scope="module")
def winch(tmp_path_factory):
    """The machine, its session, and what it does."""
    folder = tmp_path_factory.mktemp("winch")
    (folder / "winch.xml").write_text(MJCF)
    (folder / "machine.toml").write_text(TOML)
    time, at, speed, between = motion()
    angle = swung(time, between)
    world = 200 * np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1) - [300, 0, 0]
    seen = np.stack([-world[:, 2], world[:, 1], world[:, 0]], axis=1)  # base: x down
    left = np.exp(-PERIOD / LAGS)  # of a change of velocity in the next row
    faster = np.r_[0.0, np.diff(speed)] / (1 - left) * left / LAGS
    moves = FRICTION * np.tanh(speed / 0.0167) + VISCOUS * speed + ROTOR * faster
    torque = 1e3 * (RADIUS**2 * STIFFNESS * (at - angle) + moves)
    table = np.c_[time, at, speed, seen, torque]
    np.savetxt(
        folder / "log.csv", table, "%.9f", ",", header="t,wound,speed,x,y,z,torque", comments=""
    )
    rig = open_machine(folder / "machine.toml")
    return rig, rig.read(folder / "log.csv"), angle


def test_sites_place_the_joints_that_move_them(winch):
    rig, (run,), angle = winch
    assert placed_joints(rig.described) == ("hinge",)
    assert run.columns[site_column("hinge")] == pytest.approx(angle, abs=1e-6)


def test_a_comparison_has_the_hinges_that_sites_place(winch):
    """Angle, axis and motion by a rotation are in the frame of the measured sites, which points elsewhere."""
    rig, sessions, _ = winch
    case = rig.open(sessions)
    seen = case.compare(None, case.pieces(sessions))
    place = seen.marker_predicted[:, :, 0]
    assert seen.joint_names == ("hinge",) and seen.carries.tolist() == [[True]]
    angle = np.arctan2(place[..., 0], place[..., 2] + 0.3)
    assert seen.joint_angle[..., 0] == pytest.approx(angle, abs=1e-6)
    np.testing.assert_allclose(seen.joint_anchor - [0.0, 0.0, -0.3], 0.0, atol=1e-9)
    np.testing.assert_allclose(seen.joint_axis - [0.0, 1.0, 0.0], 0.0, atol=1e-9)
    moved = 0.2 * np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=-1)
    assert joint_jacobian(seen)[:, :, 0, :, 0] == pytest.approx(moved, abs=1e-5)


def test_the_lag_with_which_velocities_are_taken_up_is_in_the_log(winch):
    _, (run,), _ = winch
    assert run.columns[LAG][0] * PERIOD == pytest.approx(LAGS, rel=1e-3)


def test_between_rows_a_motion_takes_up_its_velocity(winch):
    rig, _, _ = winch
    _, at, speed, between = motion(rows=12)
    known = KnownMotion(
        rig.described,
        at[None, :, None],
        PERIOD * speed[None, :, None],
        np.array([LAGS / PERIOD]),
        np.zeros(1),
    )
    times = np.linspace(0, 10.9, 57)
    expected = [between(PERIOD * t) for t in times]
    assert known.path(times)[0, :, 0] == pytest.approx(expected, abs=1e-9)


def test_link_and_torque_agree_with_another_integrator(winch):
    """The cable's pull on the winch and its friction, after the rows in which a start is forgotten. While the
    winch stands, its friction may be anything, and its torque does not count.
    """
    rig, sessions, _ = winch
    case = rig.open(sessions)
    pieces = case.pieces(sessions)
    found = case.machine.respond([ParameterVector.nominal(case.declared)], pieces)[0]
    off = (found - pieces.measured)[0, 15:]
    assert np.abs(off[:, :3]).max() < 0.5e-3
    torque, counts = pieces.measured[0, 15:, 3], np.isfinite(off[:, 3])
    assert 0.5 < counts.mean() < 1
    assert np.abs(off[counts, 3]).max() < 0.02 * np.ptp(torque[counts])


def test_what_nothing_measures_begins_at_rest_where_friction_holds_it(winch):
    rig, sessions, _ = winch
    case = rig.open(sessions)
    driven = case.machine._in_motion([ParameterVector.nominal(case.declared)])
    states = driven.motion(case.pieces(sessions)).recorded()
    flap = rig.described.model.joint("flap").qposadr[0]
    assert states.pose[0, 0, flap] == pytest.approx(np.radians(20) - HELD / FLAP, abs=1e-6)


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        ('frame = "base"', 'frame = "end"', "measured[0].frame is 'end', which moves"),
        ('frame = "base"', 'frame = "bas"', "measured[0].frame is 'bas', which the model lacks"),
        ('joint = "winch"\ncolumns', 'joint = "hinge"\ncolumns', "measured[1].unit is 'mN m'"),
        ('"mN m"', '"deg"', "measured[1].joint is 'winch', whose motion a drive prescribes"),
        (
            'joint = "winch"\ncolumns',
            'joint = "winch"\nframe = "base"\ncolumns',
            "measured[1].frame is of a site",
        ),
    ],
)
def test_what_cannot_be_is_refused_by_line_and_key(tmp_path, before, after, wanted):
    (tmp_path / "winch.xml").write_text(MJCF)
    (tmp_path / "machine.toml").write_text(TOML.replace(before, after))
    with pytest.raises(SerpentError) as error:
        open_machine(tmp_path / "machine.toml")
    assert wanted in str(error.value) and "line " in str(error.value)


def test_what_a_cable_bears_is_what_its_link_rests_by(tmp_path):
    """A spring holds the link against the winch. A site three centimetres from where the model has it
    turns the link by as much as would stretch the cable by 6 N.
    """
    spring, time, at = 0.4, *motion(rows=160)[:2]
    link = RADIUS**2 * STIFFNESS * at / (RADIUS**2 * STIFFNESS + spring)
    place = 203 * np.stack([np.cos(link), 0 * link, -np.sin(link)], axis=1) - [300, 0, 0]
    place += np.outer(np.ones(160), [0.0, 0.0, -30.0])
    seen = np.c_[-place[:, 2], place[:, 1], place[:, 0]]
    table = np.c_[time, at, np.gradient(at, time), seen, 1e3 * spring * link]
    mjcf = MJCF.replace('damping="0.02"/>', f'damping="0.02" stiffness="{spring}"/>')
    (tmp_path / "winch.xml").write_text(mjcf)
    (tmp_path / "machine.toml").write_text(TOML)
    names = "t,wound,speed,x,y,z,torque"
    np.savetxt(tmp_path / "log.csv", table, "%.9f", ",", header=names, comments="")
    rig = open_machine(tmp_path / "machine.toml")
    case = rig.open(rig.read(tmp_path / "log.csv"))
    most = case.candidates["clamp_slip@cable"].ranges["grip"].high
    assert most == pytest.approx((spring * link / RADIUS).max(), rel=0.02)
