"""Test that a readout of windows waits for a whole window, and begins anew after a gap."""

from dataclasses import dataclass

import numpy as np
import pytest

from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.estimators.windowed import LiveWindows
from serpent_twin.readouts import Readout
from serpent_twin.readouts.windows import input_size


@dataclass
class Echo(Readout):
    """A readout whose first marker is the first three numbers of its window's oldest command."""

    name = "echo"
    about = "for tests"
    _learns = False

    def _learn(self, train, validate, rng, progress): ...

    def _estimate(self, x, start):
        return np.tile(x[:, -9:-6], (1, 9))


@pytest.mark.parametrize(("step", "blind"), [(1.4, 0), (1.6, 2), (20.0, 2)])
def test_a_gap_begins_a_window_anew(step, blind):
    echo = Echo(window=3)
    echo.rate_hz = 10.0
    live, time, said = LiveWindows(echo), 0.0, []
    for k in range(12):
        time += (step if k == 6 else 1.0) / 10
        now = BusReading(time, np.zeros(10), np.zeros(10), np.zeros(10), np.full(10, float(k)))
        said.append(live.update(now))
    seen = [each is not None for each in said]
    assert seen == [False] * 2 + [True] * 4 + [False] * blind + [True] * (6 - blind)
    for k, each in enumerate(said):
        if each is not None:  # the oldest command is that before the row before
            assert each.marker[0, 0, 0] == k - 1
    assert input_size(3) == 72


def test_without_a_known_rate_there_is_no_gap():
    live = LiveWindows(Echo(window=1 + 1))
    none = np.zeros(10)
    said = [live.update(BusReading(t, none, none, none, none)) for t in (0.0, 1.0, 50.0)]
    assert [each is not None for each in said] == [False, True, True]
