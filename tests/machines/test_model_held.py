"""Test rows of torque beside equations of motion that know nothing of MuJoCo."""

import held_models
import mujoco
import numpy as np
import pytest
from example import assert_named_alone, opened
from held_models import EXAMPLE, TOML, motion, torques

from serpent_twin.effects import ranges
from serpent_twin.effects.discovered import Discovered
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.held_motion import with_smoothed
from serpent_twin.machines.model.known_motion import STANDING
from serpent_twin.machines.model.masses import state_all
from serpent_twin.machines.model.numbers import change_number
from serpent_twin.machines.rig import NOTES, read_logs


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """The arm with exact readings: its case, pieces and nominal parameters."""
    folder = tmp_path_factory.mktemp("arm")
    log = held_models.log(folder / "log.csv", 0, step=0.0, noise=0.0)
    return opened(EXAMPLE.write(folder), log)


def shown(arm, name="", *values):
    """Torques that a twin needs [N m], (S, T, 2)."""
    case, pieces, at = arm
    point = at.having(name, np.array(values)) if name else at
    return case.machine.respond([point], pieces)[0]


def test_torques_are_those_of_the_equations_of_motion(arm):
    """Rates and accelerations are by differences over rows: 3e-4 of the torque."""
    off = arm[1].measured - shown(arm)
    assert np.nanmax(np.abs(off)) < 1e-3 < 1e-3 * np.nanmax(np.abs(arm[1].measured))


def test_a_torque_does_not_count_where_its_joint_reverses(tmp_path):
    """A filter rounds off what friction does to the motion there, and not what it does to the torque."""
    rough = opened(EXAMPLE.write(tmp_path), held_models.log(tmp_path / "log.csv", 0))
    of_all = rows_of(rough, 1), np.isfinite(rough[1].measured)
    rate, known = (each.reshape(-1, 2) for each in of_all)
    turns = np.diff(np.signbit(rate), axis=0)
    assert np.all(turns.sum(axis=0) > 10)
    assert not (known[1:] & known[:-1])[turns].any()
    assert np.all(known.mean(axis=0) > 0.6)


def test_files_given_one_by_one_are_filtered_alike(tmp_path):
    """The noise of one log's encoders would leave it fewer rows than the other."""
    rig = open_machine(EXAMPLE.write(tmp_path))
    steps = {"fine": 1e-6, "coarse": 5e-3}
    logs = [held_models.log(tmp_path / f"{n}.csv", 0, step=step) for n, step in steps.items()]
    fine, coarse = (rig.read(log)[0].period for log in logs)
    one, other = (log.period for log in read_logs(rig, logs))
    assert fine < one == other <= coarse


def test_every_row_is_kept_below_a_highest_cutoff(tmp_path):
    rig = open_machine(EXAMPLE.write(tmp_path))
    logs = rig.recorded(held_models.log(tmp_path / "log.csv", 0))
    usual, low = (with_smoothed(rig.described, logs, hz)[0] for hz in (np.inf, 2.0))
    (every,) = with_smoothed(rig.described, logs, every_row=True)
    assert "shoulder 2 Hz, elbow 2 Hz" in low.metadata[NOTES][-1]
    assert len(low) < len(usual) < len(every) == len(logs[0])
    lost = [np.isnan(run.columns["i1"]).mean() for run in (usual, every)]
    assert lost[1] < 0.5 * lost[0]


def rows_of(arm, column):
    """Angle, rate or acceleration of both joints in the rows of the pieces, (S, T, 2)."""
    pieces = arm[1]
    at = np.rint(pieces.time / held_models.PERIOD).astype(int)
    return motion(0)[column][at]


def rubs_by_load(q, v, a):
    """Friction of the elbow's gear, a fifth of all that its link takes, what accelerates it included."""
    load = torques(*(of.reshape(-1, 2) for of in (q, v, a))).reshape(v.shape)[..., 1]
    return np.stack([0 * load, 0.2 * np.abs(load) * np.tanh(v[..., 1] / STANDING)], -1)


@pytest.mark.parametrize(
    ("name", "values", "needs"),
    [
        ("joint_elasticity@shoulder", (1.5,), lambda q, v, a: np.stack([1.5 * q[..., 0], 0 * q[..., 0]], -1)),
        ("rotor_inertia@elbow", (0.02,), lambda q, v, a: np.stack([0 * a[..., 1], 0.02 * a[..., 1]], -1)),
        ("hinge_friction@elbow", (0.0, 0.1), lambda q, v, a: np.stack([0 * v[..., 1], 0.1 * v[..., 1]], -1)),
        ("gear_friction@elbow", (0.2,), rubs_by_load),
    ],
)  # fmt: skip
def test_an_effect_needs_the_torque_that_it_says(arm, name, values, needs):
    found = shown(arm, name, *values) - shown(arm)
    true = needs(*(rows_of(arm, n) for n in range(3)))
    assert np.abs(true).max() > 0.05
    known = np.isfinite(arm[1].measured)
    np.testing.assert_allclose(found[known], true[known], atol=2e-3 * np.abs(true).max())


