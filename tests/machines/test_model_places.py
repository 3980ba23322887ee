"""Composed laws on any model: beside effects that say the same, and to first order beside simulation."""

import moving_models
import numpy as np
import pytest

from serpent_twin import machines
from serpent_twin.effects.law import FORCES, parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.rig import read_logs

FRICTION = "hinge_friction@elbow"


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """A two-link arm's case, its segments, and what its nominal twin shows."""
    folder = tmp_path_factory.mktemp("arm")
    path = moving_models.machine(folder)
    for n in (1, 2):
        moving_models.log(folder / "logs" / f"session_{n}.csv", n)
    rig = machines.find(str(path))
    return nominal(rig, folder / "logs")


@pytest.fixture(scope="module")
def places(opened):
    """Where and what may act on it."""
    case, pieces, _ = opened
    return case.places(start(case), pieces)


def start(case, **effects):
    """The nominal twin, with effects."""
    return ParameterVector.nominal(case.declared, effects)


def nominal(rig, logs):
    """A machine's case, the segments of its logs, and what the nominal twin shows in them."""
    case = rig.open(sessions := read_logs(rig, (logs,)))
    pieces = case.pieces(sessions)
    return case, pieces, case.machine.respond([start(case)], pieces)[0]


def shown(opened, at="", *values, effects=()):
    """What the nominal twin shows with a law of some numbers, or with other effects, less without."""
    case, pieces, plain = opened
    there = dict(effects) | ({f"discovered@{at}": np.array(values)} if at else {})
    return case.machine.respond([start(case, **there)], pieces)[0] - plain


def of(size, first=0.0, second=0.0):
    """A law's eight numbers."""
    return size, 0.0, 0.0, 0.0, first, second, 0.0, 0.0


@pytest.mark.parametrize(
    ("at", "values", "name", "others", "near"),
    [
        ("joint_torque of elbow: linear joint_angle of elbow", of(-0.4),
         "joint_elasticity@elbow", [0.4], 2e-4),
        ("joint_friction of elbow: constant", of(0.03), FRICTION, [0.03, 0.0], 2e-4),
        ("joint_torque of elbow: linear joint_velocity of elbow", of(-0.02),
         FRICTION, [0.0, 0.02], 2e-4),
    ],
)  # fmt: skip
def test_a_law_moves_a_model_as_the_effect_that_says_the_same(
    opened, at, values, name, others, near
):
    one, two = shown(opened, at, *values), shown(opened, effects={name: np.array(others)})
    assert np.abs(two).max() > 0.004
    assert np.quantile(np.abs(one - two), 0.95) < near  # a start may adapt in another way


def test_friction_acts_in_a_model_that_has_turned_constraints_off(tmp_path):
    """As in the suites of dm_control: what a law adds must hold there, too."""
    path = moving_models.machine(tmp_path)
    (model,) = tmp_path.glob("*.xml")
    off = '<mujoco><option><flag constraint="disable"/></option>'
    model.write_text(model.read_text().replace("<mujoco>", off, 1))
    moving_models.log(tmp_path / "logs" / "session_1.csv", 1)
    rig = machines.find(str(path))
    opened = nominal(rig, tmp_path / "logs")
    one = shown(opened, "joint_friction of elbow: constant", *of(0.03))
    two = shown(opened, effects={FRICTION: np.array([0.03, 0.0])})
    assert np.abs(two).max() > 0.004
    assert np.quantile(np.abs(one - two), 0.95) < 2e-4


