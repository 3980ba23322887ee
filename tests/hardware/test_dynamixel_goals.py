"""Test that the Dynamixel bus verifies its motors' goals, with no more requests than needed."""

import numpy as np
import pytest
from wire_bench import MILD, real_time

from serpent_twin.hardware.dynamixel import reading


@pytest.mark.parametrize(("period", "asked"), [(0.01, 1), (0.05, 1), (0.25, 10)])
def test_goals_are_read_back_where_no_reading_tells_of_them_soon(period, asked, monkeypatch):
    """The first command's always are: nothing is known of the motors yet."""
    seen, clock = list[int](), [0.0]
    with real_time() as (_, bus):
        plain = bus.wire.sync_read
        monkeypatch.setattr(
            bus.wire, "sync_read", lambda *block: (seen.append(block[1]), plain(*block))[1]
        )
        monkeypatch.setattr(bus._goals, "_now", lambda: clock[0])
        for n in range(10):
            bus.read_state()
            bus.write_velocity((n + 1) / 20 * np.array(MILD))
            clock[0] += period
    assert seen.count(reading.ADDRESS) >= 10
    assert seen.count(reading.GOAL_ADDRESS) == asked


def test_a_goal_that_a_fast_loop_lost_is_sent_again_by_the_next_reading():
    with real_time() as (device, bus):
        for n in range(20):
            if n == 10:
                device.trigger("deaf")
            bus.write_velocity((n + 1) / 20 * np.array(MILD))
            state = bus.read_state()
            assert np.array_equal(state.registers.velocity_trajectory, bus._goals.words) == (
                n != 10
            )
            bus.wait(0.01)
        assert bus.recovery.counts == {"goal": 10}  # once of each motor
