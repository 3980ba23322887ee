"""Test that a twin model is stored whole, and that anything else is refused in words."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from serpent_twin.arm import mjcf
from serpent_twin.arm.deviations import EXACT, GEOMETRY, Deviations
from serpent_twin.arm.geometry import ARM, markers
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN
from serpent_twin.errors import SerpentError
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

PAYLOAD, FRICTION = KNOWN["payload"](0.04), KNOWN["cable_friction"](0.1)
PAYLOAD_FILE = {"name": "payload", "mass": 0.04, "place": 0.09}


def unlike(seed=0):
    """An arm of which every number differs from the nominal one."""
    rng = np.random.default_rng(seed)
    sizes = {name: len(value) for name, value in vars(EXACT).items()}
    parts = {name: tuple(rng.normal(0, 1e-3, size).tolist()) for name, size in sizes.items()}
    parts["jaw_held"] = (1.0,)
    return TwinModel(
        replace(NOMINAL, strand_stiffness=1.5e4), Deviations(**parts), (PAYLOAD, FRICTION)
    )


def test_comes_back_whole(tmp_path):
    twin_model.write(tmp_path / "twin.json", unlike(), {"arm": "a"})
    assert twin_model.read(tmp_path / "twin.json") == unlike()
    assert json.loads((tmp_path / "twin.json").read_text())["arm"] == "a"


def test_twin_xml_stands_alone(tmp_path):
    twin_model.write(tmp_path / "twin.json", unlike(), {})
    text = (tmp_path / "twin.xml").read_text()
    assert "only twin.json has these effects: cable_friction." in text.splitlines()[0]
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml"))
    bare = unlike().built.link_mass[8] - ARM.jaw_mass
    assert model.body("link9").mass[0] == pytest.approx(bare + 0.04, rel=1e-5)


def test_the_nominal_design_is_the_nominal_twin():
    assert NOMINAL_TWIN.spec().to_xml() == mjcf.build().to_xml()
    assert "all of this arm's effects are in this file" in NOMINAL_TWIN.xml()


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
    moved = np.reshape(t.marker, (9, 3))
    assert sites == pytest.approx(np.array(arm.arm.marker) + moved, abs=1e-9)
    bodies = [model.body(f"link{i}") for i in range(1, 10)]
    masses = np.array([each.mass[0] for each in bodies])
    masses[8] += model.body("jaw").mass[0] - PAYLOAD.mass
    assert masses == pytest.approx(arm.arm.link_mass * np.exp(t.link_mass))
    places = [each.pos[0] for each in bodies[1:]]
    assert places == pytest.approx(
        np.array(arm.arm.link_length[:-1]) * (1 + np.array(t.link_length[:-1]))
    )


def test_its_markers_are_seen_where_its_geometry_says():
    arm, joint = unlike(), np.random.default_rng(1).normal(0, 0.3, 9)
    model = arm.spec(motors=False).compile()
    data = mujoco.MjData(model)
    data.qpos[:9] = joint
    mujoco.mj_forward(model, data)
    seen = data.sensordata[: 3 * 9].reshape(9, 3)
    assert seen == pytest.approx(markers(joint, arm.built), abs=1e-8)


def test_with_effect_adds_or_replaces():
    arm = NOMINAL_TWIN.with_effect(PAYLOAD).with_effect(FRICTION)
    assert arm.effects == (PAYLOAD, FRICTION)
    heavier = KNOWN["payload"](0.05)
    assert set(arm.with_effect(heavier).effects) == {FRICTION, heavier}


def test_fingerprint_tells_physics_apart():
    same = TwinModel(effects=(KNOWN["cable_creep"](0.0, time=20.0),))
    prints = {d.fingerprint() for d in (NOMINAL_TWIN, unlike(), unlike(1))}
    prints |= {NOMINAL_TWIN.with_effect(e).fingerprint() for e in (PAYLOAD, FRICTION)}
    prints |= {TwinModel(replace(NOMINAL, servo_lag=0.02)).fingerprint()}
    assert len(prints) == 6
    assert same.fingerprint() == NOMINAL_TWIN.fingerprint()


def stored():
    return twin_model.to_dict(NOMINAL_TWIN.with_effect(PAYLOAD))


def without(key, group=None):
    values = stored()
    del (values[group] if group else values)[key]
    return values


def having(value, *path):
    values = part = stored()
    for step in path[:-1]:
        part = part[step]
    part[path[-1]] = value
    return values


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (having("a cake", "kind"), 'kind is the text "a cake"; it must be "serpent_twin design"'),
        (having(1, "schema_version"), "schema_version is 1; it must be 4. Give the twin.json"),
        (having(5, "schema_version"), "schema_version is 5; it must be 4. A newer version of serp"),
        (having([{"kind": "payload"}], "effects"), r"effects\[0\] lacks name"),
        (
            having([{"name": "gremlins"}], "effects"),
            r'effects\[0\].name is the text "gremlins"; .*payl',
        ),
        (having(9.0, "effects", 0, "mass"), r"effects\[0\].mass is 9.0; .* from 0 to 2 kg"),
        (having([PAYLOAD_FILE, PAYLOAD_FILE], "effects"), "effects has payload twice"),
        (having([{"name": "payload", "mass": 0.1}], "effects"), r"effects\[0\] lacks place"),
        (having(1.0, "parameters", "colour"), "parameters has colour, which is unknown"),
        (having([0.0], "tolerances", "marker"), "marker is a list of 1 value; .* 27 numbers"),
        (having(float("nan"), "tolerances", "marker", 3), r"marker\[3\] is NaN; .* to 0.1 m"),
        (
            having(1.0, "tolerances", "marker", 26),
            r"tolerances.marker\[26\] is 1.0; .* from -0.1 to",
        ),
        (having(-1.2, "tolerances", "winch_radius", 2), r"winch_radius\[2\] is -1.2; .* from -0.5"),
        (having(800.0, "tolerances", "strand_stiffness", 0), "from -10 to 10"),
        (having([0.5], "tolerances", "jaw_held"), "jaw_held is 0.5; it must be 0 or 1"),
        (having([2.0], "tolerances", "jaw_held"), r"jaw_held\[0\] is 2.0"),
        (having(-0.1, "parameters", "joint_damping"), "joint_damping is -0.1; .* to 10 N m s/rad"),
        (having(1e30, "parameters", "strand_stiffness"), "from 0 to 1e.09 N/m"),
        (
            having(True, "parameters", "servo_lag"),
            "parameters.servo_lag is true; .* from 0 to 10 s",
        ),
        (having("5", "parameters", "servo_lag"), 'parameters.servo_lag is the text "5"'),
        (having(None, "tolerances"), "tolerances is null; it must be a table of keys"),
        (having(1, "colour"), "it has colour, which is unknown"),
    ],
)
def test_what_is_no_twin_is_refused(tmp_path, values, message):
    file = tmp_path / "twin.json"
    file.write_text(json.dumps(values))
    with pytest.raises(SerpentError, match=message) as error:
        twin_model.read(file)
    assert str(file) in str(error.value)


@pytest.mark.parametrize("versioned", [True, False])
def test_a_twin_that_lacks_any_key_is_refused_by_name(tmp_path, versioned):
    """A file without a version may be from before servos lagged and jaws rubbed, one with it may not."""
    whole = stored()
    paths = [(group, key) for group in ("parameters", "tolerances") for key in whole[group]]
    for group, key in [*paths, *((None, k) for k in ("kind", "effects", "parameters"))]:
        values = without(key, group)
        if not versioned:
            del values["schema_version"]
        (tmp_path / "twin.json").write_text(json.dumps(values))
        if not versioned and key in ("servo_lag", "jaw_friction"):
            found = twin_model.read(tmp_path / "twin.json")
            assert found.parameters.servo_lag == found.tolerances.jaw_friction[0] == 0.0
            continue
        with pytest.raises(SerpentError, match=f"{group or 'it'} lacks {key}"):
            twin_model.read(tmp_path / "twin.json")


def test_the_earliest_files_are_read_as_what_they_said(tmp_path):
    """Files from before hinges crept, jaws were held or rubbed, servos lagged and geometry was calibrated."""
    values = stored()
    del values["tolerances"]["jaw_friction"]
    (tmp_path / "twin.json").write_text(json.dumps(values | {"schema_version": 3}))
    assert twin_model.read(tmp_path / "twin.json") == NOMINAL_TWIN.with_effect(PAYLOAD)
    for name in GEOMETRY:
        del values["tolerances"][name]
    (tmp_path / "twin.json").write_text(json.dumps(values | {"schema_version": 2}))
    assert twin_model.read(tmp_path / "twin.json") == NOMINAL_TWIN.with_effect(PAYLOAD)
    del values["schema_version"], values["parameters"]["servo_lag"]
    del values["parameters"]["transition_velocity"], values["tolerances"]["transition_velocity"]
    del values["tolerances"]["jaw_held"]
    (tmp_path / "twin.json").write_text(json.dumps(values))
    assert twin_model.read(tmp_path / "twin.json") == NOMINAL_TWIN.with_effect(PAYLOAD)


def test_a_key_that_is_given_twice_is_refused(tmp_path):
    text = json.dumps(stored()).replace('"gear_friction": 0.0269', '"servo_lag": 0.1')
    (tmp_path / "twin.json").write_text(text)
    with pytest.raises(SerpentError, match="has servo_lag twice in parameters"):
        twin_model.read(tmp_path / "twin.json")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"kind": "serpent_twin design"}', "3"])
def test_a_damaged_file_is_refused(tmp_path, text):
    file = tmp_path / "twin.json"
    file.write_text(text)
    with pytest.raises(SerpentError, match=r"twin\.json"):
        twin_model.read(file)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SerpentError, match=r"nothing\.json cannot be read"):
        twin_model.read(tmp_path / "nothing.json")
