"""Test that logs and descriptions that cannot be are refused in a sentence, before anything is fitted."""

import re

import moving_models
import numpy as np
import posed_models
import pytest
import swung_models
from paths import ROOT
from refusals import FOREIGN

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.description import (
    Description,
    DriveColumn,
    MeasuredColumns,
    Uncertain,
)
from serpent_twin.machines.model.sizes import sizes
from serpent_twin.units import TO_SI

CRANE = """<mujoco>
  <worldbody>
    <body name="trolley" pos="0 0 2">
      <joint name="rail" type="slide" axis="1 0 0" damping="8"/>
      <geom size="0.1" mass="3" contype="0" conaffinity="0"/>
      <body name="load">
        <joint name="swing" axis="0 1 0" damping="0.01"/>
        <geom size="0.05" pos="0 0 -0.6" mass="1" contype="0" conaffinity="0"/>
        <site name="hook" pos="0 0 -0.6"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="rail" gear="20" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
CRANE_TOML = """schema_version = 1
model = "crane.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [{ actuator = "drive", column = "current" }]
measured = [{ site = "hook", columns = ["x", "y", "z"], unit = "m", cameras = false, noise = 0.001 }]
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """A log of each model, as text."""
    folder = tmp_path_factory.mktemp("logs")
    return {
        posed_models: posed_models.log(folder / "poses.csv", 0, poses=20).read_text(),
        swung_models: swung_models.log(
            folder / "swing.csv", swung_models.slow(1, 6.0), 0
        ).read_text(),
    }


def refused(folder, model, text, toml=None, mjcf=None):
    """What is said of a log, a machine.toml and a model, each changed by a function."""
    path = model.machine(folder)
    for file, change in ((path, toml), (folder / re.findall(r'"(\w+\.xml)"', model.TOML)[0], mjcf)):
        if change:
            before = file.read_text()
            file.write_text(change(before))
            assert file.read_text() != before
    (folder / "log.csv").write_text(text)
    with pytest.raises(SerpentError) as error:
        rig = open_machine(path)
        rig.open(rig.read(folder / "log.csv"))
    said = str(error.value)
    assert "\n" not in said and not FOREIGN.search(said) and len(said) < 500, said
    return said


def cells(column, change):
    """A change of a log: of each value of a column, by its row."""

    def changed(text):
        head, *rows = text.splitlines()
        at = head.split(",").index(column)
        table = [row.split(",") for row in rows]
        for n, row in enumerate(table):
            row[at] = str(change(n, float(row[at])))
        return "\n".join([head, *(",".join(row) for row in table)])

    return changed


def earlier(column, rows):
    """A change of a log: a column by another clock, so many rows before the others."""

    def changed(text):
        head, *table = (row.split(",") for row in text.splitlines())
        at = head.index(column)
        for row, later in zip(table[:-rows], table[rows:], strict=True):
            row[at] = later[at]
        return "\n".join(map(",".join, [head, *table[:-rows]]))

    return changed


def lines(keep):
    """A change of a log: some of its lines."""
    return lambda text: "\n".join(keep(text.splitlines())) + "\n"


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (
            cells("angle", lambda n, v: np.degrees(v)),
            "rad where the range of the model's joint pivot",
        ),
        (cells("angle", lambda n, v: -v), "with the other sign"),
        (cells("angle", lambda n, v: "inf" if n == 9 else v), "'angle' is infinite in 1 row"),
        (cells("angle", lambda n, v: "lost" if n == 9 else v), "holds 'lost' in row 10"),
        (cells("angle", lambda n, v: "nan"), "'angle' holds nothing"),
        (
            cells("angle", lambda n, v: 0.3),
            "'angle', measured of joint pivot, is the same in every",
        ),
        (cells("goal_deg", lambda n, v: "nan" if n == 9 else v), "no number in 1 of 150 rows"),
        (cells("t_ms", lambda n, v: "" if n == 9 else v), "'t_ms', the time, has no number in 1"),
        (cells("t_ms", lambda n, v: v - 500 * (n > 70)), "'t_ms' does not increase in row 72"),
        (cells("t_ms", lambda n, v: v + 5000 * (n > 70)), "first 5.04 s pass after 2.8 s"),
        (cells("t_ms", lambda n, v: v + 15 * (n % 2)), "where rows are 0.0"),
        (cells("t_ms", lambda n, v: v / 1000), "4e-05 s apart, and the model's time step is 0.004"),
        (lines(lambda rows: rows[:50] + rows[90:]), "first 1.64 s pass after 1.92 s"),
        (earlier("angle", 13), "moves 0.48 s before 'goal_deg' tells it to"),
        (earlier("goal_deg", 22), "moves 0.92 s after 'goal_deg' tells it to"),
        (lines(lambda rows: rows[:2]), "has 1 row, fewer than 8"),
        (lines(lambda rows: rows[:1]), "has 0 rows, fewer than 8"),
        (lines(lambda rows: ["t_ms,angle,angle", *rows[1:]]), "two columns of one name: angle"),
    ],
)
def test_a_log_that_cannot_be_is_refused(tmp_path, told, change, wanted):
    assert wanted in refused(tmp_path, swung_models, change(told[swung_models]))


