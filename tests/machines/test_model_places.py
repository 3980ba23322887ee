"""Composed laws on any model: beside effects that say the same, and to first order beside simulation."""

import moving_models
import numpy as np
import pytest
from nominal_twin import Nominal, assert_alike, numbers

from serpent_twin.effects.law import FORCES, parse
from serpent_twin.errors import SerpentError

FRICTION = "hinge_friction@elbow"


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A two-link arm's nominal twin."""
    folder = tmp_path_factory.mktemp("arm")
    path = moving_models.machine(folder)
    for n in (1, 2):
        moving_models.log(folder / "logs" / f"session_{n}.csv", n)
    return Nominal.of(path, folder / "logs")


@pytest.mark.parametrize(
    ("at", "values", "name", "others", "near"),
    [
        ("joint_torque of elbow: linear joint_angle of elbow", numbers(-0.4),
         "joint_elasticity@elbow", [0.4], 2e-4),
        ("joint_friction of elbow: constant", numbers(0.03), FRICTION, [0.03, 0.0], 2e-4),
        ("joint_torque of elbow: linear joint_velocity of elbow", numbers(-0.02),
         FRICTION, [0.0, 0.02], 2e-4),
    ],
)  # fmt: skip
def test_a_law_moves_a_model_as_the_effect_that_says_the_same(arm, at, values, name, others, near):
    one, two = arm.changed(at, values), arm.changed(**{name: others})
    assert np.abs(two).max() > 0.004
    assert np.quantile(np.abs(one - two), 0.95) < near  # a start may adapt in another way


def test_friction_acts_in_a_model_that_has_turned_constraints_off(tmp_path):
    """Models of dm_control's suites turn constraints off: what a law adds must hold there, too."""
    path = moving_models.machine(tmp_path)
    (model,) = tmp_path.glob("*.xml")
    off = '<mujoco><option><flag constraint="disable"/></option>'
    model.write_text(model.read_text().replace("<mujoco>", off, 1))
    moving_models.log(tmp_path / "logs" / "session_1.csv", 1)
    arm = Nominal.of(path, tmp_path / "logs")
    one = arm.changed("joint_friction of elbow: constant", numbers(0.03))
    two = arm.changed(**{FRICTION: [0.03, 0.0]})
    assert np.abs(two).max() > 0.004
    assert np.quantile(np.abs(one - two), 0.95) < 2e-4


def test_a_shifted_reading_changes_that_column_alone(arm):
    pieces = arm.pieces
    change = arm.changed("reading_shift of elbow: above time of session", numbers(0.02, 3.0))
    start = np.array([log.time[0] for log in pieces.log])
    late = pieces.time - start[:, None] > 3.01
    early = pieces.time - start[:, None] < 2.99
    whole = early.all(axis=1)  # where readings of the lead are shifted, so is the start
    assert not change[whole].any()
    assert np.abs(change[..., 0])[whole | late.all(axis=1)].max() < 0.02
    crosses = ~whole & early[:, 0]
    assert crosses.any()
    assert np.allclose(change[crosses][late[crosses]], [0.0, 0.02], atol=1e-9)


LAWS = {
    "joint_torque of elbow: constant": 0.999,
    "joint_torque of shoulder: above joint_angle of elbow": 0.99,
    "joint_torque of elbow: beyond joint_angle of elbow": 0.99,
    "joint_friction of elbow: constant": 0.9,
    "force of lower: constant": 0.999,
    "force_in_body of lower: constant": 0.99,
    "spring of lower: constant": 0.999,
    "joint_torque of elbow: periodic time of session": 0.999,
    "force of lower: beyond position_z of lower": 0.98,
    "reading_shift of elbow: linear joint_angle of shoulder": 0.99,
    "command of at_elbow: constant": 0.999,
    "command of at_elbow: beyond command of at_shoulder": 0.99,
    "command of at_shoulder: above time of session": 0.99,
}


