"""Test how numbers of a model are scaled, which sessions state or a fit changes, against bare MuJoCo."""

import mujoco
import numpy as np
import pytest
from example import Example
from measured_logs import write_log

from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.masses import state_all
from serpent_twin.machines.model.numbers import (
    NUMBERS,
    change_compiled,
    change_number,
    numbers_of,
)
from serpent_twin.machines.model.twin_file import with_arms

MJCF = """<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <body name="arm">
      <joint name="hinge" axis="0 1 0" stiffness="0.3" damping="0.02" frictionloss="0.01" armature="0.002"/>
      <body name="bob" pos="0.1 0.02 -0.2"><geom size="0.02" mass="0.2"/></body>
    </body>
    <body name="cart" pos="0 1 0">
      <joint name="rail" type="slide" axis="1 0 0" damping="0.5"/>
      <geom size="0.05" mass="1"/>
    </body>
  </worldbody>
  <actuator>
    <dcmotor name="motor" joint="hinge" motorconst="0.4" resistance="3" input="pos"
             controller="0.6 0 0.03 0 0 6"/>
    <position name="servo" joint="rail" kp="20" kv="2"/>
  </actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "model.xml"
rows = "motion"
start = 0.1
time = { column = "time", unit = "s" }
[[drive]]
actuator = "motor"
column = "goal"
unit = "rad"
enable = "on"
[[drive]]
actuator = "servo"
column = "goal_m"
unit = "m"
[[measured]]
joint = "hinge"
columns = ["angle"]
unit = "rad"
noise = 0.001
[[known]]
number = "mass"
of = "bob"
columns = ["grams"]
scale = 0.001
[[known]]
number = "controller gain"
of = "motor"
columns = ["gain", "volts"]
"""
VOLTS, CONSTANT, RESISTANCE = 6.0, 0.4, 3.0
PER_ERROR, PER_SPEED = (
    0.6 * 3 / 0.4,
    0.4 - 0.03 * 3 / 0.4,
)  # [V/rad], [V s/rad]: R/K (P e − D ω) + K ω


@pytest.mark.parametrize(
    "number",
    [n for n, kind in NUMBERS.items() if not (kind.added or kind.compiled or kind.of == "tendon")],
)
def test_one_number_is_scaled_and_all_others_stay(number):
    spec = mujoco.MjSpec.from_string(MJCF)
    if NUMBERS[number].stated:
        state_all(spec, spec.compile())
    before = {name: numbers_of(spec.compile(), name).copy() for name in NUMBERS}
    which = int(np.flatnonzero(before[number])[-1])
    change_number(spec, number, which, 1.7)
    after = spec.compile()
    for name, values in before.items():
        expected = values.copy()
        if name == number:
            expected[which] *= 1.7
        np.testing.assert_allclose(numbers_of(after, name), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("number", "constant", "resistance", "gain", "limit"),
    [
        ("motor constant", 1.3, 1, 1, 1),
        ("motor resistance", 1, 1.3, 1, 1),
        ("controller gain", 1, 1, 1.3, 1),
        ("voltage limit", 1, 1, 1, 1.3),
    ],
)
def test_a_motors_controller_gives_the_same_volts(number, constant, resistance, gain, limit):
    """Torque K/R (V − K ω) of V = P e + D ω within the limit: the law of a DC motor."""
    spec = mujoco.MjSpec.from_string(MJCF)
    change_number(spec, number, 0, 1.3)
    data = mujoco.MjData(model := spec.compile())
    k, most = CONSTANT * constant, VOLTS * limit
    for angle, rate, goal in ((0.1, 0.5, 0.3), (0.0, -3.0, 0.2), (0.0, 2.0, 3.0)):
        data.joint("hinge").qpos, data.joint("hinge").qvel = angle, rate
        data.ctrl[0] = goal
        mujoco.mj_forward(model, data)
        volts = np.clip(PER_ERROR * gain * (goal - angle) + PER_SPEED * rate, -most, most)
        torque = k / (RESISTANCE * resistance) * (volts - k * rate)
        assert data.actuator_force[0] == pytest.approx(torque, rel=1e-9)


