"""Test joints and tendons that move as a log says, whatever force that takes."""

from dataclasses import replace

import cabled_models
import mujoco
import numpy as np
import posed_models
import pytest
import swinging_models
from cabled_models import cabled, lines, span
from example import assert_named_alone, table
from posed_models import LENGTHS, MASSES, SPRINGS
from scipy.optimize import minimize
from swinging_models import RATE, SECONDS

from serpent_twin.engine.exact_xml import to_xml
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.drive_table import read_drives, write_calibration
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.reading import read


def opened(path, log, steps=0):
    """The machine, its pieces, and by how much its model is off, (S, T, C)."""
    rig = open_machine(path)
    recordings = rig.read(log)
    case = rig.open(recordings)
    machine = case.machine
    assert isinstance(machine, ModelMachine)
    machine = replace(machine, steps=steps or machine.steps)
    pieces = case.pieces(recordings)
    at = ParameterVector.nominal(case.declared)
    return case, pieces, pieces.measured - machine.respond([at], pieces)[0]


def traced(tmp_path, **how):
    """Trace of three motions, measured so coarsely that few time steps a row are exact enough."""
    toml = swinging_models.TOML.replace("noise = 0.0005", "noise = 0.002")
    return replace(swinging_models.EXAMPLE, toml=toml).traced(tmp_path, 3, noise=2e-3, **how)


def test_the_elbow_swings_as_its_equations_say_where_the_shoulder_is_moved(tmp_path):
    """Errors are first order in the time step: forces of speeds are of those half a step before."""
    path = swinging_models.machine(tmp_path)
    log = swinging_models.log(tmp_path / "log.csv", 0, noise=0.0)
    off = [np.nanmax(np.abs(opened(path, log, steps)[2])) for steps in (32, 128, 512)]
    assert off[1] < 2e-4 and off[2] < 5e-5  # rad, of a swing by 1 rad
    np.testing.assert_allclose(np.divide(off[:2], off[1:]), 4.0, rtol=0.1)


def test_constraints_that_a_model_has_turned_off_stay_off(tmp_path):
    """The elbow's narrow range, and an equality that would hold it."""
    path = swinging_models.machine(tmp_path)
    model, log = path.with_name("arm.xml"), swinging_models.log(tmp_path / "log.csv", 0, noise=0.0)
    straight = '<equality><joint joint1="elbow"/></equality>'
    narrow = model.read_text().replace('name="elbow"', 'name="elbow" range="-100 100"')
    for flag in ("constraint", "equality"):
        off = f'<flag {flag}="disable" limit="disable"/></option>'
        text = narrow.replace('"implicitfast"/>', f'"implicitfast">{off}', 1)
        model.write_text(text.replace("</mujoco>", f"{straight}</mujoco>"))
        assert np.nanmax(np.abs(opened(path, log, 128)[2])) < 2e-4  # rad


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicit", "implicitfast"])
def test_a_joint_moves_as_told_and_its_reaction_is_measured(tmp_path, integrator):
    """Dampers are not what a sensor of the torque between two bodies shows."""
    path = swinging_models.machine(tmp_path)
    model = path.with_name("arm.xml")
    sensors = '<jointpos name="turned" joint="shoulder"/><torque name="held" site="seat"/>'
    model.write_text(
        model.read_text()
        .replace("</mujoco>", f"<sensor>{sensors}</sensor></mujoco>")
        .replace(
            '<geom type="sphere" size="0.01" mass="0.4"', '<site name="seat"/><geom mass="0.4"'
        )
        .replace('<geom mass="0.4"', '<geom type="sphere" size="0.01" mass="0.4"')
        .replace("implicitfast", integrator)
    )
    path.write_text(
        swinging_models.TOML
        + '[[measured]]\nsensor = "turned"\ncolumns = ["again"]\nunit = "rad"\nnoise = 1e-5\n'
        + '[[measured]]\nsensor = "held"\ncolumns = ["mx", "my", "mz"]\nunit = "N m"\nnoise = 1e-3\n'
    )
    log = swinging_models.log(tmp_path / "log.csv", 1, noise=0.0)
    logged = np.genfromtxt(log, delimiter=",", names=True)
    told = swinging_models.turning(np.random.default_rng(1))
    q1, v1, a1 = np.array([told(t) for t in logged["t"]]).T
    q2 = logged["angle"]
    v2, a2 = (np.gradient(q2, 1 / RATE, edge_order=2) for _ in range(2))
    m1, m2, (a, b) = *MASSES, LENGTHS
    c, s, ball = np.cos(q2), np.sin(q2), 2 / 5 * 1e-4
    a2 = np.gradient(v2, 1 / RATE)
    moment = (
        ((m1 + m2) * a**2 + m2 * b**2 + 2 * m2 * a * b * c + ball * (m1 + m2)) * a1
        + (m2 * b**2 + m2 * a * b * c + ball * m2) * a2
        - m2 * a * b * s * (2 * v1 * v2 + v2**2)
        - 9.81 * ((m1 + m2) * a * np.cos(q1) + m2 * b * np.cos(q1 + q2))
    )
    rows = np.c_[logged["t"], q1, q2, q1, 0 * q1, moment, 0 * q1]
    table(log, "t,encoder,angle,again,mx,my,mz", rows, 9)
    _, _, off = opened(path, log, 128)
    inside = off[:, 20:-5]
    assert np.nanmax(np.abs(off[..., 1])) < 1e-6  # rad
    assert np.nanmax(np.abs(inside[..., 2:])) < 0.02 * np.abs(moment).max()  # of differences
    assert np.abs(moment).max() > 2.0  # N m


