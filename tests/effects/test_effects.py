"""Test the order of the arm's effects, their files, and their stability at its control period."""

from dataclasses import replace

import mujoco
import mujoco.batch
import numpy as np
import pytest
from motion import wander
from numpy.testing import assert_allclose, assert_array_equal

from experiments.arm_catalogue import CATALOGUE
from serpent_twin import effects, stored
from serpent_twin.effects.strands import ALL
from serpent_twin.errors import SerpentError
from serpent_twin.sim import twin_model
from serpent_twin.sim.many_twins import impose
from serpent_twin.sim.twin_model import TwinModel

every = pytest.mark.parametrize("kind", CATALOGUE.values(), ids=CATALOGUE)


def test_lookalikes_are_mutual():
    pairs = {(a, b) for a, kind in CATALOGUE.items() for b in kind.confused_with}
    assert pairs == {(b, a) for a, b in pairs}


@every
def test_stable_over_its_whole_range(kind):
    name, allowed = next(iter(effects.ranges(kind).items()))
    for strength in (1e-4 * allowed.typical, allowed.high):
        strong = replace(kind.variants()[0], **{name: strength})
        assert not impose([TwinModel(effects=(strong,))], wander(30, pace=0.08)).unstable.any()


@every
def test_comes_back_from_twin_json(kind, tmp_path):
    arm = TwinModel(effects=(kind.variants()[-1],))
    twin_model.write(tmp_path / "twin.json", arm, {"arm": "made for a test"})
    assert twin_model.read(tmp_path / "twin.json") == arm


@every
def test_twin_xml_holds_all_that_mjcf_can_say(kind):
    """Numbers in XML have six digits."""
    arm = TwinModel(effects=kind.variants()[:1])
    xml = arm.xml()
    ours, read = arm.spec().compile(), mujoco.MjModel.from_xml_string(xml)
    for name in mujoco.batch.MODEL_FIELDS - {"body_user", "key_time"}:
        owner, _, field = name.rpartition(".")
        a, b = (getattr(m.opt if owner else m, field) for m in (ours, read))
        if isinstance(a, np.ndarray) and np.issubdtype(a.dtype, np.number):
            assert_allclose(b, a, rtol=1e-4, atol=1e-7, err_msg=name)
    assert (effects.name_of(kind) in xml.splitlines()[0]) == kind.acts()


def test_order_of_acting_is_the_cables_way():
    """What winds the cables comes first, what rubs by their tension last, however they are given."""
    stretch = wander(8)
    several = [
        effects.by_name(n).variants()[0] for n in ("gear_friction", "cable_creep", "gear_backlash")
    ]
    one, other = (
        impose([TwinModel(effects=tuple(order))], stretch) for order in (several, several[::-1])
    )
    assert_array_equal(one.load, other.load)
    alone = impose([TwinModel(effects=tuple(several[:1]))], stretch)
    assert not np.array_equal(alone.load, one.load)


def test_files_from_before_a_parameter_hold_what_held_then():
    creep = {"name": "cable_creep", "fraction": 0.2, "time": 50.0}
    flex = {"name": "link_flex", "compliance": 0.05}
    held = {"name": "payload", "mass": 0.1, "place": 0.09}
    found = [
        effects.restored(stored.take(entry, effects.Stored, "an effect"))
        for entry in (creep, flex, held)
    ]
    assert (found[0].strand, found[1].twist, found[2].place) == (ALL, 0.0, 0.09)
    lacking = {"name": "clamp_slip", "rate": 1e-5, "grip": 3.0}
    with pytest.raises(SerpentError, match="lacks strand"):
        stored.take(lacking, effects.Stored, "an effect")


def test_one_strand_of_another_machine_is_refused():
    spec = mujoco.MjSpec()
    spec.add_tendon(name="cable")
    with pytest.raises(SerpentError, match=r"has 1 strands, and strand 3 .* Set strand to -1"):
        CATALOGUE["cable_stiffening"](500.0, strand=3.0).edit(spec)


def test_an_unknown_effect_or_parameter_is_named():
    with pytest.raises(SerpentError, match="no effect 'gremlins'; there are: base_tilt, "):
        effects.by_name("gremlins")
    entry = {"name": "payload", "mass": 0.1, "place": 0.09, "colour": 1.0}
    with pytest.raises(SerpentError, match=r"has colour, .* known are name, mass, place"):
        stored.take(entry, effects.Stored, "an effect")
