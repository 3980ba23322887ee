"""Laws at joints, bodies and tendons of a model at rest, beside statics that know nothing of MuJoCo."""

import hanging_models
import numpy as np
import posed_models
import pytest
from hanging_models import BELOW, STOP, lever, pulls, pushed, stop
from nominal_twin import Nominal, numbers
from scipy.optimize import root

from serpent_twin.effects.law import FORCES, HANDLES, parse
from serpent_twin.errors import SerpentError


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """A hanging chain's nominal twin."""
    folder = tmp_path_factory.mktemp("chain")
    path = hanging_models.machine(folder)
    hanging_models.log(folder / "logs" / "poses.csv", 1)
    return Nominal.of(path, folder / "logs")


def by_statics(pieces, law=None, slack=None):
    """Measured places [m], (S, T, 6), by statics, with a law's torques (3,) of angles, or with slack (2,) of
    the row's number.
    """
    told = np.stack([pieces.column["left"], pieces.column["right"]], axis=-1)
    out = np.empty((*told.shape[:2], 6))
    for s, t in np.ndindex(told.shape[:2]):
        more = slack(pieces.time[s, t]) if slack else np.zeros(2)
        out[s, t] = hanging_models.shown(hanging_models.rest(told[s, t] + more, law))
    return out


def loaded(q):
    """A torque of the second joint in proportion to the third's angle."""
    return np.array([0.0, q[2], 0.0])


def tied(q):
    """A spring from the last link to a point beside it."""
    return lever(q, 2).T @ (np.array([0.3, -0.2]) - 4.0 * hanging_models.ends(q)[3])


def carried(q):
    """A force that turns with the second link."""
    angle = q[0] + q[1]
    turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return lever(q, 1).T @ turned @ [0.3, 0.1]


@pytest.mark.parametrize(
    ("at", "values", "law"),
    [
        ("spring of link_3: constant", (0.3, 0, -0.2, 4.0, 0, 0, 0, 0), tied),
        ("force_in_body of link_2: constant", (0.3, 0, 0.1, 0, 0, 0, 0, 0), carried),
        ("joint_torque of joint_3: below joint_angle of joint_3", (-STOP, 0, 0, 0, BELOW, 0, 0, 0), stop),
        ("force of link_3: beyond position_x of link_3", (-8.0, 0, 0, 0, 0.03, 0, 0, 0), pushed),
        ("joint_torque of joint_2: linear joint_angle of joint_3", (1.0, 0, 0, 0, 0, 0, 0, 0), loaded),
        ("force of link_2: constant", (0.2, 0, -0.4, 0, 0, 0, 0, 0), lambda q: lever(q, 1).T @ [0.2, -0.4]),
    ],
)  # fmt: skip
def test_a_law_moves_a_model_at_rest_as_statics_say(chain, at, values, law):
    found, true = chain.shown(at, values), by_statics(chain.pieces, law)
    assert np.abs(true - by_statics(chain.pieces)).max() > 0.004
    assert found == pytest.approx(true, abs=2e-6)


def test_a_cable_that_stretches_by_its_tension_is_a_softer_one(chain, monkeypatch):
    """The stretch is by the tension that the cable would have at this length without the law."""
    found = chain.shown("slack of right: linear tension of right", numbers(0.01))
    usual = by_statics(chain.pieces)
    monkeypatch.setattr(hanging_models, "STIFFNESS", np.array([60.0, 60.0 * (1 - 60.0 * 0.01)]))
    true = by_statics(chain.pieces)
    assert np.abs(true - usual).max() > 0.01
    assert found == pytest.approx(true, abs=2e-6)


def test_a_cable_slips_at_an_instant(chain):
    pieces = chain.pieces
    found = chain.shown("slack of left: above time of session", numbers(0.01, 20.5))
    since = pieces.time.min()
    true = by_statics(pieces, slack=lambda t: np.array([0.01 * (t - since > 20.5), 0.0]))
    assert np.abs(true - by_statics(pieces)).max() > 0.005
    assert found == pytest.approx(true, abs=2e-6)


def stepped(told, size):
    """What the chain may show, (k, 6), and how exactly [m], with a torque on joint 3 below an angle."""
    step = np.array([0.0, 0.0, size])
    off, on = hanging_models.rest(told), hanging_models.rest(told, lambda q: step)
    there = [q for q, is_so in ((off, off[2] > BELOW), (on, on[2] < BELOW)) if is_so]
    if there:
        return [hanging_models.shown(q) for q in there], 2e-4 if size > 0 else 2e-6

    def held(x):
        q = np.array([x[0], x[1], BELOW])
        return hanging_models.left_over(q, told) + x[2] * step

    q = root(held, [*off[:2], 0.5], tol=1e-12).x
    assert 0.0 < q[2] < 1.0
    return [
        hanging_models.shown(np.array([q[0], q[1], BELOW]))
    ], 2e-4  # within 1 mrad of the threshold


@pytest.mark.parametrize(("size", "most"), [(0.15, 1), (0.02, 1), (-0.15, 2)])
def test_a_step_is_settled_on_either_side_or_on_it(chain, size, most):
    """A torque that pushes back beyond a threshold holds poses on it; one that pushes on has two."""
    pieces = chain.pieces
    law = "joint_torque of joint_3: under joint_angle of joint_3"
    found = chain.shown(law, numbers(size, BELOW)).reshape(-1, 6)
    told = np.stack([pieces.column["left"], pieces.column["right"]], axis=-1).reshape(-1, 2)
    counts = set()
    for one, each in zip(found, told, strict=True):
        several, near = stepped(each, size)
        counts.add(len(several))
        assert min(np.abs(one - true).max() for true in several) < near
    assert max(counts) == most


