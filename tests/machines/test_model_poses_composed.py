"""Trace logs of a hanging chain at rest on which something acts that no catalogue lists."""

import hanging_models
import pytest
from hanging_models import BELOW, STOP, pushed, stop

from serpent_twin.identification import Trace, trace


def composed(folder, acting):
    """The one law that a trace composes where something acts on poses, with its sizes and threshold."""
    path = hanging_models.machine(folder / "chain")
    path.write_text('candidates = ["gravity"]\n' + path.read_text())
    for n in range(3):
        hanging_models.log(folder / "logs" / f"poses_{n}.csv", n, acting)
    found = trace(Trace((folder / "logs",), folder / "trace", machine=path))
    assert found["error_mm"]["corrected"] < 0.4  # 0.32 mm is the mean length of its noise
    (law,) = found["effects"]
    return law, *(law["parameters"].get(name) for name in ("size", "size_x", "threshold"))


@pytest.mark.slow
def test_a_stop_is_composed_at_its_joint(tmp_path):
    law, size, _, threshold = composed(tmp_path, stop)
    assert law["place"] == {"kind": "joint", "name": "joint_3"}
    assert (law["changes"], law["law"]) == ("joint_torque", "below")
    assert law["depends_on"] == ["joint angle of joint_3"]
    assert size["value"] == pytest.approx(-STOP, rel=0.1)
    assert size["low"] < -STOP < size["high"]
    assert threshold["value"] == pytest.approx(BELOW, abs=0.02)
    assert size["unit"] == "N m per rad"


@pytest.mark.slow
def test_a_force_is_composed_on_a_body_that_moves_in_a_plane(tmp_path):
    """It may be told as equivalent to a cable that lengthens there: in poses, both do nearly the same."""
    law, *_, threshold = composed(tmp_path, pushed)
    told = [
        (each["changes"], each["place"]["name"], each["law"]) for each in (law, *law["equivalent"])
    ]
    assert ("force", "link_3", "beyond") in told
    assert law["depends_on"] == ["position x of link_3"]
    assert threshold["value"] == pytest.approx(0.03, abs=0.003)
