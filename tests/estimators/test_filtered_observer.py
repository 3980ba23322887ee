"""Test that loads correct a twin that is wrong, and do not change one that is right."""

from dataclasses import replace

import numpy as np
import pytest

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects.payload import Payload
from serpent_twin.estimators import find
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_folder
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import TwinModel

SOFT = TwinModel(
    replace(NOMINAL, strand_stiffness=4e3, strand_slack=6e-4, marker_noise=2e-4, load_noise=2e-3)
)
HEAVY = SOFT.with_effect(Payload(mass=0.05))


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """Sessions of an arm that carries 50 g."""
    folder = tmp_path_factory.mktemp("heavy")
    twin_model.write(folder / "twin.json", HEAVY, {})
    collect(Collect(folder / "logs", sessions=3, steps=240, workers=1, twin=folder / "twin.json"))
    return read_folder(folder / "logs")


def errors_mm(sessions, twin, **settings):
    """Errors of the observer and of the filter [mm], and the scatter that the latter chose [rad]."""
    train, validate, test = (cut([each], 4, 40) for each in sessions)
    found = []
    for name, given in (("observer", {}), ("filtered_observer", settings)):
        made = find(name)(4, twin=twin_model.to_dict(twin), **given)
        made.fit(train, validate, np.random.default_rng(0))
        told = made.follow(test.sessions[0])
        found.append(score(told.marker, test.marker).mean_mm)
    return *found, float(made.learned["scatter"])


def test_loads_correct_a_twin_that_knows_nothing_of_the_payload(sessions):
    observer, filtered, scatter = errors_mm(sessions, SOFT, scatters=(0.0, 4e-3), members=16)
    assert observer > 2
    assert scatter == 4e-3
    assert filtered < 0.95 * observer


def test_a_twin_that_is_right_is_left_alone(sessions):
    observer, filtered, scatter = errors_mm(sessions, HEAVY, scatters=(0.0, 8e-3), members=16)
    assert scatter == 0
    assert filtered == pytest.approx(observer, abs=1e-9)
