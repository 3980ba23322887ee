"""Test the changes carried along a motion against motions simulated with each parameter changed."""

from dataclasses import replace

import numpy as np
import pytest
from motion import wander
from paths import DATA

from serpent_twin import effects
from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.machines.arm import MACHINE
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.sim.many_twins import differentiate, impose
from serpent_twin.sim.twin_model import TwinModel

ARM = replace(NOMINAL, transition_velocity=0.02, strand_stiffness=8e3)
SMALL = 0.01


def changed(base, field, index, by):
    """A twin model with one deviation changed."""
    values = np.array(getattr(base.tolerances, field))
    values[index] += by
    return replace(base, tolerances=replace(base.tolerances, **{field: tuple(map(float, values))}))


CABLES = (
    ("strand_stiffness", 4, SMALL),
    ("strand_slack", 9, SMALL * 1e-3),
    ("winch_radius", 5, SMALL * 1e-2),
    ("joint_friction", 3, SMALL),
    ("transition_velocity", 6, SMALL),
    ("joint_damping", 1, SMALL),
)
LINKS = (("link_mass", 6, SMALL), ("link_length", 3, SMALL), ("axis_tilt", 5, SMALL))


def compared(base, stretches, parts=CABLES, timestep=0.005, rounding=0.0):
    """Changes of markers and loads along the motion, and by central differences, (kinds, numbers) each.

    The motion itself is the same whatever is carried along with it, but for `rounding`.
    """

    def others(share):
        return [changed(base, field, index, share * by) for field, index, by in parts]

    response, marker, load = differentiate(base, others(1.0), stretches, timestep)
    ends = [impose([*others(side), base], stretches, timestep) for side in (1.0, -1.0)]
    np.testing.assert_allclose(response.marker[0], ends[0].marker[-1], 0.0, rounding)
    np.testing.assert_allclose(response.load[0], ends[0].load[-1], 0.0, rounding)
    for found, of in ((marker, "marker"), (load, "load")):
        told = (getattr(ends[0], of) - getattr(ends[1], of))[:-1] / 2
        yield found.reshape(len(found), -1), told.reshape(len(found), -1)


@pytest.fixture(scope="module")
def logged():
    """A case of logs, two of its segments, its start, and the derivatives there."""
    sessions = MACHINE.read(DATA / "arm_a")[:2]
    case = MACHINE.open(sessions)
    some = case.take(case.pieces(sessions), [0, 3])
    start = ParameterVector.nominal(case.declared)
    return case, some, start, case.machine.derivatives(start, some, case.noise)


def test_an_arm_without_dry_friction_or_slack_is_differentiated_to_a_twentieth():
    """Then the motion is smooth in its parameters; links are taken as they stand amid two rows."""
    taut = replace(ARM, strand_slack=0.0, joint_friction=0.0, joint_damping=0.05)
    for found, told in compared(TwinModel(taut), wander(rows=40)):
        smooth = [0, 2, 5]  # at no slack, a change of it is not
        error = np.linalg.norm((found - told)[smooth], axis=1)
        assert (error < 0.05 * np.linalg.norm(told[smooth], axis=1)).all(), error


def test_other_links_change_a_smooth_motion_as_differences_do():
    """Their torques are taken as constant for an eighth of the time between rows."""
    taut = replace(ARM, strand_slack=0.0, joint_friction=0.0, joint_damping=0.05)
    of_markers, of_loads = compared(TwinModel(taut), wander(rows=40), LINKS)
    for (found, told), most in ((of_markers, 0.02), (of_loads, 0.12)):
        error = np.linalg.norm(found - told, axis=1)
        assert (error < most * np.linalg.norm(told, axis=1)).all(), error


@pytest.mark.slow
def test_other_links_change_logged_motion_as_differences_do(logged):
    case, some, start, told = logged
    names = [d.name for d in case.declared]
    for name in (
        "mass of link 9",
        "length of link 5",
        "axis of joint 6 across",
        "turn of the cameras about y",
    ):
        step = case.declared[names.index(name)].prior * np.eye(len(names))[names.index(name)]
        ends = case.machine.respond([start.after(step), start.after(-step)], some)[..., :27]
        change, along = (ends[0] - ends[1]).ravel(), told[name][..., :27].ravel()
        assert change @ along > 0.97 * np.linalg.norm(change) * np.linalg.norm(along), name
        assert np.linalg.norm(2 * step.max() * along) == pytest.approx(
            np.linalg.norm(change), rel=0.1
        )


