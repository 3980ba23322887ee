"""Test laws that act during the time steps of any model against scipy's integration of their equations."""

import numpy as np
import pulled_lever
import pytest
from example import opened
from pulled_lever import GAIN, GEAR, NOISE
from scipy.optimize import least_squares

SHARP = 1e-3  # [rad/s] within which friction changes its sign


def stribeck(t, q, v, stretch, memory):
    return -0.04 * np.exp(-abs(v) / 0.6) * np.tanh(v / SHARP), 1.0, 1.0, 0.0


def warming(t, q, v, stretch, memory):
    return -0.08 * np.exp(-t / 12.0) * np.tanh(v / SHARP), 1.0, 1.0, 0.0


def capstan(t, q, v, stretch, memory):
    return -0.1 * GEAR * GAIN * abs(stretch) * np.tanh(v / SHARP), 1.0, 1.0, 0.0


def creep(t, q, v, stretch, memory):
    return 0.0, 1.0, 1.0, (0.3 * stretch - memory) / 8.0


def slip(t, q, v, stretch, memory):
    return 0.0, 1.0, 1.0, 1e-3 * max(GAIN * stretch - 4.0, 0.0)


def fading_cable(t, q, v, stretch, memory):
    return 0.0, 1.0 - 24.0 * t / 3600, 1.0, 0.0


def fading_spring(t, q, v, stretch, memory):
    return 0.0, 1.0, 1.0 - 60.0 * t / 3600, 0.0


class Relaxing:
    """A spring that yields from where the lever begins; the memory, which lengthens the cable, is how far."""

    def __call__(self, t, q, v, stretch, memory):
        self.begun = q if t == 0 else self.begun
        behind = q - self.begun - memory
        return -0.8 * behind - GEAR * GAIN * memory, 1.0, 1.0, behind / 0.5


RELAXES = "discovered@joint_torque of pivot: lag joint_angle of pivot"
LAWS = {
    "stribeck@pivot": (stribeck, [0.04, 0.6]),
    "friction_warming@pivot": (warming, [0.08, 12.0]),
    "cable_friction@cable": (capstan, [0.1, 0.0, 0.0, 0.0, -1.0]),
    "cable_creep@cable": (creep, [0.3, 8.0, -1.0]),
    "clamp_slip@cable": (slip, [1e-3, 4.0, -1.0]),
    "stiffness_drift@cable": (fading_cable, [24.0, 0.0, -1.0]),
    "stiffness_drift@pivot": (fading_spring, [60.0, 0.0, -1.0]),
}
"""The equations and the parameters of each law"""


@pytest.mark.parametrize("name", LAWS)
def test_a_law_at_a_place_moves_a_model_as_its_equations_say(tmp_path, name):
    """Session by session and, in between, from what is remembered of the rows before."""
    law, values = LAWS[name]
    case, pieces, zero = pulled_lever.opened(tmp_path, 0, law, noise=0.0)
    having, without = (
        np.nanstd(pieces.measured - case.machine.respond([at], pieces)[0])
        for at in (zero.having(name, np.array(values)), zero)
    )
    assert without > 4 * NOISE and having < 0.04 * without


@pytest.mark.parametrize("segment", [15, 60, 520])
def test_what_lags_remembers_the_rows_before_a_segment(tmp_path, segment):
    path = pulled_lever.machine(tmp_path)
    path.write_text(path.read_text().replace("segment = 60", f"segment = {segment}"))
    case, pieces, zero = opened(
        path, pulled_lever.log(tmp_path / "log.csv", 0, Relaxing(), noise=0.0)
    )
    at = zero.having(RELAXES, np.array([0.8, 0, 0, 0, 0.5, 0, 0, 0]))
    having, without = (
        np.nanstd(pieces.measured - case.machine.respond([point], pieces)[0])
        for point in (at, zero)
    )
    assert without > 4 * NOISE and having < 0.05 * without


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_the_strength_of_a_law_is_found_from_its_candidate_s_starts(tmp_path, name):
    law, values = LAWS[name]
    case, pieces, zero = pulled_lever.opened(tmp_path, 1, law)
    known = case.candidates[name]
    fitted = [n for n, each in enumerate(known.ranges.values()) if each.fitted]
    seen = np.isfinite(pieces.measured)

    def off(free, others):
        others[fitted] = free
        point = zero.having(name, others.copy())
        return (pieces.measured - case.machine.respond([point], pieces)[0])[seen] / NOISE

    start = min(known.variants, key=lambda each: np.sum(off(each[fitted], each.copy()) ** 2))
    low, high = np.array([[r.low, r.high] for r in known.ranges.values()])[fitted].T
    found = least_squares(
        off, start[fitted], bounds=(low, high), x_scale=start[fitted], diff_step=0.02, ftol=1e-3, xtol=1e-3,
        args=(start.copy(),),
    )  # fmt: skip
    assert found.x[0] == pytest.approx(values[0], rel=0.1)
    assert np.sqrt(2 * found.cost / seen.sum()) < 1.2  # hardly more than noise is left


@pytest.mark.slow
def test_a_law_is_named_with_its_place_and_strength(tmp_path):
    """One of them: a trace steps through thousands of time steps a hundred times."""
    found = pulled_lever.EXAMPLE.traced(tmp_path, 3, capstan, seconds=13.0)["effects"]
    assert [each["name"] for each in found] == ["cable_friction@cable"]
    assert found[0]["parameters"]["coefficient"]["value"] == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
def test_no_law_is_named_where_there_is_none(tmp_path):
    assert pulled_lever.EXAMPLE.traced(tmp_path, 3)["effects"] == []
