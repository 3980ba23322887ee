"""Linear dynamics from row to row, beside closed forms and beside simulations."""

from dataclasses import replace
from functools import partial

import moving_models
import mujoco
import numpy as np
import pulled_lever
import pytest
import swinging_models
from example import opened

from serpent_twin.engine.recorded_steps import RecordedSteps
from serpent_twin.engine.row_changes import RowChanges
from serpent_twin.engine.stepper import set_timestep, side_by_side
from serpent_twin.machines.model.derivatives import derivatives
from serpent_twin.machines.model.number_changes import differing
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.model.variants import Variants

DT, K, ROWS = 0.001, 20, 15
SLIDE = """<mujoco><option gravity="0 0 0" timestep="0.001"/>
<worldbody><body name="cart">
  <joint name="slide" type="slide" axis="1 0 0" {joint}/><geom size="0.1" mass="2"/>
</body></worldbody>{more}</mujoco>"""
CABLE = """<tendon><fixed name="cable" stiffness="300" springlength="-1 0.01">
<joint joint="slide" coef="1"/></fixed></tendon>"""

HELD = """<mujoco><worldbody><site name="wall"/><body name="cart">
  <joint type="slide" axis="1 0 0"/><geom size="0.1" mass="2"/>
  <site name="hook" pos="0.5 0 0"/><site name="marker" pos="0.6 0 0"/>
</body></worldbody><tendon><spatial stiffness="10">
  <site site="wall"/><site site="hook"/>
</spatial></tendon></mujoco>"""


def changes(mjcf, velocity, force=0.0, others=(), longer=0.0):
    """The dynamics of a cart that begins at 0 with a velocity, in one part a row; something lets its cable
    be longer than the model's.
    """
    model = mujoco.MjModel.from_xml_string(mjcf)
    batch, dt = side_by_side([model], 1), np.array([DT])
    set_timestep(batch, dt)
    steps = RecordedSteps(batch, ROWS, K, parts=1)
    batch.reset()
    batch.bind("qvel")[...] = velocity
    batch.bind("qfrc_applied")[...] = force
    if longer:
        batch.expand("tendon_lengthspring")[...] += longer
    for _ in range(ROWS * K):
        steps.begin()
        batch.step()
        steps.end()
    others = [[mujoco.MjModel.from_xml_string(other)] for other in others]
    found = RowChanges.of([model], steps, dt, np.zeros((1, ROWS), np.int32), [0], others)
    return found, batch.bind("qvel")[0, 0]


def test_a_damped_cart_follows_its_closed_form():
    """Each implicit step leaves 1 / (1 + c dt / m) of the rate."""
    found, _ = changes(SLIDE.format(joint='damping="3"', more=""), 1.0)
    kept = 1 / (1 + 3 * DT / 2)
    rates = kept ** np.arange(1, K + 1)
    assert found.A[0, 0] == pytest.approx(np.array([[1, DT * rates.sum()], [0, rates[-1]]]))
    by_force = DT / 2 * kept * (1 - kept**K) / (1 - kept)
    assert found.by_force[0, 0, 0, 0, 1] == pytest.approx(by_force)


def test_a_cart_that_slides_keeps_changes_and_one_that_sticks_loses_them():
    cart = SLIDE.format(joint='frictionloss="1"', more="")
    found, left = changes(cart, 0.1)  # stops after 0.2 s
    assert abs(left) < 1e-3
    assert found.A[0, 0, 1, 1] == pytest.approx(1.0)
    assert found.by_friction[0, 0, 0, 1] == pytest.approx(-K * DT / 2, rel=1e-3)
    assert abs(found.A[0, -1, 1, 1]) < 0.5  # creeps as MuJoCo's constraint does
    assert found.by_friction[0, 0, -1, 1] == 0.0


def test_other_friction_shows_as_it_changes_where_the_cart_stops():
    """M v² / 2 F: a share of 1 % more friction is a way shorter by 1 %."""
    cart, more = (SLIDE.format(joint=f'frictionloss="{f}"', more="") for f in (1.0, 1.0001))
    found, _ = changes(cart, 0.1, others=[more])
    state = np.zeros(2)
    for t in range(ROWS):
        state = found.A[0, t] @ state + found.by_friction_of[0, 0, t]
    assert state[0] == pytest.approx(-1e-4 * 2 * 0.1**2 / 2, rel=0.1)


def test_a_cable_pulls_in_the_steps_in_which_it_is_taut():
    """The cart passes the cable's length amid a row, from which on the cable's slack counts."""
    cart = SLIDE.format(joint="", more=CABLE)
    found, _ = changes(cart, 0.25)  # 0.04 s, two rows, to where the cable is taut
    shows = found.by_slack[0, 0, :, 1]
    assert np.all(shows[:2] == 0.0)
    assert shows[3] == pytest.approx(300 / 2 * K * DT, rel=0.05)
    assert found.A[0, 0] == pytest.approx(np.array([[1, K * DT], [0, 1]]))
    w = np.sqrt(300 / 2) * K * DT
    assert found.A[0, 4, 1, 1] == pytest.approx(np.cos(w), abs=0.01)


