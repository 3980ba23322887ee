"""Test machines of which a log has quantities of two kinds, each in its own unit."""

from dataclasses import replace

import moving_models
import numpy as np
import posed_models
import pytest
from example import assert_named_alone, opened, table

from serpent_twin.effects.sensor_delay import SensorDelay
from serpent_twin.machines.model.clocks import clocks_of
from serpent_twin.machines.model.readings import reread
from serpent_twin.residual import analyse, describe

WITH_CURRENTS = replace(moving_models.EXAMPLE, toml=moving_models.TOML + moving_models.CURRENTS)


def traced(tmp_path, **how):
    return WITH_CURRENTS.traced(tmp_path, 4, **how), (tmp_path / "trace/report.html").read_text()


def test_angles_and_currents_of_motors_are_predicted_each_in_its_unit(tmp_path):
    case, pieces, _ = WITH_CURRENTS.opened(tmp_path, 0)
    compared = case.compare(None, pieces)
    assert (compared.marker.unit, compared.load.unit) == ("°", "mN m")
    assert compared.marker_names == ("shoulder", "elbow")
    assert compared.load_names == ("at_shoulder", "at_elbow")
    assert np.sqrt(np.nanmean(compared.marker_residual**2)) < 6e-4  # rad; the noise is 5e-4
    assert np.sqrt(np.nanmean(compared.load_residual**2)) < 2.4e-3  # N m; the noise is 2e-3
    told = describe(analyse(compared, np.random.default_rng(0)))
    assert "The angle is off by 0.02 °" in told and "the torque by 2." in told
    noise = {each.name: each.noise for each in case.machine.outputs}
    assert noise["current_1"] == pytest.approx(2e-3, rel=0.15)  # N m, estimated


def test_errors_of_a_motors_load_are_shares_of_its_stall_torque(tmp_path):
    in_torques = WITH_CURRENTS.opened(tmp_path / "torques", 0)
    currents = moving_models.CURRENTS.replace("scale = 0.5", "scale = 0.5\nof_stall = true")
    of_stall = replace(moving_models.EXAMPLE, toml=moving_models.TOML + currents)
    as_loads = of_stall.opened(tmp_path / "loads", 0)
    torque, load = (each.compare(None, pieces) for each, pieces, _ in (in_torques, as_loads))
    assert (load.load.field, load.load.key, load.load.unit) == ("load", "percent", "% of stall")
    np.testing.assert_array_equal(load.load_residual, torque.load_residual)  # [N m]
    assert load.load.scale * 0.5 == pytest.approx(100.0)


@pytest.mark.slow
def test_friction_shows_in_angles_and_currents_together(tmp_path):
    found, page = traced(tmp_path, friction=0.03)
    assert_named_alone(found, "hinge_friction@elbow", "coulomb", 0.03)
    effect = found["effects"][0]
    assert effect["gain_deg"] > 0 and effect["gain_torque_mNm"] > 0
    assert found["error_deg"]["corrected"] < 0.03
    assert found["torque_error_mNm"]["corrected"] < 2.5
    assert "torque [mN m]" in page and "angle [°]" in page


@pytest.mark.slow
def test_nothing_is_missing_in_angles_and_currents_where_nothing_is(tmp_path):
    found, _ = traced(tmp_path)
    assert found["effects"] == [] and not found["unexplained"]["is"]


