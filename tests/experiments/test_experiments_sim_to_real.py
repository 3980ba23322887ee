"""Test that the comparison of routes keeps windows apart, and makes the conditions that it names."""

from dataclasses import replace

import numpy as np
import pytest
from learning_sessions import make_windows

from experiments.sim_to_real.conditions import (
    ArmChange,
    Condition,
    changing,
    followed,
    loaded,
    recovery,
    session_of,
)
from experiments.sim_to_real.twins import after, joined
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects.payload import Payload
from serpent_twin.estimators import Belief, Live
from serpent_twin.estimators.online import Online
from serpent_twin.sim.twin_model import NOMINAL_TWIN

ARM = replace(NOMINAL_TWIN, parameters=replace(NOMINAL, marker_noise=0.0, load_noise=0.0))


@pytest.mark.parametrize("count", [1, 200, 390, 391, 780, 781])
def test_what_the_first_windows_leave_is_all_the_others_in_order(count):
    windows = make_windows(range(1, 4))
    few, rest = windows.first(count), after(windows, count)
    assert len(few.x) == count and len(few.x) + len(rest.x) == len(windows.x)
    np.testing.assert_array_equal(joined(few, rest).x, windows.x)
    np.testing.assert_array_equal(joined(few, rest).marker, windows.marker)


def test_recovery_is_timed_from_the_change():
    error = np.full(1000, 1.0)
    error[0] = np.nan  # of a window that is not full
    error[501:600] = 4.0
    found = recovery(error, 500)
    told = [found[name] for name in ("before_mm", "first_10_s_mm", "last_mm")]
    assert told == pytest.approx([1.0, 4.0, 1.0])
    # 10 s of which 3 rows are still bad: a mean of 1.225
    assert found["recovered_s"] == (99 - 3 + 40) / 4
    assert recovery(np.where(np.arange(1000) > 500, 4.0, 1.0), 500)["recovered_s"] is None


def test_each_condition_is_what_its_name_says():
    plain = session_of(ARM, Condition("plain", rows=80), seed=1)
    assert np.diff(plain.time) == pytest.approx(0.25) and len(plain) == 80
    fast = session_of(ARM, Condition("fast", rows=80, rate_hz=10.0), seed=1)
    assert np.diff(fast.time) == pytest.approx(0.1) and fast.metadata["rate_hz"] == 10.0
    wide = session_of(ARM, Condition("wide", rows=80, wider=1.3), seed=1)
    np.testing.assert_allclose(wide.joint_target, 1.3 * plain.joint_target)
    lost = session_of(ARM, Condition("lost", rows=80, lost=(30, 70)), seed=1)
    gaps = np.diff(lost.time)
    assert len(lost) == 40 and gaps.max() == pytest.approx(10.25) and (gaps > 0.3).sum() == 1
    np.testing.assert_array_equal(lost.marker, np.delete(plain.marker, np.s_[30:70], axis=0))
    heavy = session_of(ARM, Condition("heavy", rows=80, more_kg=0.03), seed=1)
    assert abs(heavy.marker - plain.marker).max() > 1e-3


def test_rebooted_motors_were_loose():
    plain = session_of(ARM, Condition("plain", rows=60), seed=1)
    tripped = session_of(ARM, Condition("rebooted", rows=60, reboots=(30,)), seed=1)
    np.testing.assert_array_equal(tripped.marker[:30], plain.marker[:30])
    assert np.diff(tripped.time)[29] == pytest.approx(2.0)  # the bench waited for them
    fell = tripped.motor_position[30] - tripped.motor_position[29]
    assert abs(fell).max() > 0.1


def test_more_payload_adds_to_what_is_held():
    held = ARM.with_effect(Payload(mass=0.02))
    (one,) = loaded(held, 0.03).effects
    assert isinstance(one, Payload) and one.mass == pytest.approx(0.05)
    assert loaded(held, 0.0) is held


@pytest.mark.parametrize("change", [ArmChange(more_kg=0.05), ArmChange(tilt=(0.05, 0.0))])
def test_a_change_shows_from_its_row_on_and_is_what_it_says(change):
    none = changing(ARM, 80, 40, ArmChange(), seed=1)
    change = changing(ARM, 80, 40, change, seed=1)
    off = 1e3 * abs(change.marker - none.marker).max(axis=(1, 2))
    assert off[:41].max() == 0 < 2.0 < off[50:].mean()


class Off(Live):
    """A live estimate that is off by two centimetres in one direction."""

    def __init__(self, session):
        self.k, self.session = 0, session

    def update(self, now):
        marker = self.session.marker[self.k] + [0.02, 0.0, 0.0]
        self.k += 1
        return Belief(marker[None], np.tile(1e-4 * np.eye(3), (1, 9, 1, 1)))


def test_errors_are_told_before_the_markers_of_their_row_correct_anything():
    session = session_of(ARM, Condition("plain", rows=60), seed=1)
    alone = np.array(list(followed(Off(session), session)))
    np.testing.assert_allclose(alone, 20.0)
    online = Online(Off(session))
    helped = np.array(list(followed(online, session)))
    assert helped[0] == pytest.approx(20.0) and helped[-1] < 2.0