def test_corners_and_noise_of_an_encoder_do_not_ring(tmp_path):
    """The shoulder turns to and fro at even speeds, 1 rad/s, and its encoder has noise of 0.1 mrad."""
    path = swinging_models.machine(tmp_path)
    log = swinging_models.log(tmp_path / "log.csv", 0, sharp=0.002)
    _, _, off = opened(path, log, 64)
    assert np.sqrt(np.nanmean(off**2)) < 1.3 * 5e-4  # rad: the noise of the elbow's angle


@pytest.mark.parametrize("corners", [False, True])
@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_a_tendon_keeps_its_length_in_motion(tmp_path, corners, integrator):
    path, time = cabled(tmp_path, "motion", integrator), np.arange(0.0, SECONDS, 1 / RATE)
    wave = 2 / np.pi * np.arcsin(np.sin(3 * time)) if corners else np.sin(3 * time)
    long = 1e3 * span([0.0, 0.0]) + 5 + 30 * wave  # begins 5 mm off
    elsewhere = np.outer(wave, np.ones(3))  # is not looked at
    log = lines(tmp_path / "log.csv", np.c_[time, long, elsewhere, long])
    _, _, off = opened(path, log)
    assert np.nanmax(np.abs(off[..., 3])) < 1e-4 * np.ptp(long) / 1e3  # m


def test_a_tendon_of_known_length_pulls_the_arm_where_its_energy_is_least(tmp_path):
    path, rng = cabled(tmp_path, "poses"), np.random.default_rng(0)
    wound = span([0.0, 0.0]) + rng.uniform(-0.03, 0.03, 40)

    def energy(angles):
        weight = sum(
            m * 9.81 * at[2] for m, at in zip(MASSES, posed_models.places(angles), strict=True)
        )
        return weight + sum(k * q**2 for k, q in zip(SPRINGS, angles, strict=True)) / 2

    def rest(length):
        return minimize(
            energy,
            [0.0, 0.0],
            method="SLSQP",
            constraints={"type": "eq", "fun": lambda angles: span(angles) - length},
            options={"ftol": 1e-14, "maxiter": 200},
        ).x

    tips = np.array([posed_models.places(rest(length))[1] for length in wound])
    rows = np.c_[np.arange(40.0), 1e3 * wound, 1e3 * tips, 1e3 * wound]
    _, _, off = opened(path, lines(tmp_path / "log.csv", rows))
    assert np.nanmax(np.abs(off[..., :3])) < 2e-6  # m
    assert np.nanmax(np.abs(off[..., 3])) < 1e-4 * np.ptp(wound)


def test_a_joint_of_known_angle_leaves_the_other_where_its_energy_is_least(tmp_path):
    path = posed_models.machine(tmp_path)
    text = posed_models.TOML.replace('actuator = "at_shoulder"', 'joint = "shoulder"')
    path.write_text(text)
    rng, gravity = np.random.default_rng(0), np.array([0.0, 0.0, -9.81])
    told = rng.uniform(-0.8, 0.8, (30, 2))

    def rest(first, goal):
        def energy(elbow):
            at = posed_models.places(np.array([first, elbow[0]]))
            springs = SPRINGS[1] * elbow[0] ** 2 + posed_models.GAIN * (elbow[0] - goal) ** 2
            return springs / 2 - sum(m * p @ gravity for m, p in zip(MASSES, at, strict=True))

        return np.array([first, minimize(energy, [0.0], tol=1e-12).x[0]])

    tips = 1e3 * np.array([posed_models.places(rest(*each))[1] for each in told])
    table(tmp_path / "log.csv", "shoulder_deg,elbow_deg,x,y,z", np.c_[np.degrees(told), tips], 9)
    _, _, off = opened(path, tmp_path / "log.csv")
    assert np.nanmax(np.abs(off)) < 2e-6  # m


