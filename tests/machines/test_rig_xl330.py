"""Test that the servo's rig finds the friction that logs were made with, and refuses unreadable logs."""

import numpy as np
import pytest
from measured_logs import DATA, WHERE, pendulum, write_log
from scipy.special import ellipk

from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.identification.free_parameters import free_parameters
from serpent_twin.identification.least_squares import fit
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.xl330 import MACHINE, Xl330
from serpent_twin.tables.log import Log

START = ParameterVector(np.zeros(4))
MEASURED = DATA / "xl330"
measured = pytest.mark.skipif(not MEASURED.is_dir(), reason=WHERE)


def runs(*made):
    """Runs as the rig cuts them, starting at rest."""
    case = MACHINE.open([])
    still = [columns | {"velocity": 0 * columns["time"]} for _, columns in made]
    several = zip(made, still, strict=True)
    return case, case.pieces([Log(None, about, columns) for (about, _), columns in several])


def test_off_and_without_friction_it_swings_like_a_pendulum():
    """Period 4 K(sin²(θ/2)) √(I / (m g l)), by the complete elliptic integral."""
    time, start = np.arange(0, 3, 0.005), 1.2
    none = np.zeros_like(time)
    about = {"mass": 0.49, "length": 0.1, "kp": 200, "vin": 7.4}
    columns = {"time": time, "position": none + start, "goal_position": none + 1,
               "torque_enable": none}  # fmt: skip
    _, some = runs((about, columns))
    angle = Xl330().respond([START], some)[0, 0, :, 0]
    crossing = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
    inertia = 0.49 * 0.1**2 + 1.7e-3
    expected = 4 * ellipk(np.sin(start / 2) ** 2) * np.sqrt(inertia / (0.49 * 9.81 * 0.1))
    assert np.diff(time[crossing]).mean() == pytest.approx(expected, abs=0.006)


def test_held_still_its_torque_carries_the_weight():
    """Statics: torque per volt × gain × error × supply = m g l sin θ."""
    time = np.arange(0, 4, 0.005)
    none = np.zeros_like(time)
    about = {"mass": 0.49, "length": 0.1, "kp": 200, "vin": 7.4}
    columns = {"time": time, "position": none, "goal_position": none + 0.5,
               "torque_enable": none + 1}  # fmt: skip
    _, some = runs((about, columns))
    damped = START.having("hinge_friction", np.array([0.0, 0.05]))
    angle = Xl330().respond([damped], some)[0, 0, -1, 0]
    duty = 200 * 4096 / (2 * np.pi) / 256 / 885 * (0.5 - angle)
    assert 0.104 * 7.4 * duty == pytest.approx(0.49 * 9.81 * 0.1 * np.sin(angle), rel=1e-3)


# MuJoCo delays a sensor by one time step at least.
@pytest.mark.parametrize("name", sorted(set(Xl330().candidates) - {"mocap_latency"}))
def test_a_vanishing_strength_leaves_the_nominal_twin(name):
    machine = Xl330()
    _, some = runs(pendulum(200, 0, 0, 0, seconds=0.5))
    values = [r.least for r in machine.candidates[name].ranges.values()]
    nearly = machine.respond([START.having(name, np.array(values))], some)
    np.testing.assert_allclose(nearly, machine.respond([START], some), atol=1e-5)


def test_frictions_of_an_integrated_servo_are_found_again():
    truth = {"hinge_friction": (0.03, 0.006), "gear_friction": (0.25,)}
    made = [pendulum(kp, 0.03, 0.006, 0.25, seed=n) for n, kp in enumerate((100, 150, 300, 300))]
    case, some = runs(*made)
    start = START
    for name, values in truth.items():
        start = start.having(name, 0.4 * np.array(values))
    found = fit(case, some, start, free_parameters(case, list(truth)), 6, 9)
    friction, viscous = found.point.effects["hinge_friction"]
    assert friction == pytest.approx(0.03, abs=0.006)
    assert viscous == pytest.approx(0.006, abs=0.004)
    assert found.point.effects["gear_friction"][0] == pytest.approx(0.25, abs=0.05)
    assert np.abs(found.point.declared[:3]).max() < 0.15


