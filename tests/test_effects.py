"""Is every effect absent at zero, present otherwise, described, stored and stable?"""

from dataclasses import fields, replace

import mujoco
import mujoco.batch
import numpy as np
import pytest
from motion import wander
from numpy.testing import assert_allclose, assert_array_equal

from serpent_twin import effects, stored
from serpent_twin.effects import CATALOGUE
from serpent_twin.errors import SerpentError
from serpent_twin.sim import twin_model
from serpent_twin.sim.many_twins import impose
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

every = pytest.mark.parametrize("kind", CATALOGUE.values(), ids=CATALOGUE)


@every
def test_says_what_it_is(kind):
    assert "Source:" in kind.__doc__ and kind.shows_in
    assert set(kind.confused_with) <= set(CATALOGUE) - {effects.name_of(kind)}
    for name, allowed in effects.ranges(kind).items():
        assert allowed.unit and name
        assert allowed.low <= allowed.typical <= allowed.high
        assert allowed.low <= kind.__dataclass_fields__[name].default <= allowed.high
    assert effects.ranges(kind)[fields(kind)[0].name].fitted


def test_lookalikes_are_mutual():
    pairs = {(a, b) for a, kind in CATALOGUE.items() for b in kind.confused_with}
    assert pairs == {(b, a) for a, b in pairs}


@every
def test_absent_by_default_present_at_typical_strengths(kind):
    assert kind().absent
    assert all(not variant.absent for variant in kind.variants())
    assert len({repr(variant) for variant in kind.variants()}) == len(kind.variants())


@every
def test_zero_is_the_nominal_twin_bit_for_bit(kind):
    """Alone, and beside a run of full strength if both are of one structure."""
    stretch = wander(8)
    nominal = impose([NOMINAL_TWIN], stretch)
    zero = impose([TwinModel(effects=(kind(),))], stretch)
    for name, value in vars(nominal).items():
        assert_array_equal(getattr(zero, name), value)
    strong = TwinModel(effects=kind.variants()[:1])
    try:
        both = impose([TwinModel(effects=(kind(),)), strong], stretch)
    except SerpentError as error:
        assert "structure" in str(error) and not kind.acts()
    else:
        assert_array_equal(both.marker[0], nominal.marker[0])
        assert_array_equal(both.load[0], nominal.load[0])
    assert len(TwinModel(effects=(kind(),)).active) == 0


@every
def test_changes_what_is_measured(kind):
    stretch = wander(60, pace=0.06)
    nominal, changed = (
        impose([TwinModel(effects=several)], stretch) for several in ((), kind.variants()[:1])
    )
    moved = np.linalg.norm(changed.marker - nominal.marker, axis=-1).mean()
    assert not changed.unstable.any()
    assert moved > 1e-5 or np.abs(changed.load - nominal.load).mean() > 1e-4


@every
def test_runs_side_by_side_are_the_runs_alone(kind):
    stretch, first = wander(8), kind.variants()[0]
    strength = fields(kind)[0].name
    stronger = replace(first, **{strength: 1.5 * getattr(first, strength)})
    alone, both = (
        impose([TwinModel(effects=(each,)) for each in several], stretch)
        for several in ((stronger,), (first, stronger))
    )
    assert_array_equal(both.marker[1], alone.marker[0])
    assert_array_equal(both.load[1], alone.load[0])


@every
def test_bounds_are_kept(kind):
    for name, allowed in effects.ranges(kind).items():
        with pytest.raises(SerpentError, match=f"{name} is .* must lie within"):
            kind(**{name: allowed.high + 1})


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


def test_an_unknown_effect_or_parameter_is_named():
    with pytest.raises(SerpentError, match="no effect 'gremlins'; there are: base_tilt, "):
        effects.by_name("gremlins")
    entry = {"name": "payload", "mass": 0.1, "place": 0.09, "colour": 1.0}
    with pytest.raises(SerpentError, match=r"has colour, .* known are name, mass, place"):
        stored.take(entry, effects.Stored, "an effect")
