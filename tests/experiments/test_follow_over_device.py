"""Test that an arm follows a path over the wire of the emulated motors, in real time."""

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.follow import over_device as of_follow
from experiments.follow.result_page import device_table
from serpent_twin.live.path import PathToFollow
from serpent_twin.sim import twin_model


@pytest.mark.slow
def test_what_followed_over_the_wire_is_stated(tmp_path, monkeypatch):
    """Its markers say where the arm truly was; a rate that is there is not driven again."""
    points = np.array([[0.48, 0.0, -0.2], [0.48, 0.02, -0.2]])
    way = PathToFollow(tmp_path / "path", np.array([0.0, 1.0]), points)
    monkeypatch.setattr(of_follow, "PATHS", {of_follow.FIRST: way})
    monkeypatch.setattr(of_follow, "RATES", (20.0,))
    twin_model.write(tmp_path / "twin.json", twin_model.NOMINAL_TWIN, {})
    arm = SimpleNamespace(id="nominal", twin_file=tmp_path / "twin.json", runtime=0.0)
    found = of_follow.over_device(arm, tmp_path / "device")
    assert list(found) == ["20"] and found["20"]["marker9_error_mm"]["rms"] < 12.0
    assert found["20"]["missed_deadlines"] < found["20"]["rows"]
    ((rate, marker, *_, missed),) = device_table(found).rows
    assert rate == "20" and float(marker) < 12.0 and missed.endswith(f"of {found['20']['rows']}")
    monkeypatch.setattr(of_follow, "_drive", None)
    assert of_follow.over_device(arm, tmp_path / "device") == found


def test_a_rate_that_the_machine_does_not_keep_is_a_row_that_says_so():
    (row,) = device_table({"100": {of_follow.SLOW: 50.5}}).rows
    assert row == ("100", "—", "—", "—", "—", "stopped: 50.5 steps a second")