def test_columns_that_are_each_other_s_are_refused(tmp_path):
    """Two encoders whose columns are exchanged; so are the two drives' then, as far as a log can tell."""
    log = moving_models.log(tmp_path / "made.csv", 0).read_text()
    said = refused(tmp_path, moving_models, log, lambda text: text.replace("angle_1", "angle_0")
                   .replace("angle_2", "angle_1").replace("angle_0", "angle_2"))  # fmt: skip
    assert (
        "'angle_2' moves as the model's joint elbow does, and 'angle_1' as its joint shoulder"
        in said
    )
    assert "Exchange these columns" in said


def swap(before, after):
    return lambda text: text.replace(before, after)


@pytest.mark.parametrize(
    ("model", "toml", "mjcf", "wanted"),
    [
        (swung_models, swap('unit = "rad"', 'unit = "deg"'), None, "if its unit were rad, not deg"),
        (
            swung_models,
            swap('unit = "rad"', 'unit = "mrad"'),
            swap(' range="-120 120"', ""),
            "if its unit were rad, not mrad",
        ),
        (
            swung_models,
            swap('unit = "deg"', 'unit = "rad"'),
            swap(' ctrlrange="-1 1"', ""),
            "if the unit of 'goal_deg' were deg, not rad",
        ),
        (
            swung_models,
            swap('unit = "deg"', 'unit = "mm"'),
            None,
            "drive[0].unit is 'mm', of m; position servo of joint 'pivot' is in rad",
        ),
        (
            swung_models,
            swap('unit = "ms"', 'unit = "rad"'),
            None,
            "line 4: time.unit is 'rad', of rad",
        ),
        (swung_models, swap("scale = -1", "scale = 0"), None, "drive[0].scale is 0"),
        (swung_models, swap('["angle"]', '["t_ms"]'), None, "'t_ms', which is the time already"),
        (
            swung_models,
            swap('["angle"]', '["goal_deg"]'),
            None,
            "which is what drives servo already",
        ),
        (swung_models, swap('["angle"]', '["time"]'), None, "'time', which is the clock already"),
        (swung_models, None, swap('kp="4"', 'kp="1e9"'), "the model is unstable in log"),
        (
            swung_models,
            swap('"pivot"', '"fly"'),
            swap(
                "</worldbody>", '<body><freejoint name="fly"/><geom size="1"/></body></worldbody>'
            ),
            "'fly', a free joint",
        ),
        (
            posed_models,
            swap('"elbow_deg"', '"shoulder_deg"'),
            None,
            "what drives at_shoulder already",
        ),
        (posed_models, swap('"x", "y"', '"x", "x"'), None, "'x', which is measured of tip already"),
        (posed_models, swap('"mm"\n', '"m"\n'), None, "if its unit were mm, not m"),
        (posed_models, swap('"arm.xml"', '"."'), None, "model is '.', which is a folder"),
        (posed_models, swap('"arm.xml"', '""'), None, "it must be a text that is not empty"),
        (
            posed_models,
            swap('site = "tip"', 'site = "still"'),
            swap("</worldbody>", '<site name="still"/></worldbody>'),
            "'still', which no joint moves",
        ),
        (
            posed_models,
            lambda text: f'{text}[[uncertain]]\nnumber = "mass"\nof = ["up*", "upper"]\n',
            None,
            "'upper', whose mass is listed already",
        ),
        (
            posed_models,
            swap("cameras = false", "zero = 1"),
            None,
            "a site whose frame of the cameras is fitted, too",
        ),
        (
            posed_models,
            swap('unit = "deg"', 'unit = "deg"\nratio = 0.1'),
            None,
            "is of a joint or a tendon that follows a column",
        ),
        (
            posed_models,
            lambda text: f'{text}[[uncertain]]\nnumber = "joint damping"\nof = ["elbow"]\n',
            None,
            "'elbow', whose joint damping is 0",
        ),
    ],
)
def test_a_description_that_the_model_or_the_log_belies_is_refused(
    tmp_path, told, model, toml, mjcf, wanted
):
    assert wanted in refused(tmp_path, model, told[model], toml, mjcf)