def machine(folder, toml=TOML):
    """Write the model and its machine.toml."""
    return Example(MJCF, toml).write(folder)


def log(path, about, on=None, **more):
    """A motion of goals, in which readings of the hinge say nothing but that it is near zero."""
    time = np.arange(0, 2, 0.02)
    columns = {"time": time, "goal": 0.5 * np.sin(5 * time), "goal_m": 0.1 * np.sin(3 * time),
               "angle": 1e-9 * time, "on": 0 * time + 1 if on is None else on, **more}  # fmt: skip
    return write_log(path, about, **columns)


def responses(path, logs):
    """What the model shows of the hinge in each session."""
    rig = open_machine(path)
    runs = [run for each in logs for run in rig.read(each)]
    case = rig.open(runs)
    return case.machine.respond([ParameterVector.nominal(case.declared)], case.pieces(runs))[0]


def bare(change, on, steps=32):
    """The hinge's angle in bare MuJoCo, whose spec is changed; in some rows the model has no motor."""
    spec = mujoco.MjSpec.from_string(MJCF)
    change(spec)
    whole = spec.compile()
    spec.delete(spec.actuators[0])
    without = spec.compile()
    state, rate, found = np.zeros(2), np.zeros(2), []
    for t, enabled in enumerate(on):
        model = whole if enabled else without
        model.opt.timestep = 0.02 / steps
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = state, rate
        found.append(data.joint("hinge").qpos[0])
        goals = 0.5 * np.sin(5 * 0.02 * t), 0.1 * np.sin(3 * 0.02 * t)
        data.ctrl[:] = goals if enabled else goals[1:]
        mujoco.mj_step(model, data, steps)
        state, rate = data.qpos, data.qvel
    return np.array(found)


def test_each_session_has_the_numbers_that_it_states(tmp_path):
    on = np.ones(100)
    logs = [log(tmp_path / f"{n}.parquet", {"grams": g, "gain": gain, "volts": 5})
            for n, (g, gain) in enumerate(((200, 0.9), (500, 0.3)))]  # fmt: skip
    found = responses(machine(tmp_path / "machine"), logs)

    def heavier(spec):
        spec.body("bob").geoms[0].mass = 0.5
        spec.actuators[0].gainprm[4] *= 0.3 * 5 / PER_ERROR

    for seen, change in zip(found, (lambda spec: None, heavier), strict=True):
        np.testing.assert_allclose(seen[:, 0], bare(change, on), atol=4e-3)
    assert np.abs(found[0] - found[1]).max() > 0.1


def test_a_column_of_the_log_may_state_them(tmp_path):
    about = {"gain": 0.9, "volts": 5}
    stated = log(tmp_path / "a.parquet", about | {"grams": 500})
    column = log(tmp_path / "b.parquet", about, grams=np.full(100, 500.0))
    found = responses(machine(tmp_path / "machine"), [stated, column])
    np.testing.assert_array_equal(found[0], found[1])