def test_a_coupled_drive_bears_upon_the_joint_before(arm):
    """The motor's angle is that of the log, the elbow's is what the shoulder's leaves of it."""
    known, of_motors = np.isfinite(arm[1].measured), [rows_of(arm, n) for n in range(3)]
    found = shown(arm, "drive_coupling@elbow", 0.4)
    joints = [(each @ [[1, -0.4], [0, 1]]).reshape(-1, 2) for each in of_motors]
    true = (torques(*joints) @ [[1, 0], [-0.4, 1]]).reshape(found.shape)
    np.testing.assert_allclose(found[known], true[known], atol=1e-3 * np.abs(true[known]).max())


def test_friction_of_a_coupled_drive_follows_the_motor(arm):
    """It holds the motor back, and so the elbow, and pushes the shoulder by none of it."""
    case, pieces, at = arm
    coupled = at.having("drive_coupling@elbow", np.array([0.4]))
    rubs = coupled.having("hinge_friction@elbow", np.array([0.0, 0.1]))
    both, alone = case.machine.respond([rubs, coupled], pieces)
    true, known = 0.1 * rows_of(arm, 1)[..., 1], np.isfinite(pieces.measured[..., 1])
    np.testing.assert_allclose((both - alone)[known, 1], true[known], atol=2e-4)
    np.testing.assert_allclose((both - alone)[..., 0], 0.0, atol=1e-12)


def test_the_first_joint_is_coupled_with_none(arm):
    """Only the elbow has a joint before it."""
    names = [name for name in arm[0].candidates if name.startswith("drive_coupling")]
    assert names == ["drive_coupling@elbow"]
    with pytest.raises(SerpentError, match="no joint is before this one"):
        shown(arm, "drive_coupling@shoulder", 0.4)


@pytest.mark.parametrize(
    "handle", ["joint_torque", "joint_friction", "force", "force_in_body", "spring"]
)
def test_what_a_change_shows_at_a_place_is_what_a_twin_with_it_does(arm, handle):
    case, pieces, at = arm
    places = case.places(at, pieces)
    of = next(each for each in places.responses if each.handle == handle)
    size = np.array([0.1, -0.2, 0.3, 0.5])[: len(of.change)]
    values = np.zeros(len(ranges(Discovered)))
    values[: len(size)] = size
    found = shown(arm, f"discovered@{of.handle} of {of.place}: constant", *values) - shown(arm)
    change = np.tensordot(size, of.change, 1)
    np.testing.assert_allclose(found, change, atol=1e-9 + 1e-6 * np.abs(change).max())