@pytest.mark.slow
def test_a_trace_names_what_was_put_in(tmp_path):
    """Four runs to fit, two of another P gain to judge."""
    gains = {"a_1": 100, "a_2": 100, "b_1": 400, "b_2": 400, "c_1": 200, "c_2": 200, "c_3": 200}
    for n, (name, kp) in enumerate(gains.items()):
        about, columns = pendulum(kp, 0.004, 0.002, 0.35, seed=n, seconds=6)
        write_log(tmp_path / "logs" / f"{name}.parquet", about, **columns)
    asked = Trace((tmp_path / "logs",), tmp_path / "out", rig="xl330", judge="c_*")
    found = trace(asked)
    assert found["effects"][0]["name"] == "gear_friction"
    assert not {"payload", "mocap_latency", "joint_elasticity"} & {
        e["name"] for e in found["effects"]
    }
    assert found["error_deg"]["corrected"] < 0.3 * found["error_deg"]["calibrated"]
    assert (tmp_path / "out" / "twin.xml").exists()


def test_refusals_say_what_to_do(tmp_path):
    with pytest.raises(SerpentError, match=r"no folder .*\. Name the folder"):
        MACHINE.read(tmp_path / "none")
    with pytest.raises(SerpentError, match=r"no \*\.parquet in .*\. Name the folder"):
        MACHINE.read(tmp_path)
    about, columns = pendulum(200, 0, 0, 0, seconds=1)
    path = tmp_path / "a.parquet"
    write_log(path, {k: v for k, v in about.items() if k != "kp"}, **columns)
    with pytest.raises(SerpentError, match=r"metadata: it lacks kp\. Name another --rig or --logs"):
        MACHINE.read(tmp_path)
    write_log(path, about, **(columns | {"position": columns["position"] * np.nan}))
    with pytest.raises(SerpentError, match=r"position are not finite .* Repair or leave out"):
        MACHINE.read(path)
    write_log(path, about, **(columns | {"time": columns["time"][::-1]}))
    with pytest.raises(SerpentError, match=r"time does not increase .* Repair or leave out"):
        MACHINE.read(path)
    path.write_bytes(b"no parquet")
    with pytest.raises(SerpentError, match=r"not a whole Parquet file.* Copy it again"):
        MACHINE.read(path)


def test_runs_of_unequal_length_lie_side_by_side():
    short, long = (pendulum(200, 0, 0, 0, seconds=s) for s in (1, 2))
    case, some = runs(short, long)
    assert some.measured.shape == (2, 400, 1) and np.isnan(some.measured[0, 200:]).all()
    compared = case.compare(None, some)
    assert len(compared) == 2 + 4 and np.isfinite(compared.marker_measured).all()


@measured
def test_frictions_and_saturation_halve_the_error_on_an_unseen_gain():
    """Fitted to P gains 100 and 800, judged at 200; the sketch had 2.45°, its authors 1.77°."""
    everything = MACHINE.read(MEASURED)
    training = [r for r in everything if not r.name.startswith("kp200")]
    judging = [r for r in everything if r.name.startswith("kp200")]
    case = MACHINE.open(training)
    names = ["gear_friction", "torque_saturation"]
    start = ParameterVector(
        np.zeros(4), {"gear_friction": np.array([0.3]), "torque_saturation": np.array([0.5])}
    )
    pieces, held_out = case.pieces(training), case.pieces(judging)
    case = case.reweighted(start, pieces)
    found = fit(case, pieces, start, free_parameters(case, names), 4, 9)
    off = np.degrees(np.nanmean(np.abs(case.compare(found.point, held_out).marker_residual)))
    assert off < 1.77