def test_poses_that_are_all_one_are_refused(tmp_path, told):
    text = told[posed_models]
    for column in ("shoulder_deg", "elbow_deg"):
        text = cells(column, lambda n, v: 3.0)(text)
    assert "tell the drives one and the same" in refused(tmp_path, posed_models, text)


def test_a_drive_that_never_moves_has_no_play(tmp_path, told):
    path = posed_models.machine(tmp_path)
    log = tmp_path / "log.csv"
    log.write_text(cells("elbow_deg", lambda n, v: 3.0)(told[posed_models]))
    rig = open_machine(path)
    known = rig.open(rig.read(log)).candidates
    assert "gear_backlash@at_shoulder" in known and "gear_backlash@at_elbow" not in known


def test_a_body_that_flies_does_not_flex(tmp_path, told):
    path = swung_models.machine(tmp_path)
    ball = (
        '<body name="ball" pos="2 0 0"><freejoint name="fly"/><geom size="0.1"/></body></worldbody>'
    )
    model = path.with_name("lever.xml")
    model.write_text(model.read_text().replace("</worldbody>", ball))
    (tmp_path / "log.csv").write_text(told[swung_models])
    rig = open_machine(path)
    known = rig.open(rig.read(tmp_path / "log.csv")).candidates
    assert "link_flex@lever" in known and "link_flex@ball" not in known


def test_every_effect_at_a_place_says_what_that_is(tmp_path, told):
    path = posed_models.machine(tmp_path)
    (tmp_path / "log.csv").write_text(told[posed_models])
    rig = open_machine(path)
    found = rig.open(rig.read(tmp_path / "log.csv")).candidates
    kinds = {name: each.place["place"]["kind"] for name, each in found.items() if each.at}
    assert kinds["gear_backlash@at_elbow"] == "actuator"
    assert kinds["hinge_friction@elbow"] == kinds["joint_stiffening@elbow"] == "joint"
    assert kinds["payload@tip"] == "site" and kinds["payload@lower"] == "body"
    assert kinds["link_flex@lower"] == "body"
    assert all(kinds.values()) and found["gravity"].place == {}


def test_a_tip_may_carry_as_much_as_the_machine_weighs(tmp_path, told):
    path = posed_models.machine(tmp_path)
    (tmp_path / "log.csv").write_text(told[posed_models])
    rig = open_machine(path)
    case = rig.open(rig.read(tmp_path / "log.csv"))
    mass = case.machine.described.model.body_subtreemass[0]
    assert case.candidates["payload@tip"].ranges["mass"].high >= mass


def test_a_joint_that_nothing_measures_is_sized_by_how_it_moves(tmp_path):
    """A trolley without a spring, of which only the load is seen, is moved by its motor."""
    (tmp_path / "crane.xml").write_text(CRANE)
    (tmp_path / "machine.toml").write_text(CRANE_TOML)
    time = np.arange(0.0, 6.0, 0.02)
    current = 0.5 * np.sin(2 * np.pi * 0.5 * time)
    seen = 0.01 * np.random.default_rng(0).standard_normal((len(time), 3))
    rows = "\n".join(",".join(map(str, row)) for row in np.c_[time, current, seen])
    (tmp_path / "log.csv").write_text(f"t,current,x,y,z\n{rows}\n")
    rig = open_machine(tmp_path / "machine.toml")
    force = sizes(rig.described, rig.read(tmp_path / "log.csv")).force
    known = rig.open(rig.read(tmp_path / "log.csv"))
    units = {each.name: each.unit for each in known.quantities}
    assert (
        units["joint damping of rail"] == "N s/m" and units["joint damping of swing"] == "N m s/rad"
    )
    motor = 20 * np.sqrt(np.mean(current**2))  # [N], the gear times the current
    assert motor <= force[0] < 1.5 * motor


def test_every_key_and_unit_is_documented():
    page = (ROOT / "docs" / "other-machines.md").read_text()
    forms = (Description, DriveColumn, MeasuredColumns, Uncertain)
    keys = {name for form in forms for name in form.__struct_fields__}
    lacking = {key for key in keys if not re.search(rf"`?\b{key}\b`?( =|`)|\[\[{key}\]\]", page)}
    assert not lacking
    used = [unit for unit, (_, of) in TO_SI.items() if not of.endswith("/s")]
    assert not [unit for unit in used if f"`{unit}`" not in page]


def test_fewer_measured_values_than_numbers_are_refused(told, tmp_path):
    """A camera that saw two poses of 20, where both joints, masses and drives are uncertain."""
    few = told[posed_models]
    for axis in "xyz":
        few = cells(axis, lambda n, v: v if n < 2 else "nan")(few)
    said = refused(tmp_path, posed_models, few)
    assert re.search(r"\d+ numbers of the model .* to 6 measured values", said), said