def test_lengths_of_tendons_and_forces_of_actuators_are_those_of_statics(tmp_path):
    """A winch of stiffness k pulls a lever against a spring c by a cable on a drum of radius r."""
    model = moving_models.LEVER.replace("<worldbody>", '<option gravity="0 0 0"/><worldbody>')
    (tmp_path / "lever.xml").write_text(model.replace('name="axle"', 'name="axle" stiffness="1"'))
    (tmp_path / "machine.toml").write_text(
        moving_models.LEVER_TOML.replace('rows = "motion"', 'rows = "poses"')
        .replace('joint = "pivot", columns = ["angle_1"], unit = "rad"',
                 'tendon = "cable", columns = ["cable_mm"], unit = "mm"')
        .replace('joint = "axle", columns = ["angle_2"], unit = "rad"',
                 'actuator = "winch", columns = ["pull"], unit = "N"')
    )  # fmt: skip
    k, c, r = 1000.0, 1.0, 0.1
    pulled = np.linspace(-0.05, 0.05, 40)
    turned = k * r * pulled / (c + k * r**2)
    rows = np.c_[np.arange(40.0), pulled, 0 * pulled, 1e3 * r * turned, k * (pulled - r * turned)]
    table(tmp_path / "log.csv", "time,pulled,current,cable_mm,pull", rows, 9)
    case, pieces, _ = opened(tmp_path / "machine.toml", tmp_path / "log.csv")
    compared = case.compare(None, pieces)
    assert (compared.marker.unit, compared.load.unit) == ("mm", "N")
    assert np.nanmax(np.abs(compared.marker_residual)) < 1e-8  # m
    assert np.nanmax(np.abs(compared.load_residual)) < 1e-4  # N


def test_what_is_not_of_the_pose_comes_after_it(tmp_path):
    """Outputs of the pose come first in any order of a file; a sensor of three numbers has three names."""
    path = posed_models.machine(tmp_path)
    model = path.with_name("arm.xml")
    seat = '<sensor><force name="seat" site="tip"/></sensor></mujoco>'
    model.write_text(model.read_text().replace("</mujoco>", seat))
    tables = (
        'joint = "elbow"\ncolumns = ["q2"]\nunit = "rad"',
        'sensor = "seat"\ncolumns = ["fx", "fy", "fz"]\nunit = "N"',
        'joint = "shoulder"\ncolumns = ["q1"]\nunit = "rad"',
    )
    path.write_text(
        posed_models.TOML[: posed_models.TOML.index("[[measured]]")]
        + "".join(f"[[measured]]\n{each}\n" for each in tables)
    )
    goals = np.random.default_rng(0).uniform(-0.8, 0.8, (12, 2))
    angles = np.array([posed_models.rest(goal, np.array([0, 0, -9.81])) for goal in goals])
    turn, weight = angles.sum(axis=1), posed_models.MASSES[1] * 9.81
    # The site is where the mass is: what holds it up, in the frame of the turned link.
    force = weight * np.stack([-np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
    rows = np.c_[np.degrees(goals), angles, force]
    table(tmp_path / "log.csv", "shoulder_deg,elbow_deg,q1,q2,fx,fy,fz", rows, 9)
    case, pieces, _ = opened(path, tmp_path / "log.csv")
    assert [each.name for each in case.machine.outputs] == ["q2", "q1", "fx", "fy", "fz"]
    compared = case.compare(None, pieces)
    assert compared.marker_names == ("elbow", "shoulder")
    assert compared.load_names == ("fx", "fy", "fz")
    assert np.nanmax(compared.distance) < 1e-5  # rad
    assert np.nanmax(np.abs(compared.load_residual)) < 1e-4  # N


def test_a_late_reading_is_late_at_its_own_place_only(tmp_path):
    """Two sites are measured, three columns each."""
    path = posed_models.machine(tmp_path)
    model = path.with_name("arm.xml")
    upper = '<site name="bend" pos="0.3 0 0"/>\n      <body name="lower"'
    model.write_text(model.read_text().replace('<body name="lower"', upper))
    bend = '[[measured]]\nsite = "bend"\ncolumns = ["u", "v", "w"]\nunit = "mm"\ncameras = false\n'
    path.write_text(posed_models.TOML + bend)
    log = posed_models.log(tmp_path / "log.csv", 0)
    head, *rows = log.read_text().splitlines()
    log.write_text("\n".join([f"{head},u,v,w", *(f"{row},{n},0,0" for n, row in enumerate(rows))]))
    case, pieces, at = opened(path, log)
    seen = case.machine.respond([at], pieces)[0]
    a_row_late = SensorDelay(float(pieces.period[0]), at="bend")
    late = reread(
        [[a_row_late]] * len(seen),
        case.machine.places,
        seen,
        pieces.period,
        clocks_of(pieces),
    )
    np.testing.assert_array_equal(late[..., :3], seen[..., :3])
    np.testing.assert_allclose(late[:, 1:, 3:], seen[:, :-1, 3:], atol=1e-12)
