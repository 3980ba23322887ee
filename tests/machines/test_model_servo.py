"""Test the XL330 that a machine.toml describes against scipy, and that its friction is found again."""

from dataclasses import replace

import numpy as np
import pytest
from measured_logs import DATA, WHERE, pendulum, write_log
from paths import ROOT
from scipy.special import ellipj, ellipk

from serpent_twin.identification import Trace, trace
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.proposing import propose
from serpent_twin.machines.model.starts import angle_of, rate_of
from serpent_twin.tables.segments import Stretch

TOML = ROOT / "experiments" / "measured" / "xl330" / "machine.toml"
MEASURED = DATA / "xl330"
FRICTION, GEARS, SATURATION = "hinge_friction@horn", "gear_friction@horn", "torque_saturation@servo"
RUBS = {"joint friction of horn": 0.01, "joint damping of horn": 0.002}
"""What the model has of each, of which the logarithm is fitted"""
measured = pytest.mark.skipif(not MEASURED.is_dir(), reason=WHERE)


def opened(folder, *made):
    """The machine and its sessions, from logs of columns; and its twin without friction."""
    for n, (about, columns) in enumerate(made):
        write_log(folder / f"{n}.parquet", about, **columns)
    rig = open_machine(TOML)
    runs = rig.read(folder)
    case = rig.open(runs)
    free = [-20.0 * (each.name in RUBS) for each in case.declared]
    whole = case.machine.stacked([Stretch.whole(run) for run in runs])
    return case, whole, ParameterVector(np.array(free))


def test_switched_off_it_swings_like_a_pendulum(tmp_path):
    """Period 4 K(sin²(θ/2)) √(I / (m g l)), by the complete elliptic integral."""
    time, start = np.arange(0, 3, 0.005), 1.2
    inertia = 0.3 * 0.15**2 + 1.7e-3
    stiffness = 0.3 * 9.81 * 0.15
    about = {"mass": 0.3, "length": 0.15, "kp": 200, "vin": 7.4}
    modulus = np.sin(start / 2)
    quarter = ellipk(modulus**2)
    sine, *_ = ellipj(quarter + np.sqrt(stiffness / inertia) * time, modulus**2)
    swing = 2 * np.arcsin(modulus * sine)
    columns = {"time": time, "position": swing, "goal_position": 0 * time + 1,
               "torque_enable": 0 * time}  # fmt: skip
    case, some, at = opened(tmp_path, (about, columns))
    angle = case.machine.respond([at], some)[0, 0, :, 0]
    crossing = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
    after = angle[crossing] / (angle[crossing] - angle[crossing + 1])
    expected = 4 * ellipk(np.sin(start / 2) ** 2) * np.sqrt(inertia / stiffness)
    assert np.diff(time[crossing] + 0.005 * after).mean() == pytest.approx(expected, rel=2e-3)


def test_held_still_its_torque_carries_the_weight(tmp_path):
    """Statics: stall torque per volt × gain × error × supply = m g l sin θ."""
    time = np.arange(0, 4, 0.005)
    about = {"mass": 0.49, "length": 0.1, "kp": 200, "vin": 7.4}
    columns = {"time": time, "position": 1e-4 * time, "goal_position": 0 * time + 0.5,
               "torque_enable": 0 * time + 1}  # fmt: skip
    case, some, at = opened(tmp_path, (about, columns))
    angle = case.machine.respond([at.having(FRICTION, np.array([0.0, 0.05]))], some)[0, 0, -1, 0]
    duty = 200 * 4096 / (2 * np.pi) / 256 / 885 * (0.5 - angle)
    assert 0.104 * 7.4 * duty == pytest.approx(0.49 * 9.81 * 0.1 * np.sin(angle), rel=1e-3)


def test_runs_of_unequal_length_lie_side_by_side(tmp_path):
    case, some, _ = opened(tmp_path, *(pendulum(200, 0, 0, 0, seconds=s) for s in (1, 2)))
    assert some.measured.shape == (2, 400, 1) and np.isnan(some.measured[0, 200:]).all()
    compared = case.compare(None, some)
    assert len(compared) == 2 + 4 and np.isfinite(compared.marker_measured).all()


@pytest.mark.parametrize(
    ("law", "truth"),
    [
        ({}, {}),
        ({FRICTION: (0.0, 0.03)}, {"viscous": 0.03}),
        ({FRICTION: (0.02, 0.0)}, {"coulomb": 0.02}),
        ({GEARS: (0.3,)}, {"share": 0.3}),
        ({SATURATION: (1.5,)}, {"saturation": 1.5}),
        ({GEARS: (0.2,), SATURATION: (1.0,)}, {"share": 0.2, "saturation": 1.0}),
    ],
    ids=["none", "viscous", "Coulomb", "gears", "saturation", "both"],
)
def test_it_moves_as_integrated_by_scipy(law, truth, tmp_path):
    friction = {"coulomb": 0.0, "viscous": 0.0, "share": 0.0} | truth
    case, some, at = opened(tmp_path, *(pendulum(kp, **friction, seed=kp) for kp in (150, 900)))
    for name, values in law.items():
        at = at.having(name, np.array(values))
    for start in (angle_of("horn"), rate_of("horn")):  # as the integration starts
        some.column[start][:, 0] = 0.0
    machine = replace(case.machine, steps=8)
    off = machine.respond([at], some)[0] - some.measured
    assert np.sqrt(np.nanmean(off**2)) < 2e-3  # rad: the encoder's count is 1.5e-3