def test_a_shifted_reading_changes_that_column_alone(opened):
    _, pieces, _ = opened
    change = shown(opened, "reading_shift of elbow: above time of session", *of(0.02, 3.0))
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
def test_a_change_shows_as_places_say_to_first_order(opened, places, at, least):
    _, pieces, _ = opened
    law = parse(at)
    responses = {(each.handle, each.place): each for each in places.responses}
    if law.handle in FORCES:
        name = [place for handle, place in responses if handle == law.handle][-1]
        law = parse(at.replace("lower", name))
    x = places.readings.get((law.reading, law.where), np.zeros(pieces.time.shape))
    first = 3.0 if law.shape == "periodic" else float(np.median(x))
    follows = SHAPES[law.shape].form(x, first, 0.0)
    k = 3 if law.handle == "spring" else 0  # its stiffness
    unit = [*responses[law.handle, law.place].of(follows[None])][k][0]
    size = 2e-3 / np.sqrt(np.mean(unit**2))
    known = np.isfinite(pieces.measured)
    values = np.roll(of(size), k) + np.array(of(0.0, first))
    found, told = shown(opened, str(law), *values)[known], size * unit[known]
    assert found @ told > least * np.linalg.norm(found) * np.linalg.norm(told)
    assert np.linalg.norm(told) == pytest.approx(np.linalg.norm(found), rel=0.1)


def test_laws_are_sought_beside_links_that_bend(opened):
    case, pieces, _ = opened
    bends = {"link_flex@upper": np.array([0.05, 0.0])}
    places = case.places(start(case, **bends), pieces)
    torque = next(
        each for each in places.responses if (each.handle, each.place) == ("joint_torque", "elbow")
    )
    unit = next(iter(torque.of(np.ones((1, *pieces.time.shape)))))[0]
    law = {"discovered@joint_torque of elbow: constant": np.array(of(0.01))}
    found = shown(opened, effects=bends | law) - shown(opened, effects=bends)
    known = np.isfinite(pieces.measured)
    assert np.abs(found[known]).max() > 1e-3
    assert np.abs(0.01 * unit - found)[known].max() < 0.1 * np.abs(found[known]).max()
    angle = places.readings["joint_angle", "elbow"]
    off = np.abs(angle - pieces.measured[..., 1])
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
    rig = machines.find(str(path))
    opened = case, pieces, _ = nominal(rig, tmp_path / "logs")
    places = case.places(start(case), pieces)
    slack = next(each for each in places.responses if each.handle == "slack")
    law = parse(f"slack of cable: {at}")
    x = places.readings.get((law.reading, law.where), np.zeros(pieces.time.shape))
    assert law.reading != "tension" or (x.max() > 0.2 and x.min() == 0.0)
    first = float(np.median(x)) if law.shape == "beyond" else 0.0
    follows = SHAPES[law.shape].form(x, first, 0.0)
    unit = next(iter(slack.of(follows[None])))[0]
    size = 1e-3 / max(follows.max(), 1e-9)
    found = shown(opened, str(law), *of(size, first))
    known = np.isfinite(pieces.measured)
    told, found = size * unit[known], found[known]
    assert np.abs(found).max() > 1e-4
    assert found @ told > 0.98 * np.linalg.norm(found) * np.linalg.norm(told)
    assert np.linalg.norm(told) == pytest.approx(np.linalg.norm(found), rel=0.1)


def test_places_are_told_by_name_and_unit(opened, places):
    handles = {each.handle for each in places.responses}
    assert handles == {"joint_torque", "joint_friction", *FORCES, "command", "reading_shift"}
    assert ("joint_velocity", "elbow") in places.readings
    forces = [each for each in places.responses if each.handle in ("joint_torque", *FORCES)]
    assert not any(each.own.any() for each in forces)  # angles do not show forces at once
    units = opened[0].units_of_law(parse("joint_torque of elbow: linear joint_angle of elbow"))
    assert units["size"] == "N m per rad"


@pytest.mark.parametrize(
    ("at", "says"),
    [
        ("joint_torque of wrist: constant", "no hinge, slide, tendon, body or drive of a joint 'wrist'"),
        ("winch_angle of elbow: constant", "no law changes winch_angle here; there are: joint_torque"),
        ("joint_torque of elbow: linear horn_torque of elbow", "no law follows the horn torque of elbow"),
    ],
)  # fmt: skip
def test_what_a_model_lacks_is_refused(opened, at, says):
    with pytest.raises(SerpentError, match=says):
        shown(opened, at, *of(0.1))
