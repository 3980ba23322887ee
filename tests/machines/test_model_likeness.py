"""Test when a column that follows the model with the other sign is refused."""

from dataclasses import replace

import held_models
import numpy as np
import pytest
from example import opened
from held_models import EXAMPLE

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.likeness import require_units
from serpent_twin.machines.rig import notes_on, read_logs


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """The arm with exact readings: its machine, and a session for each of its segments."""
    folder = tmp_path_factory.mktemp("arm")
    path = EXAMPLE.write(folder)
    _, pieces, _ = opened(path, held_models.log(folder / "log.csv", 0, step=0.0))
    several = tuple(replace(log, label=f"s{n}") for n, log in enumerate(pieces.log))
    return open_machine(path).described, replace(pieces, log=several)


def test_one_session_of_many_that_a_poor_model_follows_by_chance_with_the_other_sign_is_kept(arm):
    machine, pieces = arm
    poor = np.random.default_rng(0).standard_normal(pieces.measured.shape)
    poor[0] = -pieces.measured[0]
    require_units(machine, pieces, poor)


def test_one_session_with_the_other_sign_than_all_others_is_refused(arm):
    machine, pieces = arm
    good = pieces.measured.copy()
    good[0] *= -1
    with pytest.raises(SerpentError, match=r"of s0 would fit .* with the other sign"):
        require_units(machine, pieces, good)


def test_a_note_on_all_logs_is_said_once(tmp_path):
    logs = [held_models.log(tmp_path / f"run_{n}.csv", n) for n in range(3)]
    notes = notes_on(read_logs(open_machine(EXAMPLE.write(tmp_path)), logs))
    assert len(notes) == len(set(notes)) == 1, notes
