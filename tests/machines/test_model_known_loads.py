"""Test loads that sessions are known to carry, beside equations of motion that know nothing of MuJoCo."""

import held_models
import mujoco
import numpy as np
import pytest
from example import Example, opened
from held_models import MASSES, MJCF, TOML, torques

from serpent_twin.errors import SerpentError
from serpent_twin.identification.check_logs import Check, check
from serpent_twin.identification.run import Trace, trace
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.numbers import change_compiled
from serpent_twin.machines.rig import notes_on
from serpent_twin.stored import read_json

LOAD, WRONG = 2.0, 1.15  # [kg]; the motors' torque constants over those of machine.toml
TIP = MJCF.replace('<joint name="elbow"', '<site name="tip" pos="0 0 -0.3"/><joint name="elbow"')
KNOWN = f"""
[[known]]
number = "load"
of = "tip"
value = {LOAD}
sessions = ["loaded_*"]
"""
UNSURE = TOML.replace("scale = 0.05 }", f"ratio = 0.2, scale = {0.05 / WRONG} }}").replace(
    "scale = 0.04 }", f"ratio = 0.2, scale = {0.04 / WRONG} }}"
)


def loaded(q, v, a):
    """Torque for the load at the tip [N m], (T, 2)."""
    return torques(q, v, a, (MASSES[0], MASSES[1] + LOAD)) - torques(q, v, a)


def written(folder, toml):
    """The machine, and a folder with logs of the arm with and without the load."""
    for n in range(2):
        held_models.log(folder / "logs" / f"bare_{n}.csv", n)
        held_models.log(folder / "logs" / f"loaded_{n}.csv", 2 + n, loaded)
    return Example(TIP, toml).write(folder / "machine"), folder / "logs"


def test_a_load_needs_the_torque_that_the_equations_of_motion_say(tmp_path):
    log = held_models.log(tmp_path / "loaded_0.csv", 0, loaded, noise=0.0, step=0.0)
    case, pieces, at = opened(Example(TIP, TOML + KNOWN).write(tmp_path / "machine"), log)
    off = pieces.measured - case.machine.respond([at], pieces)[0]
    assert np.nanmax(np.abs(off)) < 1e-3 * np.nanmax(np.abs(pieces.measured))


def test_a_load_is_a_body_fastened_at_the_site():
    """Anywhere in a body whose principal axes are not those of its frame."""
    box = """<mujoco><worldbody><body><joint/><joint axis="1 2 3"/>
    <geom type="box" size=".1 .2 .3" pos=".1 0 .2" euler="10 20 30"/>
    <frame pos="0 .1 0" euler="0 0 40"><site name="a" pos=".3 .1 0"/>{}</frame></body></worldbody></mujoco>"""
    welded = '<body pos=".3 .1 0"><inertial pos="0 0 0" mass="2" diaginertia="0 0 0"/></body>'
    model = mujoco.MjModel.from_xml_string(box.format(""))
    change_compiled(model, "load", 0, 2.0)
    torque = []
    for each in (model, mujoco.MjModel.from_xml_string(box.format(welded))):
        data = mujoco.MjData(each)
        data.qpos[:], data.qvel[:], data.qacc[:] = (0.4, -0.7), (1.0, 2.0), (-3.0, 5.0)
        mujoco.mj_inverse(each, data)
        torque.append(data.qfrc_inverse.copy())
    np.testing.assert_allclose(torque[0], torque[1], rtol=1e-9)


def test_torque_constants_follow_from_a_known_load(tmp_path):
    toml = 'candidates = ["hinge_friction@elbow"]\n' + UNSURE + KNOWN
    machine, logs = written(tmp_path, toml)
    out = tmp_path / "trace"
    trace(Trace((logs,), out, machine=machine))
    found = read_json(out / "diagnosis.json")
    assert found["effects"] == []
    for name in ("scale of i1", "scale of i2"):
        about = found["calibration"][name]
        assert about["low_ratio"] < WRONG < about["high_ratio"]
        assert about["value_ratio"] == pytest.approx(WRONG, rel=2e-3)


@pytest.mark.parametrize("known", ["", KNOWN])
def test_without_a_known_load_constants_and_masses_have_one_factor(tmp_path, known):
    machine, logs = written(tmp_path, UNSURE + known)
    for each in () if known else logs.glob("loaded_*"):
        each.unlink()
    found = check(Check((logs,), machine=machine))
    factors = [each for each in found.combined if each.told == "their ratios"]
    names = {"scale of i1", "scale of i2", "mass of upper", "mass of lower"}
    assert [names & {*each.changes} for each in factors] == ([] if known else [names])
    assert bool([each for each in found.combined if "scale of i1" in each.changes]) == (not known)


def test_a_note_says_which_sessions_carry_a_load(tmp_path):
    machine, logs = written(tmp_path, TOML + KNOWN)
    (note,) = (each for each in notes_on(open_machine(machine).read(logs)) if "load" in each)
    assert note == "machine.toml states 2 for the load of tip in loaded_0 and loaded_1."
    none = logs / "bare_0.csv"
    assert any(
        "in no session: none is named loaded_*" in n
        for n in notes_on(open_machine(machine).read(none))
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('of = "tip"', 'of = "top"', r"known\[0\].of is 'top', which the model lacks"),
        ("value = 2.0", "", r"known\[0\] must have either columns or a value"),
        ("value = 2.0", 'value = 2.0\ncolumns = ["kg"]', "must have either columns or a value"),
        ("value = 2.0", "value = -2.0", "makes the load of tip -2, which is no load"),
        ("[[known]]", KNOWN.replace("loaded_", "l") + "[[known]]", "two .* load of tip in .* loaded_0"),
        ('"load"', '"site x"', r"known\[0\].number"),
    ],
)  # fmt: skip
def test_no_load_is_refused(tmp_path, old, new, said):
    toml = TOML + KNOWN.replace(old, new)
    log = held_models.log(tmp_path / "loaded_0.csv", 0)
    with pytest.raises(SerpentError, match=said):
        open_machine(Example(TIP, toml).write(tmp_path / "machine")).read(log)
