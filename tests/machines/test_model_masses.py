"""Test that masses of any model are changed as they are said to be."""

import numpy as np
import posed_models
import pytest

from serpent_twin.effects import KNOWN
from serpent_twin.machines.model import open_machine


def test_a_mass_that_is_added_takes_nothing_from_the_others(tmp_path):
    """Masses of this model are scaled to a total when it is compiled."""
    path = posed_models.machine(tmp_path)
    model = path.with_name("arm.xml")
    own = open_machine(path).described.model
    model.write_text(
        model.read_text().replace("<mujoco>", '<mujoco><compiler settotalmass="1.3"/>')
    )
    rig = open_machine(path)
    case = rig.open(rig.read(posed_models.log(tmp_path / "log.csv", 0)))
    heavier = case.machine.spec(
        np.zeros(len(case.declared)), [KNOWN["payload"](0.5, 0.0, at="tip")]
    ).compile()
    assert rig.described.model.body_mass.sum() == pytest.approx(1.3)
    assert heavier.body_mass.sum() == pytest.approx(1.8)
    ratio = rig.described.model.body_mass[1:] / own.body_mass[1:]
    np.testing.assert_allclose(ratio, 2.0)  # 0.65 kg before
    np.testing.assert_allclose(rig.described.model.body_inertia[1:] / own.body_inertia[1:], 2.0)