def test_derivatives_are_of_small_changes_however_large_a_parameters_step(logged):
    """A parameter's step may be a third: one side's secant would be off by an eighth."""
    case, some, start, told = logged
    names = [d.name for d in case.declared]
    for name in ("friction of all joints", "transition velocity of joint 3"):
        step = 0.1 * case.declared[names.index(name)].step * np.eye(len(names))[names.index(name)]
        ends = case.machine.respond([start.after(step), start.after(-step)], some)[..., :27]
        change = (ends[0] - ends[1]).ravel() / (2 * step.max())
        share = change @ told[name][..., :27].ravel() / (change @ change)
        assert share == pytest.approx(1.0, abs=0.03), name


def test_other_links_are_told_where_rows_are_two_steps_apart():
    taut = replace(ARM, strand_slack=0.0, joint_friction=0.0, joint_damping=0.05)
    (found, told), _ = compared(TwinModel(taut), wander(rows=40, dt=0.01, pace=0.002), LINKS)
    error = np.linalg.norm(found - told, axis=1)
    assert (error < 0.1 * np.linalg.norm(told, axis=1)).all(), error


@pytest.mark.parametrize(
    "name",
    [
        "",
        "cable_stiffening",
        "mocap_latency",
        "cable_creep",
        "link_flex",
        "payload",
        "constant_force",
    ],
)
def test_an_arm_that_sticks_and_slips_is_differentiated_as_differences_do(name):
    """With an effect in the model, too, and with delayed cameras."""
    base = TwinModel(ARM, Deviations())
    if name:
        kind = effects.by_name(name)
        typical = {p: r.typical for p, r in effects.ranges(kind).items() if r.fitted}
        base = base.with_effect(kind(**typical))
    for found, told in compared(base, wander(rows=60)):
        size = np.linalg.norm(found, axis=1) * np.linalg.norm(told, axis=1)
        cosine = (found * told).sum(axis=1) / size
        assert (cosine > 0.9).all(), cosine.round(3)
        ratio = np.linalg.norm(found, axis=1) / np.linalg.norm(told, axis=1)
        assert (np.abs(np.log(ratio)) < 0.2).all(), ratio.round(2)


def test_hinges_that_give_way_before_they_slide_are_differentiated():
    """By changes of some size: small ones drown in the instants at which hinges begin to slide."""
    rubs = effects.by_name("cable_friction")(0.05, 0.001, presliding=0.02)
    base = TwinModel(replace(ARM, strand_stiffness=2.6e3)).with_effect(rubs)
    parts = (
        ("strand_stiffness", 4, 0.1),
        ("strand_slack", 9, 1e-4),
        ("link_mass", 6, 0.1),
        ("axis_tilt", 5, 0.03),
    )
    for found, told in compared(base, wander(rows=60), parts, rounding=1e-9):
        size = np.linalg.norm(found, axis=1) * np.linalg.norm(told, axis=1)
        cosine = (found * told).sum(axis=1) / size
        assert (cosine > 0.8).all(), cosine.round(3)
        ratio = np.linalg.norm(found, axis=1) / np.linalg.norm(told, axis=1)
        assert (np.abs(np.log(ratio)) < 0.3).all(), ratio.round(2)


@pytest.mark.slow
def test_where_one_clamp_slips_differences_tell_for_its_cable_alone(logged):
    """What is right for nine cables hides in one step of all that it is wrong for the tenth."""
    case, some, start, _ = logged
    slips = start.having("clamp_slip", [1.0, 1.0, 23.0])  # cable 4
    found = case.jacobian(slips, some)
    names = [each.name for each in case.declared]
    lost = {name for name, each in zip(names, found, strict=True) if not np.isfinite(each).all()}
    of_it = {name for name in names if "cable4_" in name or name == "winch of motor 4"}
    assert lost == of_it and len(lost) == 5


@pytest.mark.slow
def test_where_effects_answer_to_a_change_differences_tell(logged):
    """Stiffer strands let their clamps slip at other instants, which tangents leave out."""
    case, some, start, _ = logged
    assert np.isfinite(case.jacobian(start, some)).all()
    slips = start.having("clamp_slip", [1e-4, 1.0, -1.0])
    unknown = np.isnan(case.jacobian(slips, some)).any(axis=(1, 2))
    names = [each.name for each in case.declared]
    assert [name for name, lacks in zip(names, unknown, strict=True) if lacks] == [
        name
        for name in names
        if not name.startswith(("gear friction", "place of marker", "shift of", "turn of"))
    ]
