"""Composed laws: found again in made residuals, silent on noise; the arm's places against its simulation."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_residual import Made, S, T
from paths import DATA

from serpent_twin import machines
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import HANDLES, Law, parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery import steps_alike
from serpent_twin.identification.discovery.candidates import candidate_of
from serpent_twin.identification.discovery.followed import around
from serpent_twin.identification.discovery.rows_in_time import RowsInTime
from serpent_twin.identification.estimates import ParameterEstimate
from serpent_twin.identification.first_guess import guessed
from serpent_twin.identification.wording import spaced, with_numbers
from serpent_twin.machines.machine import ParameterVector, effect_at
from serpent_twin.machines.places import PlaceResponse
from serpent_twin.machines.rig import read_logs

SIZE_NAMES = ("size", "size_y", "size_z", "stiffness")
LAWS = (
    Discovered(0.3, at="joint_torque of joint1: above joint_angle of joint1", first=0.2),
    Discovered(
        0.4, at="joint_torque of joint1: within joint_angle of joint1", first=-0.3, second=0.7
    ),
    Discovered(-0.4, at="slack of cable1_plus: beyond joint_angle of joint1", first=0.1),
    Discovered(0.2, -0.1, 0.3, at="force of link3: constant"),
    Discovered(
        0.2, -0.1, 0.3, at="force of link3: periodic time of session", first=2.7, second=0.6
    ),
    Discovered(0.3, at="slack of cable1_plus: above runtime of machine", first=90.0),
    Discovered(
        0.3, at="joint_torque of joint1: periodic motor_angle of motor1", first=3.0, second=1.0
    ),
    Discovered(0.8, at="joint_torque of joint1: play joint_angle of joint1", first=0.9),
    Discovered(0.8, at="joint_torque of joint1: lag joint_angle of joint1", first=0.7),
)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.at)
def test_a_law_that_made_a_residual_is_found_first(law):
    best = Made(law).found()[0]
    wanted = law.law
    clocks = ("time", "runtime")  # the same in these sessions
    alike = best.law.reading in clocks and wanted.reading in clocks
    assert best.law == wanted or (
        alike
        and (best.law.handle, best.law.place, best.law.shape)
        == (wanted.handle, wanted.place, wanted.shape)
    )
    made = Made(law)
    x = made.readings.get((wanted.reading, wanted.where), np.zeros((S, T)))
    rows = RowsInTime.among(made.readings)
    found, there = (
        np.outer(size, rows.followed(SHAPES[wanted.shape], x, first, second)).ravel()
        for size, first, second in (
            (best.size, best.first, best.second),
            ([law.size, law.size_y, law.size_z][: best.size.size], law.first, law.second),
        )
    )
    assert np.linalg.norm(found - there) < 0.45 * np.linalg.norm(there)
    whole = (made.fit.residual**2).sum()
    assert best.gain == pytest.approx(-whole * np.log(1 - best.share), rel=1e-6)


def test_a_wave_is_measured_by_what_free_parameters_leave_of_it():
    """The sine and the cosine of a part of a turn are alike beside a free mean, and are solved together."""
    wave = "joint_torque of joint1: periodic motor_angle of motor2"
    made = Made(Discovered(1.0, at=wave, first=3.0, second=-0.4), noise=0.05)
    made.fit.jacobian[0] = made.responses[0].change[0].reshape(S, -1)
    best = made.found()[0]
    assert str(best.law) == wave
    assert (best.first, best.second) == pytest.approx((3.0, -0.4), abs=0.02)
    assert best.size == pytest.approx([1.0], rel=0.01)


@pytest.mark.parametrize(
    ("rows", "known", "told"),
    [
        (np.linspace(0.0, 3.0, 3001), {"within": (0.52, 0.38)}, []),
        (np.linspace(0.0, 3.0, 3001), {"within": (0.52, 2.38)}, ["within"]),
        (np.r_[np.linspace(0.0, 1.6, 3001), 2.0, 3.0], {}, ["within"]),
    ],
    ids=["amid the rows", "hardly before the last", "beyond nearly all, unknown to first order"],
)
def test_simulations_tell_a_step_from_a_window_by_where_it_ends(rows, known, told):
    """Rows show a torque from 0.5 on; a window may end amid them, or where hardly any is left."""
    step = "joint_torque of joint1: above joint_angle of joint1"

    def residual(points, some):
        out = np.array([np.ones(rows.size)] * len(points)) * (rows > 0.5)
        for row, point in zip(out, points, strict=True):
            for name, values in point.effects.items():
                law = parse(name.split("@")[1])
                row -= values[0] * SHAPES[law.shape].form(rows, *values[4:6])
        return out[:, None]

    candidate = SimpleNamespace(composed={"law": "above"}, alike=known)
    case = SimpleNamespace(
        take=lambda pieces, used: pieces,
        residual=residual,
        candidates={f"discovered@{step}": candidate},
    )
    values = np.array([1.0, 0, 0, 0, 0.5, 0.0, 0.0, 3.0])
    point = ParameterVector(np.zeros(1)).having(f"discovered@{step}", values)
    fit = SimpleNamespace(point=point, used=(0,), variance_inflation=4.0)
    assert [law.shape for law in steps_alike(case, None, fit, f"discovered@{step}")] == told


def test_shapes_that_differ_beyond_the_readings_are_alike():
    """A window that ends where the logs do is a step to them; one that ends amid them is not."""
    step = Discovered(0.5, at="joint_torque of joint1: above joint_angle of joint1", first=0.2)
    window = Discovered(
        0.5, at="joint_torque of joint1: within joint_angle of joint1", first=-0.3, second=0.6
    )
    assert "within" in Made(step).found()[0].alike
    found = Made(window).found()[0]
    assert found.law == window.law
    assert "above" not in found.alike and "under" not in found.alike


def test_noise_alone_is_worth_nothing():
    """The best of all laws removes no more than chance makes of so many."""
    most = [Made(Discovered(0.0, at="force of link3: constant"), n).found()[:1] for n in range(5)]
    assert max(each.worth for found in most for each in found) < 30


def test_what_a_declared_parameter_takes_up_is_not_composed():
    found = Made(LAWS[3], knows=True).found()
    assert not found or found[0].law != LAWS[3].law or found[0].share < 0.01


@pytest.mark.parametrize("shape", ["under", "above", "within"])
def test_a_law_is_not_of_the_first_rows_alone(shape):
    """What the first two of 500 rows of each log are off by is no law; from one in a hundred rows on it may
    be one.
    """
    x = np.tile(0.02 * np.arange(500.0), (4, 1))
    law = Law("force", "tip", shape, "runtime", "machine")
    tried = around(law, 0.1, 0.2, {("runtime", "machine"): x})
    held = [np.mean(SHAPES[way.shape].form(x, way.first, way.second)) for way in tried]
    assert min(held) > 0.009 and max(held) < 0.991
    if shape != "above":
        assert min(held) < 0.03


def test_a_candidate_of_a_law_starts_where_it_was_found():
    made = Made(LAWS[0])
    best = made.found()[0]
    candidate = candidate_of(best, made.readings, best.law.units())
    assert list(candidate.ranges)[:5] == [*SIZE_NAMES, "threshold"]
    effect = effect_at(candidate.name, candidate.variants[0])
    assert (effect.size, effect.first) == (best.size[0], best.first)
    x = made.readings["joint_angle", "joint1"]
    assert (effect.least, effect.most) == (x.min(), x.max())
    assert candidate.place["name"] == "discovered"
    assert candidate.place["place"] == {"kind": "joint", "name": "joint1"}
    assert candidate.place["depends_on"] == ["joint angle of joint1"]


def test_a_law_in_words():
    name = "discovered@joint_torque of joint1: above joint_angle of joint3"
    assert (
        spaced(name) == "a torque at joint1, while the joint angle of joint3 is above a threshold"
    )
    assert with_numbers("payload", {}) == "payload ()"
    forces = {
        f"size_{axis}": ParameterEstimate(v, v - 0.1, v + 0.1, "N")
        for axis, v in (("x", 1.0), ("y", -2.0), ("z", 0.0))
    }
    spring = {**forces, "stiffness": ParameterEstimate(10.0, 9.0, 11.0, "N/m")}
    told = with_numbers("discovered@spring of link7: constant", spring)
    assert told.startswith("a spring of 10 N/m [9 … 11] that pulls link7 to")
    assert "(0.100 ± 0.014, −0.200 ± 0.022, 0.000 ± 0.010) m" in told


PLACED = {  # along y; least cosine to what a simulation makes of it: hinges stick and slide
    "force of link7: constant": 0.9,
    "acceleration of base: constant": 0.9,
    "joint_torque of joint2: constant": 0.8,
    "winch_angle of motor4: constant": 0.9,
    "slack of cable5_plus: constant": 0.9,
    "gear_friction of motor3: constant": 0.999,
    "motor_torque of motor3: constant": 0.999,
    "marker_shift of marker4: constant": 0.999,
    "camera_shift of base: constant": 0.999,
    "load_shift of motor2_load: constant": 0.999,
    "load_scale of motor2_load: constant": 0.999,
    "link_turn of link4: constant": 0.999,
    "camera_turn of base: constant": 0.999,
    "camera_delay of base: constant": 0.999,
}
SIZES = {
    "force": 0.2,
    "acceleration": 0.5,
    "slack": 3e-4,
    "marker_shift": 1e-3,
    "camera_shift": 1e-3,
}


def changed(response, component, size):
    """Change of the prediction by a constant change of one component, (S, T, C)."""
    if isinstance(response, PlaceResponse):
        return size * response.change[component]
    follows = np.full((1, *response.own.shape[1:3]), size)
    return [*response.of(follows)][component][0]


@pytest.mark.slow
def test_the_arms_places_show_what_a_simulation_shows():
    """Direction and size, of the first guess of a logged arm, over 40 s."""
    rig = machines.find("arm")
    sessions = read_logs(rig, (DATA / "arm_a",))[:1]
    case = guessed(rig.open(sessions), sessions, lambda _: None)
    pieces, arm = case.pieces(sessions).take([1]), case.machine
    point = ParameterVector.nominal(arm.declared)
    places = arm.responses_at_places(point, pieces)
    shown = {(r.handle, r.place): r for r in places.responses}
    before = arm.respond([point], pieces)[0]
    weight = np.where(np.isfinite(pieces.measured), 1 / case.noise, 0.0)
    for at, least in PLACED.items():
        law = Discovered(at=at).law
        component, size = HANDLES[law.handle].components // 2, SIZES.get(law.handle, 0.02)
        values = np.zeros(8)
        values[component] = size
        change = arm.respond([point.having(f"discovered@{at}", values)], pieces)[0] - before
        told = changed(shown[law.handle, law.place], component, size)
        one, two = ((each * weight).ravel() for each in (change, told))
        cosine = one @ two / np.linalg.norm(one) / np.linalg.norm(two)
        assert cosine > least, (at, cosine)
        assert np.linalg.norm(two) == pytest.approx(np.linalg.norm(one), rel=0.4), at


def test_rows_follow_each_other_within_their_session_alone():
    """Two sessions: the first in two segments that share rows, the second in two that are apart."""
    time = 0.5 * (np.arange(6) + np.array([[0], [4], [0], [9]]))
    readings = {
        ("time", "session"): time,
        ("joint_velocity", "joint1"): np.ones((4, 6)),
    }
    rows = RowsInTime.among(readings)
    assert rows.period == 0.5
    assert [len(each) for each in rows.stretches] == [10, 6, 6]
    x = np.random.default_rng(2).normal(size=(30,))
    sessions = np.stack([x[:6], x[4:10], x[10:16], x[19:25]])
    found = rows.seen(SHAPES["lag"], sessions, 0.8)
    whole = SHAPES["lag"].drags.behind(x[:10], 0.8, 0.5)
    assert found[:2] == pytest.approx(np.stack([whole[:6], whole[4:]]))
    alone = RowsInTime.among({name: each[2:3] for name, each in readings.items()})
    assert found[2] == pytest.approx(alone.seen(SHAPES["lag"], sessions[2:3], 0.8)[0])
    assert RowsInTime.among({("time", "session"): time}).period == 0.0  # at rest
