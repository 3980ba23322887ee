"""Test that the jaw's rig finds the cables and friction that logs were made with."""

from itertools import product

import numpy as np
import pytest
from measured_logs import DATA, WHERE, jaw, write_log

from serpent_twin.errors import SerpentError
from serpent_twin.identification.free_parameters import free_parameters
from serpent_twin.identification.least_squares import fit
from serpent_twin.machines.jaw import MACHINE
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.tables.log import Log

MEASURED = DATA / "jaw"
measured = pytest.mark.skipif(not MEASURED.is_dir(), reason=WHERE)
START = ParameterVector(np.zeros(4))


def opened(*made):
    """The rig's case on runs made by `jaw`, and the runs."""
    several = [Log(None, about, columns) for about, columns in made]
    case = MACHINE.open(several)
    return case, case.pieces(several)


def of(**effects):
    """A twin with effects by name."""
    return ParameterVector(
        np.zeros(4), {name: np.array(values) for name, values in effects.items()}
    )


def test_rigid_and_without_friction_the_jaw_turns_with_the_spindle():
    case, some = opened(jaw(0.2, 0.0, 1e-6, 1e-6, 0.0, 0.0, seconds=4))
    angle, torque = np.moveaxis(case.machine.respond([START], some)[0, 0], -1, 0)
    np.testing.assert_allclose(
        angle, case.machine.zero - some.column["spindle_position"][0], atol=2e-3
    )
    assert np.abs(torque).max() < 1e-3


def test_a_loaded_cable_stretches_by_hooke_and_friction_resists_by_coulomb():
    case, some = opened(jaw(0.2, 0.03, 1e-6, 1e-6, 0.0, 0.0, seconds=4))
    stretched = case.machine.respond([of(cable_stretch=[0.8])], some)[0, 0, 100:, 0]
    rigid = case.machine.respond([START], some)[0, 0, 100:, 0]
    load = some.column["jaw_torque"][0, 100:]
    np.testing.assert_allclose(stretched - rigid, 0.8 * load, atol=1e-3)
    rubbed = case.machine.respond([of(hinge_friction=[0.05, 0.0])], some)[0, 0, :, 1]
    speed = np.gradient(some.column["spindle_position"][0], 0.01)
    moving = np.abs(speed) > 0.05
    resists = rubbed - case.machine.respond([START], some)[0, 0, :, 1]
    np.testing.assert_allclose(resists[moving], -0.05 * np.sign(speed[moving]), atol=3e-3)


def test_stretch_on_both_sides_and_friction_are_found_again():
    """Against the play operator, which knows neither MuJoCo nor inertia."""
    pairs = product((0.15, 0.4), (0.012, 0.04))
    made = [jaw(f, load, 0.05, 0.35, 1.3, 0.02, seed=n) for n, (f, load) in enumerate(pairs)]
    case, some = opened(*made)
    start = of(
        cable_stretch=[0.8],
        shaft_stretch=[0.5],
        hinge_friction=[0.03, 0.0],
        joint_elasticity=[0.01],
    )
    case = case.reweighted(start, some)
    found = fit(case, some, start, free_parameters(case, list(start.effects)), 5, 9)
    effects = {name: values[0] for name, values in found.point.effects.items()}
    scale = np.exp(found.point.declared[3])  # load and compliance are told together
    assert effects["cable_stretch"] * scale == pytest.approx(1.3, rel=0.1)
    assert effects["shaft_stretch"] == pytest.approx(0.35, rel=0.1)
    assert effects["hinge_friction"] == pytest.approx(0.05, rel=0.1)
    assert np.exp(found.point.declared[0]) == pytest.approx(0.92, rel=0.02)


def test_lost_motion_is_the_play_operator():
    case, some = opened(jaw(0.2, 0.0, 1e-6, 1e-6, 0.0, 0.0, seconds=6))
    gap = 0.06
    angle = case.machine.respond([of(gear_backlash=[gap])], some)[0, 0, :, 0]
    spindle = some.column["spindle_position"][0]
    lag = case.machine.zero - angle - spindle
    speed = np.gradient(spindle, 0.01)
    late = np.abs(speed) > 0.3
    np.testing.assert_allclose(lag[late], -gap / 2 * np.sign(speed[late]), atol=3e-3)


def test_a_log_of_another_machine_is_refused(tmp_path):
    write_log(tmp_path / "a.parquet", {}, time=np.arange(90.0), position=np.arange(90.0))
    with pytest.raises(SerpentError, match=r"lacks spindle_position, .* Name another --rig"):
        MACHINE.read(tmp_path)


@measured
@pytest.mark.slow
def test_stretch_and_friction_reach_what_was_published_on_pairs_never_seen():
    """Judged at 0.2 Hz and 30 %, 0.4 Hz and 10 %, 0.3 Hz and 40 %; a regression that is given the spindle's
    torque leaves 0.44° rms there, a rigid jaw with backlash 1.53°. Fits that converge leave 0.447 … 0.453°.
    """
    held = ("tool_4_12", "tool_4_30", "tool_4_23")
    everything = MACHINE.read(MEASURED)
    training = [r for r in everything if r.name not in held][::2]
    judging = [r for r in everything if r.name in held]
    case = MACHINE.open(training)
    pieces, held_out = case.pieces(training), case.pieces(judging)
    start = of(
        cable_stretch=[1.0],
        shaft_stretch=[0.3],
        hinge_friction=[0.04, 0.002],
        joint_elasticity=[0.02],
    )
    case = case.reweighted(start, pieces)
    found = fit(case, pieces, start, free_parameters(case, list(start.effects)), 2, 6)
    off = case.compare(found.point, held_out).marker_residual
    assert np.degrees(np.sqrt(np.nanmean(off**2))) < 1.1 * 0.44
