"""Composed laws beside prescribed motion: to first order beside simulation, and found in a log."""

import numpy as np
import pytest
import swinging_models
from cabled_models import cabled, lines, span
from nominal_twin import Nominal, assert_alike, numbers

from serpent_twin.identification.run import Trace, trace

PUSH, FROM, WIDE = 0.08, 1.2, 0.5  # [N m], [rad]
SENSOR = """
[[measured]]
sensor = "held"
columns = ["mx", "my", "mz"]
unit = "N m"
noise = 0.01
"""


def sensing(folder):
    """A two-link arm whose shoulder's motion is prescribed, with a torque sensor between it and the wall."""
    path = swinging_models.machine(folder)
    model = path.with_name("arm.xml")
    upper = '<joint name="shoulder"'
    sensor = '<sensor><torque name="held" site="seat"/></sensor></mujoco>'
    text = model.read_text().replace(upper, f'<site name="seat"/>{upper}', 1)
    model.write_text(text.replace("</mujoco>", sensor))
    path.write_text(path.read_text().replace("0.0005", "0.002") + SENSOR)
    log = swinging_models.log(folder / "log.csv", 1, noise=0.0)
    table = np.genfromtxt(log, delimiter=",", names=True)
    elsewhere = np.outer(table["angle"], np.ones(3))  # is not looked at
    rows = np.c_[table["t"], table["encoder"], table["angle"], elsewhere]
    np.savetxt(log, rows, "%.8f", ",", header="t,encoder,angle,mx,my,mz", comments="")
    return path, log


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Its nominal twin."""
    return Nominal.of(*sensing(tmp_path_factory.mktemp("arm")))


LAWS = {
    ("joint_torque of elbow: constant", 0): 0.999,
    ("joint_torque of elbow: above joint_angle of shoulder", 0): 0.99,
    ("joint_torque of elbow: linear joint_velocity of shoulder", 0): 0.99,
    ("joint_torque of elbow: constant", 2): 0.99,
    ("joint_friction of elbow: constant", 0): 0.99,
    ("joint_torque of elbow: play joint_angle of elbow", 0): 0.98,
    ("joint_torque of elbow: lag joint_angle of elbow", 0): 0.98,
    ("force_in_body of lower: constant", 2): 0.999,
    ("force of lower: constant", 0): 0.999,
    ("force of lower: beyond position_z of lower", 2): 0.99,
    ("force of upper: constant", 2): 0.999,
    ("reading_shift of elbow: linear joint_angle of shoulder", 0): 0.99,
}


@pytest.mark.parametrize(("at", "channel", "least"), [(*of, least) for of, least in LAWS.items()])
def test_a_change_shows_as_places_say_to_first_order(arm, at, channel, least):
    """Changes show in the elbow's angle, and in the torque that moves the shoulder."""
    found, told = arm.change(at)
    assert_alike(found[..., channel], told[..., channel], least)


@pytest.mark.parametrize("at", ["joint_torque of elbow: constant", "force of lower: constant"])
def test_a_change_shows_to_first_order_where_a_tendon_is_prescribed(tmp_path, at):
    """It holds neither joint alone, and passes by both."""
    path, time = cabled(tmp_path, "motion"), np.arange(0.0, 3.0, 0.02)
    path.write_text("start = 0.06\n" + path.read_text())  # no start that answers to changes
    tip = np.array([550.0, 0.0, 1000.0])  # of the straight arm, where it begins
    long = 1e3 * span([0.0, 0.0]) + 30 * np.sin(3 * time)
    seen = tip + 1e-3 * np.random.default_rng(0).standard_normal((len(time), 3))
    log = lines(tmp_path / "log.csv", np.c_[time, long, seen, long])
    assert_alike(*Nominal.of(path, log).change(at), 0.99)


def test_what_a_prescribed_joint_takes_up_is_no_place(arm):
    """A torque there shows in nothing that MuJoCo measures."""
    assert not [each for each in arm.places.responses if each.place == "shoulder"]
    assert ("joint_angle", "shoulder") in arm.places.readings
    assert np.abs(arm.changed("joint_torque of shoulder: constant", numbers(0.1))).max() < 1e-4


@pytest.mark.slow
def test_a_torque_within_a_window_of_the_free_joint_s_angle_is_composed_there(tmp_path):
    """Logs are made by equations which know nothing of MuJoCo."""
    path, noise = swinging_models.machine(tmp_path / "arm"), 2e-3
    text = path.read_text().replace("noise = 0.0005", f"noise = {noise}")
    path.write_text(f'candidates = ["gravity"]\n{text}')

    def push(q):
        return PUSH if FROM < q < FROM + WIDE else 0.0

    for n in range(3):
        swinging_models.log(tmp_path / "logs" / f"motion_{n}.csv", n, noise=noise, push=push)
    found = trace(Trace((tmp_path / "logs",), tmp_path / "trace", machine=path))
    (law,) = found["effects"]
    assert law["place"] == {"kind": "joint", "name": "elbow"}
    assert (law["changes"], law["law"]) == ("joint_torque", "within")
    assert law["depends_on"] == ["joint angle of elbow"]
    size, begins, wide = (law["parameters"][name] for name in ("size", "from", "width"))
    assert size["value"] == pytest.approx(PUSH, rel=0.1)
    assert size["low"] < PUSH < size["high"]
    assert begins["value"] == pytest.approx(FROM, abs=0.03)
    assert wide["value"] == pytest.approx(WIDE, abs=0.05)
    assert not found["unexplained"]["is"]