def test_mass_that_is_spread_otherwise_is_a_body_that_may_exist():
    """The second moments of a body that is deformed are those of its grains."""
    box = "<body name='a'><joint/><geom type='box' size='.1 .2 .3' pos='.1 0 .2' euler='10 20 30'/></body>"
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{box}</worldbody></mujoco>")
    before = spec.compile()
    state_all(spec, before)
    change_number(spec, "spread x", 1, 1.3)
    change_number(spec, "shear xy", 1, 0.2)
    after = spec.compile()
    affine = np.array([[1.3, 0.2, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(
        second(after), affine @ second(before) @ affine.T, rtol=1e-12, atol=1e-9
    )
    np.testing.assert_array_equal(after.body_ipos, before.body_ipos)


def second(model):
    """Second moments of the mass of the first body about its centre of mass, (3, 3)."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[1])
    inertia, axes = model.body_inertia[1], turn.reshape(3, 3)
    return axes @ np.diag(inertia.sum() / 2 - inertia) @ axes.T


def test_a_scale_of_a_torque_is_fitted_where_one_is_asked_for(tmp_path, arm):
    (tmp_path / "machine").mkdir()
    path = EXAMPLE.write(tmp_path / "machine")
    path.write_text(TOML.replace("scale = 0.05 }", "scale = 0.05, ratio = 0.1 }"))
    case, pieces, at = opened(path, held_models.log(tmp_path / "log.csv", 0, step=0.0, noise=0.0))
    n = [each.name for each in case.declared].index("scale of i1")
    moved = at.after(0.1 * (np.arange(len(case.declared)) == n))
    found = case.machine.respond([moved], pieces)[0] / case.machine.respond([at], pieces)[0]
    np.testing.assert_allclose(found[..., 0], np.exp(-0.1), rtol=1e-9)
    np.testing.assert_allclose(found[..., 1], 1.0, rtol=1e-9)


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ('    { joint = "elbow", columns = ["q2"], unit = "deg" },\n', "", "whose angle no column has"),
        ('{ actuator = "at_elbow", columns', '{ joint = "shoulder", columns', "measured already"),
        ('{ actuator = "at_elbow", columns = ["i2"], unit = "N m", scale = 0.04 }',
         '{ sensor = "gyro", columns = ["i2"], unit = "rad/s" }', "gyro"),
        ('rows = "torque"', 'rows = "motion"', "drive is missing"),
        ('{ joint = "elbow", columns = ["q2"]', '{ columns = ["q2"]', "must name exactly one"),
        ("measured = [", 'drive = [{ joint = "elbow", column = "goal" }]\nmeasured = [', "Measure every"),
    ],
)  # fmt: skip
def test_a_wrong_description_is_refused(tmp_path, before, after, says):
    path = EXAMPLE.write(tmp_path)
    assert before in TOML
    path.write_text(TOML.replace(before, after))
    with pytest.raises(SerpentError, match=says):
        open_machine(path)


@pytest.mark.parametrize(
    ("scale", "says"),
    [
        ("2.0", "'i2' of log would fit the model's joint elbow if it were 0.02 times as large"),
        ("-0.04", "'i2' of log would fit .* with the other sign"),
    ],
)
def test_a_torque_without_its_gear_or_with_the_other_sign_is_refused(tmp_path, scale, says):
    path = EXAMPLE.write(tmp_path)
    path.write_text(TOML.replace("scale = 0.04", f"scale = {scale}"))
    with pytest.raises(SerpentError, match=says):
        opened(path, held_models.log(tmp_path / "log.csv", 0))


def friction(q, v, a):
    """Torque against friction of the elbow [N m], (T, 2)."""
    return np.c_[0 * v[:, 0], 0.1 * np.sign(v[:, 1]) + 0.02 * v[:, 1]]


def heavier(q, v, a):
    """Torque for 0.2 kg more at the tip [N m], (T, 2)."""
    return torques(q, v, a, masses=(1.2, 1.0)) - torques(q, v, a)


@pytest.mark.slow
def test_friction_is_named_with_its_size(tmp_path):
    found = EXAMPLE.traced(tmp_path, 3, more=friction)
    assert_named_alone(found, "hinge_friction@elbow", "coulomb", 0.1)


def both_rub(q, v, a):
    """Torque against friction of both motors [N m], (T, 2): dry alone, and dry and viscous."""
    return np.c_[0.15 * np.sign(v[:, 0]), 0.1 * np.sign(v[:, 1]) + 0.02 * v[:, 1]]


def test_all_that_is_missing_is_named_at_once(tmp_path):
    """Friction of both joints and the coupling of a drive, none of which is all; gears that rub by their load
    would be nearly as good at first sight, whose friction is tried at one ratio of dry to viscous.
    """
    found = EXAMPLE.traced(tmp_path, 3, more=both_rub, coupled=0.4, rows=1000)
    named = {each["name"]: each["parameters"] for each in found["effects"]}
    truth = {
        ("hinge_friction@shoulder", "coulomb"): 0.15,
        ("hinge_friction@elbow", "coulomb"): 0.1,
        ("hinge_friction@elbow", "viscous"): 0.02,
        ("drive_coupling@elbow", "coefficient"): 0.4,
    }
    assert {*named} == {name for name, _ in truth}
    for (name, number), size in truth.items():
        about = named[name][number]
        assert about["low"] < size < about["high"]
        assert about["value"] == pytest.approx(size, rel=0.15)


@pytest.mark.slow
def test_a_clean_arm_lacks_nothing(tmp_path):
    found = EXAMPLE.traced(tmp_path, 3)
    assert found["effects"] == [] and found["moved"] == [] and not found["unexplained"]["is"]


@pytest.mark.slow
def test_a_heavier_tip_is_a_mass_that_is_fitted(tmp_path):
    found = EXAMPLE.traced(tmp_path, 3, more=heavier)
    assert found["effects"] == [] and not found["unexplained"]["is"]
    mass = found["calibration"]["mass of lower"]
    assert mass["low_kg"] <= 1.0 <= mass["high_kg"] < 1.01


def within_a_window(q, v, a):
    """Dry friction of the shoulder, and of the elbow while it is bent by −0.1 … 0.3 rad [N m], (T, 2)."""
    bent = (q[:, 1] > -0.1) & (q[:, 1] < 0.3)
    return np.c_[0.15 * np.sign(v[:, 0]), 0.2 * np.sign(v[:, 1]) * bent]


@pytest.mark.slow
def test_a_law_takes_the_place_of_one_of_several_names(tmp_path):
    """Friction of the whole elbow imitates friction in a window until the law is found."""
    found = EXAMPLE.traced(tmp_path, 3, more=within_a_window)
    names = {each["name"]: each for each in found["effects"]}
    assert {*names} == {"hinge_friction@shoulder", "discovered"}
    law = names["discovered"]
    assert (law["place"]["name"], law["changes"], law["law"]) == (
        "elbow",
        "joint_friction",
        "within",
    )
    about = law["parameters"]["size"]
    assert about["low"] < 0.2 < about["high"]
