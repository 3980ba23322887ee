"""Is a design stored whole, and is what is none refused in words?"""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from serpent_twin import design, mjcf
from serpent_twin.design import NOMINAL_DESIGN, Design
from serpent_twin.effects import CATALOGUE
from serpent_twin.errors import SerpentError
from serpent_twin.parameters import NOMINAL
from serpent_twin.tolerances import EXACT, Tolerances

PAYLOAD, FRICTION = CATALOGUE["payload"](0.04), CATALOGUE["cable_friction"](0.1)


def unlike(seed=0):
    """An arm of which every number differs from the nominal one."""
    rng = np.random.default_rng(seed)
    sizes = {name: len(value) for name, value in vars(EXACT).items()}
    parts = {name: tuple(rng.normal(0, 1e-3, size).tolist()) for name, size in sizes.items()}
    return Design(
        replace(NOMINAL, strand_stiffness=1.5e4), Tolerances(**parts), (PAYLOAD, FRICTION)
    )


def test_comes_back_whole(tmp_path):
    design.write(tmp_path / "twin.json", unlike(), {"arm": "a"})
    assert design.read(tmp_path / "twin.json") == unlike()
    assert json.loads((tmp_path / "twin.json").read_text())["arm"] == "a"


def test_twin_xml_stands_alone(tmp_path):
    design.write(tmp_path / "twin.json", unlike(), {})
    text = (tmp_path / "twin.xml").read_text()
    assert "twin.json holds: cable_friction." in text.splitlines()[0]
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml"))
    assert model.body("payload").mass[0] == pytest.approx(0.04)


def test_the_nominal_design_is_the_nominal_twin():
    assert NOMINAL_DESIGN.spec().to_xml() == mjcf.build().to_xml()
    assert "all of this arm's effects are in this file" in NOMINAL_DESIGN.xml()


def test_tolerances_reach_the_parts_that_they_name():
    arm, t = unlike(), unlike().tolerances
    model = arm.spec().compile()
    p = arm.parameters
    assert model.tendon_stiffness == pytest.approx(p.strand_stiffness * np.exp(t.strand_stiffness))
    assert model.tendon_lengthspring[:, 1] == pytest.approx(
        p.strand_slack + np.array(t.strand_slack)
    )
    joints = [model.joint(f"joint{i}").dofadr[0] for i in range(1, 10)]
    assert model.dof_frictionloss[joints] == pytest.approx(
        p.joint_friction * np.exp(t.joint_friction)
    )
    assert model.dof_damping[joints] == pytest.approx(p.joint_damping * np.exp(t.joint_damping))
    sites = np.array([model.site(f"marker{i}").pos for i in range(1, 10)])
    assert sites == pytest.approx(np.array(arm.arm.marker) + t.marker_offset, abs=1e-9)


def test_with_effect_adds_or_replaces():
    arm = NOMINAL_DESIGN.with_effect(PAYLOAD).with_effect(FRICTION)
    assert arm.effects == (PAYLOAD, FRICTION)
    heavier = CATALOGUE["payload"](0.05)
    assert set(arm.with_effect(heavier).effects) == {FRICTION, heavier}


def test_fingerprint_tells_physics_apart():
    same = Design(effects=(CATALOGUE["cable_creep"](0.0, time=20.0),))
    prints = {d.fingerprint() for d in (NOMINAL_DESIGN, unlike(), unlike(1))}
    prints |= {NOMINAL_DESIGN.with_effect(e).fingerprint() for e in (PAYLOAD, FRICTION)}
    prints |= {Design(replace(NOMINAL, servo_lag=0.02)).fingerprint()}
    assert len(prints) == 6
    assert same.fingerprint() == NOMINAL_DESIGN.fingerprint()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "a cake"}, "it is no twin"),
        ({"effects": [{"name": "gremlins"}]}, "no effect 'gremlins'"),
        (
            {"effects": [{"name": "payload", "mass": 9.0}]},
            "mass is 9 kg; it must lie within 0 … 2 kg",
        ),
        ({"parameters": {"colour": 1.0}}, "parameters are unknown: colour"),
        ({"tolerances": {"marker": [0.0]}}, "marker must be 27 finite numbers"),
        ({"tolerances": {"marker": [float("nan")] * 27}}, "marker must be 27 finite numbers"),
    ],
)
def test_what_is_no_twin_is_refused(tmp_path, change, message):
    file = tmp_path / "twin.json"
    file.write_text(json.dumps(design.to_dict(NOMINAL_DESIGN) | change))
    with pytest.raises(SerpentError, match=message) as error:
        design.read(file)
    assert str(file) in str(error.value)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"kind": "serpent_twin design"}', "3"])
def test_a_damaged_file_is_refused(tmp_path, text):
    file = tmp_path / "twin.json"
    file.write_text(text)
    with pytest.raises(SerpentError, match=r"twin\.json"):
        design.read(file)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SerpentError, match=r"nothing\.json cannot be read"):
        design.read(tmp_path / "nothing.json")
