"""Test what is sought in a model of many joints, and what is said of the rest."""

import numpy as np
import pytest
from example import table

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine

JOINTS = 20


def opened(folder, candidates="", base="", measured=JOINTS):
    """A chain of levers on servos, of which the first so many are measured."""
    folder.mkdir(parents=True, exist_ok=True)
    body = "".join(
        f'<body name="link{n}" pos="0 0 -0.1"><joint name="j{n}" axis="0 1 0" damping="0.1"/>'
        '<geom size="0.02" pos="0 0 -0.05" mass="0.1" contype="0" conaffinity="0"/>'
        for n in range(JOINTS)
    ) + "</body>" * JOINTS  # fmt: skip
    if base:
        body = f'<body name="pelvis">{base}<geom size=".05" mass="1"/>{body}</body>'
    servos = "".join(f'<position name="s{n}" joint="j{n}" kp="5"/>' for n in range(JOINTS))
    (folder / "chain.xml").write_text(
        f"<mujoco><worldbody>{body}</worldbody><actuator>{servos}</actuator></mujoco>"
    )
    drives = "".join(
        f'[[drive]]\nactuator = "s{n}"\ncolumn = "c{n}"\nunit = "rad"\n' for n in range(JOINTS)
    )
    readings = "".join(
        f'[[measured]]\njoint = "j{n}"\ncolumns = ["q{n}"]\nunit = "rad"\nnoise = 0.001\n'
        for n in range(measured)
    )
    (folder / "machine.toml").write_text(
        'schema_version = 1\nmodel = "chain.xml"\nrows = "motion"\nsteps = 8\n'
        f'{candidates}\ntime = {{ column = "t", unit = "s" }}\n{drives}{readings}'
    )
    time = np.arange(0, 4, 0.02)
    goals = 0.02 * np.sin(np.outer(time, 1 + 0.1 * np.arange(JOINTS)))
    rows = np.c_[time, goals, goals[:, :measured]]
    names = ["t", *(f"c{n}" for n in range(JOINTS)), *(f"q{n}" for n in range(measured))]
    table(folder / "log.csv", f"{','.join(names)}", rows, 6)
    rig = open_machine(folder / "machine.toml")
    return rig.open(rig.read(folder / "log.csv"))


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    return opened(tmp_path_factory.mktemp("chain"))


def test_friction_is_sought_at_every_joint_and_a_payload_at_the_end(chain):
    known = chain.candidates
    assert all(f"hinge_friction@j{n}" in known for n in range(JOINTS))
    carried = [name for name in known if name.startswith("payload")]
    assert carried == [f"payload@link{JOINTS - 1}"]
    assert not any(name.startswith("stribeck") for name in known)
    alike = {other for each in known.values() for other in each.confused_with}
    assert alike <= set(known)


def test_what_is_not_sought_is_said_with_what_to_do(chain):
    text = " ".join(chain.not_sought)
    assert "stribeck at any of 20 places" in text and "payload at 18 of 19 places" in text
    assert "Name what you suspect in machine.toml, such as candidates" in text
    assert "No law is composed" not in text and "Nothing measures" not in text


def test_what_the_file_names_is_sought_however_much_it_is(tmp_path):
    case = opened(tmp_path, 'candidates = ["stribeck@*", "payload@link7"]')
    assert len(case.candidates) == JOINTS + 1 and "Not sought" not in " ".join(case.not_sought)
    with pytest.raises(SerpentError, match="candidates has 'stribek@j1'"):
        opened(tmp_path, 'candidates = ["stribek@j1"]')


def test_joints_that_nothing_measures_are_named(tmp_path):
    case = opened(tmp_path, base='<freejoint name="root"/>', measured=JOINTS - 2)
    text = " ".join(case.not_sought)
    assert "Nothing measures the free joint root and the 2 hinges j18, j19: what begins" in text


def test_a_finger_that_follows_a_measured_one_is_known(tmp_path):
    """An equality of the model makes the finger follow."""
    path = tmp_path / "hand"
    assert "the hinge j19" in " ".join(opened(path, measured=JOINTS - 1).not_sought)
    model = path / "chain.xml"
    equal = '<equality><joint joint1="j19" joint2="j18"/></equality></mujoco>'
    model.write_text(model.read_text().replace("</mujoco>", equal))
    rig = open_machine(path / "machine.toml")
    assert "j19" not in " ".join(rig.open(rig.read(path / "log.csv")).not_sought)