@pytest.mark.parametrize(("at", "least"), LAWS.items())
def test_a_change_shows_as_places_say_to_first_order(arm, at, least):
    if parse(at).handle in FORCES:
        handle = parse(at).handle
        name = [each.place for each in arm.places.responses if each.handle == handle][-1]
        at = str(parse(at.replace("lower", name)))
    known = np.isfinite(arm.pieces.measured)
    found, told = arm.change(at)
    assert_alike(found[known], told[known], least)


def test_laws_are_sought_beside_links_that_bend(arm):
    bends = {"link_flex@upper": [0.05, 0.0]}
    places = arm.case.places(arm.start(**bends), arm.pieces)
    torque = next(
        each for each in places.responses if (each.handle, each.place) == ("joint_torque", "elbow")
    )
    unit = next(iter(torque.of(np.ones((1, *arm.pieces.time.shape)))))[0]
    law = "joint_torque of elbow: constant"
    found = arm.shown(law, numbers(0.01), **bends) - arm.shown(**bends)
    known = np.isfinite(arm.pieces.measured)
    assert np.abs(found[known]).max() > 1e-3
    assert np.abs(0.01 * unit - found)[known].max() < 0.1 * np.abs(found[known]).max()
    angle = places.readings["joint_angle", "elbow"]
    off = np.abs(angle - arm.pieces.measured[..., 1])
    assert np.median(off[known[..., 1]]) < 0.1


CABLE = """</worldbody>
<tendon>
  <fixed name="cable" stiffness="40" springlength="-1 0.01">
    <joint joint="shoulder" coef="0.03"/><joint joint="elbow" coef="0.05"/>
  </fixed>
</tendon>"""
PULL = """
[[measured]]
tendon = "cable"
columns = ["current_1"]
unit = "N"
noise = 0.01
"""


@pytest.mark.parametrize("pull", ["", PULL])
@pytest.mark.parametrize(
    "at", ["constant", "beyond joint_angle of elbow", "linear tension of cable"]
)
def test_a_slack_of_a_cable_shows_as_places_say_where_it_pulls(tmp_path, at, pull):
    path = moving_models.machine(tmp_path)
    path.write_text(moving_models.TOML + pull)
    model = tmp_path / "arm.xml"
    model.write_text(model.read_text().replace("</worldbody>", CABLE))
    moving_models.log(tmp_path / "logs" / "session_1.csv", 1)
    arm = Nominal.of(path, tmp_path / "logs")
    law = f"slack of cable: {at}"
    x, _ = arm.reading(law)
    assert parse(law).reading != "tension" or (x.max() > 0.2 and x.min() == 0.0)
    known = np.isfinite(arm.pieces.measured)
    found, told = (each[known] for each in arm.change(law, 2e-4))
    assert np.abs(found).max() > 1e-4
    assert_alike(found, told, 0.98)


def test_places_are_told_by_name_and_unit(arm):
    handles = {each.handle for each in arm.places.responses}
    assert handles == {"joint_torque", "joint_friction", *FORCES, "command", "reading_shift"}
    assert ("joint_velocity", "elbow") in arm.places.readings
    forces = [each for each in arm.places.responses if each.handle in ("joint_torque", *FORCES)]
    assert not any(each.own.any() for each in forces)  # angles do not show forces at once
    units = arm.case.units_of_law(parse("joint_torque of elbow: linear joint_angle of elbow"))
    assert units["size"] == "N m per rad"


@pytest.mark.parametrize(
    ("at", "says"),
    [
        ("joint_torque of wrist: constant", "no hinge, slide, tendon, body or drive of a joint 'wrist'"),
        ("marker_shift of elbow: constant", "needs marker_shift of a site, and 'elbow' is none"),
        ("winch_angle of elbow: constant", "needs winch_angle of a winch, and 'elbow' is none"),
        ("joint_torque of elbow: linear motor_angle of elbow", "needs motor_angle of a winch, and 'elbow'"),
    ],
)  # fmt: skip
def test_what_a_model_lacks_is_refused(arm, at, says):
    with pytest.raises(SerpentError, match=says):
        arm.shown(at, numbers(0.1))