def test_a_motor_that_is_switched_off_gives_no_force(tmp_path):
    on = (np.arange(100) // 30) % 2 == 0
    path = log(tmp_path / "a.parquet", {"grams": 200, "gain": 0.9, "volts": 5}, on=on)
    found = responses(machine(tmp_path / "machine"), [path])
    np.testing.assert_allclose(found[0, :, 0], bare(lambda spec: None, on), atol=4e-3)


ABOUT = {"grams": 200, "gain": 0.9, "volts": 5}


@pytest.mark.parametrize(
    ("about", "more", "said"),
    [
        (
            {"grams": 200, "gain": 0.9},
            {},
            r"states no number 'volts'.* entry of the metadata, which are",
        ),
        (ABOUT | {"grams": "heavy"}, {}, "states no number 'grams'"),
        (
            ABOUT | {"gain": -0.9},
            {},
            r"gain = -0.9 × volts = 5 makes the controller gain .*-4.5, .*scale",
        ),
        (ABOUT, {"grams": np.arange(100.0)}, r"column 'grams' is not one number .* Split the log"),
        (
            ABOUT,
            {"on": np.full(100, np.nan)},
            r"'on', which switches a drive, has no number in any row",
        ),
    ],
)
def test_logs_that_state_no_such_number_are_refused(tmp_path, about, more, said):
    rig = open_machine(machine(tmp_path / "machine"))
    with pytest.raises(SerpentError, match=said):
        rig.read(log(tmp_path / "a.parquet", about, **more))


def test_a_log_without_metadata_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        "time,goal,goal_m,angle,on\n" + "".join(f"{0.02 * n},0,0,0,1\n" for n in range(20))
    )
    with pytest.raises(SerpentError, match=r"states no number 'grams'.*which are none"):
        open_machine(machine(tmp_path / "machine")).read(path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('of = "bob"', 'of = "bib"', r"known\[0\].of is 'bib', which the model lacks"),
        ('number = "mass"\nof = "bob"', 'number = "body x"\nof = "arm"',
         r"known\[0\].of is 'arm', whose body x is 0 in the model"),
        ('["grams"]', '["goal"]', r"known\[0\].columns has 'goal', which is what drives motor already"),
        ('number = "controller gain"\nof = "motor"', 'number = "mass"\nof = "bob"',
         r"known\[1\].of is 'bob', whose mass is known already"),
        ('number = "mass"', 'number = "weight"', r"known\[0\].number"),
        ('enable = "on"', 'enable = "goal_m"', r"drive\[0\].enable is 'goal_m', which drives"),
    ],
)  # fmt: skip
def test_descriptions_of_no_such_number_are_refused(tmp_path, old, new, said):
    with pytest.raises(SerpentError, match=said):
        open_machine(machine(tmp_path, TOML.replace(old, new)))


def test_candidates_may_be_named(tmp_path):
    some = TOML.replace("rows =", 'candidates = ["*_friction@hinge", "command_delay"]\nrows =')
    rig = open_machine(machine(tmp_path / "some", some))
    runs = rig.read(log(tmp_path / "a.parquet", ABOUT))
    names = {"hinge_friction@hinge", "gear_friction@hinge", "command_delay"}
    assert set(rig.open(runs).candidates) == names
    other = open_machine(machine(tmp_path / "other", some.replace("command_delay", "delay")))
    with pytest.raises(SerpentError, match=r"candidates has 'delay', .* there are: gravity,"):
        other.open(runs)


WOUND = """<mujoco>
  <worldbody>
    <body><joint name="winch" axis="0 0 1"/><geom size="0.01" mass="0.1"/></body>
    <body pos="1 0 0"><joint name="hinge" axis="0 0 1"/><geom size="0.05" mass="0.1" pos="0.1 0 0"/></body>
  </worldbody>
  <tendon>
    <fixed name="cable" stiffness="500" springlength="-10 0.001">
      <joint joint="winch" coef="0.02"/><joint joint="hinge" coef="-0.03"/>
    </fixed>
  </tendon>
</mujoco>
"""


def test_a_moment_arm_is_changed_in_a_compiled_model_and_in_mjcf_alike():
    """Which no `MjSpec` can: pulls and torques are those of the MJCF with another coefficient."""
    spec = mujoco.MjSpec.from_string(WOUND)
    model, spec_xml = spec.compile(), spec.to_xml()
    assert numbers_of(model, "moment arm") == pytest.approx([0.02, 0.03])
    change_compiled(model, "moment arm", 0, 1.05)
    other = mujoco.MjModel.from_xml_string(with_arms(spec_xml, {"winch": 1.05}))
    wanted = mujoco.MjModel.from_xml_string(WOUND.replace('"0.02"', '"0.021"'))
    torques = []
    for each in (model, other, wanted):
        data = mujoco.MjData(each)
        data.qpos[:] = 1.2, -0.4
        mujoco.mj_forward(each, data)
        torques.append(data.qfrc_passive.copy())
    assert torques[2][0] < -0.3
    assert np.array(torques[:2]) == pytest.approx(np.tile(torques[2], (2, 1)), rel=1e-12)