def test_twins_side_by_side_are_those_alone(tmp_path):
    case, some, at = opened(tmp_path, *(pendulum(kp, 0, 0, 0, seconds=1) for kp in (100, 300)))
    several = [at.having(GEARS, np.array([share])) for share in (0.1, 0.3)]
    together = case.machine.respond(several, some)
    alone = [case.machine.respond([each], some)[0] for each in several]
    np.testing.assert_allclose(together, alone, atol=1e-12)


def test_a_vanishing_strength_leaves_the_nominal_twin(tmp_path):
    case, some, at = opened(tmp_path, pendulum(200, 0, 0, 0, seconds=0.5))
    machine = replace(case.machine, steps=16)  # as many where commands change between rows
    nominal = machine.respond([at], some)
    for name, each in case.candidates.items():
        values = [r.least for r in each.ranges.values()]
        nearly = machine.respond([at.having(name, np.array(values))], some)
        np.testing.assert_allclose(nearly, nominal, atol=1e-5, err_msg=name)


@pytest.mark.slow
def test_frictions_of_an_integrated_servo_are_found_again(tmp_path):
    made = [pendulum(kp, 0.03, 0.006, 0.25, seed=n) for n, kp in enumerate((100, 150, 300, 300))]
    case, some, _ = opened(tmp_path, *made)
    start = ParameterVector.nominal(case.declared, {GEARS: np.array([0.1])})
    free = free_parameters(case, [GEARS])
    found = fit(case, some, start, free, 6, 9)
    for _ in range(2):  # by what a start leaves, priors count as much as these few logs
        case = case.weighed_by(found.residual, case.take(some, found.used))
        found = fit(case, some, found.point, free, 6, 9)
    at = dict(zip([each.name for each in case.declared], found.point.declared, strict=True))
    friction, viscous = (of * np.exp(at[name]) for name, of in RUBS.items())
    assert friction == pytest.approx(0.03, abs=0.006)
    assert viscous == pytest.approx(0.006, abs=0.004)
    assert found.point.effects[GEARS][0] == pytest.approx(0.25, abs=0.05)


@pytest.mark.slow
def test_a_trace_names_what_was_put_in(tmp_path):
    """Four runs to fit, two of another P gain to judge."""
    gains = {"a_1": 100, "a_2": 100, "b_1": 400, "b_2": 400, "c_1": 200, "c_2": 200, "c_3": 200}
    for n, (name, kp) in enumerate(gains.items()):
        about, columns = pendulum(kp, 0.004, 0.002, 0.35, seed=n, seconds=6)
        write_log(tmp_path / "logs" / f"{name}.parquet", about, **columns)
    asked = Trace((tmp_path / "logs",), tmp_path / "out", machine=TOML, judge="c_*", discover=False)
    found = trace(asked)
    names = [each["name"] for each in found["effects"]]
    assert names[0] == GEARS and not {"payload@mass", "joint_elasticity@horn"} & {*names}
    assert found["error_deg"]["corrected"] < 0.3 * found["error_deg"]["calibrated"]


@measured
@pytest.mark.slow
def test_frictions_and_saturation_halve_the_error_on_an_unseen_gain():
    """Fitted to P gains 100 and 800, judged at 200; the sketch had 2.45°, its authors 1.77°."""
    rig = open_machine(TOML)
    everything = rig.read(MEASURED)
    training = [r for r in everything if not r.name.startswith("kp200")]
    judging = [r for r in everything if r.name.startswith("kp200")]
    case = rig.open(training)
    start = ParameterVector.nominal(
        case.declared, {GEARS: np.array([0.3]), SATURATION: np.array([0.5])}
    )
    pieces, held_out = case.pieces(training), case.pieces(judging)
    case = case.reweighted(start, pieces)
    found = fit(case, pieces, start, free_parameters(case, [GEARS, SATURATION]), 4, 9)
    off = np.degrees(np.nanmean(np.abs(case.compare(found.point, held_out).marker_residual)))
    assert off < 1.5


def test_a_motion_is_proposed_for_a_machine_that_is_on_and_has_the_models_numbers(tmp_path):
    made = [pendulum(kp, 0.02, 0.03, 0.1, seed=kp) for kp in (150, 300)]
    case, _, at = opened(tmp_path, *made)
    damped = at.having(FRICTION, np.array([0.01, 0.05]))
    found = propose(case.machine, damped, 2, 3.0, 200.0, np.random.default_rng(0))
    assert len(found.kinds) == 2 and [each.name for each in found.columns] == ["goal_position"]
    assert np.isfinite(case.machine.respond([damped], found.pieces)).all()
