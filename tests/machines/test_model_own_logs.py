"""Test that a model leaves nothing but noise of logs that were made with the very model."""

import numpy as np
import own_models
import pytest

from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine

MOST = {"cube that the arm pushes": 10.0}
"""Times the noise that may be left, where a contact begins in a place that no measurement knows"""


def opened(path):
    """The machine of logs, and what its nominal model leaves of them over the noise, (S, T, C)."""
    rig = open_machine(path)
    logs = rig.read(path.parent / "logs")
    case = rig.open(logs)
    pieces, at = case.pieces(logs), ParameterVector.nominal(case.declared)
    return case, (pieces.measured - case.machine.respond([at], pieces)[0]) / own_models.NOISE


@pytest.mark.parametrize("name", own_models.OWN_MODELS)
def test_the_very_model_leaves_noise_alone(tmp_path, name):
    case, off = opened(own_models.write(tmp_path, name, sessions=1))
    left = np.sqrt(np.nanmean(off**2, axis=(0, 1)))
    assert (left < MOST.get(name, 1.5)).all(), left
    assert not [note for note in case.notes if "is not known" in note]