def test_a_comparison_of_poses_places_the_hinge_that_no_column_reads(tmp_path):
    """The shoulder is read, the elbow is seen by its site only."""
    path = posed_models.machine(tmp_path)
    read = '\n[[measured]]\njoint = "shoulder"\ncolumns = ["read_deg"]\nunit = "deg"\n'
    path.write_text(posed_models.TOML + read)
    goals = np.random.default_rng(0).uniform(-0.8, 0.8, (30, 2))

    def at_rest(goals):
        return np.array([posed_models.rest(each, np.array([0.0, 0.0, -9.81])) for each in goals])

    rest = at_rest(goals)
    tips = 1e3 * np.array([posed_models.places(each)[1] for each in rest])
    rows = np.c_[np.degrees(goals), tips, np.degrees(rest[:, 0])]
    table(tmp_path / "log.csv", "shoulder_deg,elbow_deg,x,y,z,read_deg", rows, 9)
    case, pieces, _ = opened(path, tmp_path / "log.csv")
    seen = case.compare(None, pieces)
    assert seen.joint_names == ("elbow",)
    true = at_rest(seen.motor_angle.reshape(-1, 2))[:, 1]
    np.testing.assert_allclose(seen.joint_angle[..., 0].ravel(), true, atol=1e-5)


@pytest.mark.slow
def test_a_spring_of_the_joint_that_follows_is_named_with_its_size(tmp_path):
    assert_named_alone(traced(tmp_path, spring=0.05), "joint_elasticity@elbow", "stiffness", 0.05)


@pytest.mark.slow
def test_nothing_is_missing_where_a_joint_follows_as_its_model_does(tmp_path):
    found = traced(tmp_path)
    assert found["effects"] == [] and not found["unexplained"]["is"]


def test_a_column_may_count_from_the_keyframe(tmp_path):
    path = cabled(tmp_path, "poses")
    model = path.with_name("arm.xml")
    bent = '<keyframe><key name="bent" qpos="0.3 -0.2"/></keyframe></mujoco>'
    model.write_text(model.read_text().replace("</mujoco>", bent))
    path.write_text(
        'keyframe = "bent"\n'
        + cabled_models.TOML.format(rows="poses").replace(
            'unit = "mm"', 'unit = "mm"\noffset = "keyframe"', 1
        )
        + '\n[[drive]]\njoint = "elbow"\ncolumn = "turned"\nunit = "deg"\noffset = "keyframe"\n'
    )
    described = open_machine(path).described
    offsets = [described.offset(each) for each in described.about.drive]
    assert offsets == pytest.approx([span([0.3, -0.2]), -0.2], abs=1e-9)


def test_a_twin_is_written_without_what_holds_it(tmp_path):
    path = swinging_models.machine(tmp_path)
    case, *_ = opened(path, swinging_models.log(tmp_path / "log.csv", 0))
    case.write(ParameterVector.nominal(case.declared), tmp_path / "twin.json", {})
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml"))
    assert model.neq == 0 and model.jnt_limited[0]


def test_a_twin_without_actuators_is_written_and_has_no_drives(tmp_path):
    (tmp_path / "arm.xml").write_text(
        "<mujoco><worldbody><body><joint name='a'/><geom size='.1' mass='1'/><body pos='.3 0 0'>"
        "<joint name='b'/><geom size='.1' mass='1'/></body></body></worldbody></mujoco>"
    )
    drive = '[[drive]]\njoint = "a"\ncolumn = "a"\nunit = "rad"\nexact = true\n'
    measured = '[[measured]]\njoint = "b"\ncolumns = ["b"]\nunit = "rad"\n'
    path = tmp_path / "machine.toml"
    path.write_text(f'schema_version = 1\nmodel = "arm.xml"\nrows = "poses"\n{drive}{measured}')
    machine = read(path)
    assert not write_calibration(machine.spec, machine, {})
    table = read_drives(mujoco.MjModel.from_xml_string(to_xml(machine.spec, tmp_path)))
    assert table is not None and not table.beside
    assert table.acts_as(np.zeros(0)).shape == (0,)