def test_a_cable_that_something_lengthens_pulls_later():
    cart = SLIDE.format(joint="", more=CABLE)
    found, _ = changes(cart, 0.25, longer=0.01)  # 0.08 s, four rows
    assert np.all(found.by_slack[0, 0, :4, 1] == 0.0)
    assert found.A[0, 3] == pytest.approx(np.array([[1, K * DT], [0, 1]]))
    assert found.by_slack[0, 0, 5, 1] == pytest.approx(300 / 2 * K * DT, rel=0.05)


def logged(module, folder):
    """A machine of some tests, and a folder with a log of it."""
    path = module.machine(folder)
    more = {"noise": 0.0} if module is swinging_models else {}
    (folder / "logs").mkdir()
    module.log(folder / "logs" / "session_1.csv", 1, **more)
    return opened(path, folder / "logs")


@pytest.mark.parametrize("module", [moving_models, pulled_lever, swinging_models])
def test_derivatives_along_a_motion_are_those_of_simulations(module, tmp_path):
    agree_with_simulations(*logged(module, tmp_path))


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("stiffness_drift@cable", [200.0, 0.0, -1.0]),
        ("stiffness_drift@pivot", [200.0, 0.0, -1.0]),
        ("discovered@slack of cable: linear time of session", [2e-4, *[0.0] * 7]),
    ],
)
def test_derivatives_are_of_springs_as_effects_have_made_them(effect, values, tmp_path):
    """A cable or a spring has lost its stiffness by the end of the log, or a cable is longer then."""
    case, pieces, point = logged(pulled_lever, tmp_path)
    agree_with_simulations(case, pieces, point.having(effect, np.array(values)))


def agree_with_simulations(case, pieces, point):
    """Derivatives along the motion of a point beside differences of simulations."""
    machine, declared = case.machine, case.declared
    steps = np.diag([each.step for each in declared])
    stepped = partial(machine._stepped, point)
    found = derivatives(machine._in_motion([point]), stepped, declared, pieces)
    here, *there = machine.respond([point, *(point.after(step) for step in steps)], pieces)
    known = np.isfinite(pieces.measured)
    assert len(found) >= len(declared) - 1
    for each, shown in zip(declared, there, strict=True):
        if each.name not in found:
            assert "joint shoulder" in each.name  # whose motion is prescribed
            continue
        told, change = found[each.name][known] * each.step, (shown - here)[known]
        if np.abs(change).max() > 1e-7:
            assert np.linalg.norm(told - change) < 0.03 * np.linalg.norm(change), each.name


def test_a_trace_takes_derivatives_along_one_motion(tmp_path):
    case, pieces, point = logged(moving_models, tmp_path)
    found = replace(case.machine, steps=32).derivatives(point, pieces, case.noise)
    assert set(found) == {each.name for each in case.declared}


def test_derivatives_by_many_numbers_are_cut_to_what_the_log_spans(tmp_path, monkeypatch):
    case, pieces, point = logged(moving_models, tmp_path)
    wide = [
        replace(each, declared=replace(each.declared, prior=1e3 * each.declared.prior))
        for each in case.machine.coordinates
    ]
    machine = replace(case.machine, coordinates=tuple(wide), steps=32)
    usual = machine.derivatives(point, pieces, case.noise)
    monkeypatch.setattr("serpent_twin.machines.model.derivatives.MANY", 0)
    cut = machine.derivatives(point, pieces, case.noise)
    known = pieces.measured.reshape(-1, len(case.noise))
    span, beyond = np.nanmax(known, axis=0) - np.nanmin(known, axis=0), 0
    for each in machine.declared:
        change, most = usual[each.name], span / each.prior
        beyond += np.count_nonzero(np.abs(change) > most)
        assert cut[each.name] == pytest.approx(np.clip(change, -most, most), rel=1e-4, abs=1e-6)
    assert beyond


def test_a_site_that_a_cable_passes_matters_to_forces_and_a_marker_does_not():
    plain = mujoco.MjModel.from_xml_string(HELD)
    for name in ("wall", "hook", "marker"):
        moved = mujoco.MjModel.from_xml_string(HELD)
        moved.site(name).pos[0] += 0.001
        assert ("held sites" in differing(plain, moved)) == (name != "marker")


def test_variants_of_runs_are_put_where_each_run_is():
    """Where a tendon is prescribed, each run's constraint holds another length."""
    held = CABLE + '<equality><tendon tendon1="cable"/></equality>'
    model = mujoco.MjModel.from_xml_string(SLIDE.format(joint="", more=held))
    driven = DrivenRuns([model] * 2, np.zeros((2, 3, 0)), np.zeros((2, 3), np.int32), np.ones(2))
    runs = Variants(driven, [model] * 6, np.array([DT, DT]))
    length = np.zeros((2, 1, 12))
    length[:, 0, 0] = 0.1, 0.2
    pose = np.array([[1.0], [2.0]]) + np.array([0.0, 0.1, 0.2])[:, None, None]
    runs.put(1, qpos=pose)
    runs.act({"eq_data": np.repeat(length[:, None], 3, axis=1)}, (1,))
    assert runs.batch.expand("eq_data")[:, 0, 0].tolist() == [0.1, 0.2] * 3
    assert runs.apart(runs.batch.bind("qpos")) == pytest.approx(pose)