LAWS = [
    ("joint_torque of joint_1: constant", 1e-3),
    ("joint_torque of joint_3: below joint_angle of joint_3", 1e-2),
    ("joint_torque of joint_2: above tension of right", 1e-3),
    ("force of link_3: beyond position_x of link_3", 1e-2),
    ("force of link_2: linear time of session", 1e-4),
    ("force_in_body of link_3: constant", 1e-3),
    ("spring of link_3: constant", 1e-3),
    ("slack of left: constant", 1e-4),
    ("slack of right: linear joint_angle of joint_1", 1e-4),
]


@pytest.mark.parametrize(("at", "size"), LAWS)
def test_a_small_law_shows_as_places_say_to_first_order(chain, at, size):
    law, (x, first) = parse(at), chain.reading(at)
    k = 3 if law.handle == "spring" else 0  # its stiffness
    expected = chain.response(at).change[k] * chain.follows(at)[..., None]
    found = chain.changed(at, np.roll(numbers(size), k) + numbers(0.0, first)) / size
    assert chain.response(at).change.shape[0] == HANDLES[law.handle].components
    clear = np.abs(x - first) > 3e-3 if law.shape == "above" else np.ones(x.shape, bool)
    assert np.abs(found - expected)[clear].max() < 0.01 * np.abs(found).max()


def test_readings_of_poses_are_those_of_statics(chain):
    pieces = chain.pieces
    told = np.array([pieces.column["left"][1, 2], pieces.column["right"][1, 2]])
    q = hanging_models.rest(told)
    found = {key: x[1, 2] for key, x in chain.places.readings.items()}
    assert [found["joint_angle", f"joint_{n}"] for n in (1, 2, 3)] == pytest.approx(q, abs=1e-6)
    tensions = [found["tension", name] for name in ("left", "right")]
    assert tensions == pytest.approx(pulls(q, told)[0], abs=1e-4)
    tip = [found[f"position_{axis}", "link_3"] for axis in "xz"]
    assert tip == pytest.approx(hanging_models.ends(q)[3], abs=1e-6)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A two-link arm's nominal twin."""
    folder = tmp_path_factory.mktemp("arm")
    path = posed_models.machine(folder)
    posed_models.log(folder / "logs" / "poses.csv", 1, friction=(0.1, 0.05))
    return Nominal.of(path, folder / "logs")


def test_a_law_holds_where_dry_friction_does(arm):
    """The law acts as a spring of the joint in the model does."""
    friction = {"hinge_friction@elbow": [0.05, 0.0]}
    usual = arm.shown(**friction)
    law = "joint_torque of elbow: linear joint_angle of elbow"
    one = arm.shown(law, numbers(-0.4), **friction)
    two = arm.shown(**{"joint_elasticity@elbow": [0.4]}, **friction)
    assert np.nanmax(np.abs(two - usual)) > 0.005
    assert np.isfinite(one).all()
    assert one == pytest.approx(two, abs=1e-5)


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    """An arm whose shoulder is turned to known angles, and whose elbow's angle is measured."""
    folder = tmp_path_factory.mktemp("turned")
    path = posed_models.machine(folder)
    elbow = '[[measured]]\njoint = "elbow"\ncolumns = ["angle"]\nunit = "deg"\nnoise = 0.1\n'
    text = path.read_text().replace('actuator = "at_shoulder"', 'joint = "shoulder"') + elbow
    path.write_text(text)
    log = posed_models.log(folder / "logs" / "poses.csv", 1)
    head, *rows = log.read_text().splitlines()
    log.write_text("\n".join([f"{head},angle", *(f"{row},{n % 7}" for n, row in enumerate(rows))]))
    return Nominal.of(path, folder / "logs")


def test_places_of_a_model_with_prescribed_motion(turned):
    assert {(r.handle, r.place) for r in turned.places.responses} == {
        ("joint_torque", "elbow"), ("command", "at_elbow"), ("reading_shift", "elbow"),
        *((force, "lower") for force in FORCES),
    }  # fmt: skip
    for at in ("joint_torque of elbow: constant", "reading_shift of elbow: constant"):
        found = turned.changed(at, numbers(1e-3)) / 1e-3
        assert np.abs(found).max() > 0.1
        assert found == pytest.approx(turned.response(at).change[0], abs=1e-3)


def test_a_reading_shifts_from_an_instant_on(turned):
    pieces = turned.pieces
    found = turned.changed("reading_shift of elbow: above time of session", numbers(0.02, 10.5))
    true = np.zeros(found.shape)
    true[..., 3] = 0.02 * (pieces.time - pieces.time.min() > 10.5)
    assert found == pytest.approx(true, abs=1e-12)


@pytest.mark.parametrize(
    ("at", "says"),
    [
        ("joint_friction of elbow: constant", "acts in motion"),
        ("joint_torque of elbow: linear joint_velocity of elbow", "follows no joint velocity of elbow"),
        ("reading_shift of elbow: linear tension of elbow", "follows no tension of elbow"),
        ("joint_torque of wrist: constant", "no hinge, slide, tendon, body"),
        ("force of elbow: constant", "is none"),
    ],
)  # fmt: skip
def test_what_no_pose_can_honour_is_refused(arm, at, says):
    with pytest.raises(SerpentError, match=says):
        arm.shown(at, numbers(0.1))
