"""Test machines that a machine.toml describes: what is read, and what a trace of poses finds."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import posed_models
import pytest
from example import assert_named_alone, opened

from serpent_twin import machines
from serpent_twin.errors import SerpentError
from serpent_twin.identification.check_logs import Check, check
from serpent_twin.identification.run import Trace
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.lines import line_of

TILTED = (1.2, 0.0, -9.6)  # [m/s²]


def logs(folder, sessions=4, **how):
    for n in range(sessions):
        posed_models.log(folder / f"poses_{n}.csv", n, **how)
    return folder


def test_a_model_of_the_machine_predicts_its_poses(tmp_path):
    case, pieces, at = opened(posed_models.machine(tmp_path), logs(tmp_path / "logs", 2))
    off = pieces.measured - case.machine.respond([at], pieces)[0]
    assert np.nanstd(off) == pytest.approx(3e-4, rel=0.15)  # the noise of the log


@pytest.mark.slow
def test_nothing_is_missing_where_nothing_is(tmp_path):
    found = posed_models.EXAMPLE.traced(tmp_path, 4)
    assert found["effects"] == [] and not found["unexplained"]["is"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "name", "parameter", "size", "rel"),
    [
        ({"gravity": TILTED}, "gravity", "along_x", TILTED[0], 0.2),
        ({"gap": 0.05}, "gear_backlash", "gap", 0.05, 0.1),
        ({"gap": (0.0, 0.06)}, "gear_backlash@at_elbow", "gap", 0.06, 0.1),
        ({"friction": (0.0, 0.25)}, "hinge_friction@elbow", "coulomb", 0.25, 0.1),
    ],
)
def test_what_poses_at_rest_show_is_named_with_its_place_and_size(
    tmp_path, truth, name, parameter, size, rel
):
    found = posed_models.EXAMPLE.traced(tmp_path, 4, **truth)
    assert_named_alone(found, name, parameter, size, rel)
    twin = json.loads((tmp_path / "trace" / "twin.json").read_text())
    assert [each.get("at", "") for each in twin["effects"]] == [name.partition("@")[2]]


@pytest.mark.parametrize("strength", [1e-6, 1e-3, 1.0])
def test_a_link_rests_bent_however_stiff_it_is(tmp_path, strength):
    case, pieces, _ = opened(posed_models.machine(tmp_path / "arm"), logs(tmp_path / "logs", 1))
    ranges = case.machine.candidates["link_flex@upper"].ranges.values()
    bent = {"link_flex@upper": strength * np.array([each.typical for each in ranges])}
    at = ParameterVector.nominal(case.declared, bent)
    assert np.isfinite(case.machine.respond([at], pieces)).all()


@pytest.mark.slow
def test_a_spring_that_a_number_of_the_model_can_stand_for_is_told_with_that_number(tmp_path):
    """A softer motor of less reach moves the elbow as a spring beside it does: poses cannot tell them."""
    lacks = posed_models.MJCF.replace(' stiffness="0.8"', "")
    found = replace(posed_models.EXAMPLE, mjcf=lacks).traced(tmp_path, 4)
    assert found["effects"] == []
    moved = {each["name"]: each for each in found["moved"]}
    assert moved["scale of the drives"]["stands_for"]["joint_elasticity@elbow"] > 0.9


def test_an_effect_at_a_place_that_is_not_there_is_refused(tmp_path):
    case, pieces, _ = opened(posed_models.machine(tmp_path / "arm"), logs(tmp_path / "logs", 1))
    none = np.zeros(len(case.declared))
    at = ParameterVector(none, {"gear_backlash@at_wrist": np.array([0.01])})
    with pytest.raises(SerpentError, match="there are: at_shoulder and at_elbow"):
        case.residual([at], pieces)


def test_joint_angles_are_compared_in_degrees(tmp_path):
    path = posed_models.machine(tmp_path / "arm")
    angles = '[[measured]]\njoint = "shoulder"\ncolumns = ["angle"]\nunit = "deg"\nscale = -1\n'
    path.write_text(posed_models.TOML[: posed_models.TOML.index("[[measured]]")] + angles)
    log = posed_models.log(tmp_path / "log.csv", 0)
    head, *rows = log.read_text().splitlines()
    goals = [np.radians([float(v) for v in row.split(",")[:2]]) for row in rows]
    rest = [posed_models.rest(goal, np.array([0, 0, -9.81]))[0] for goal in goals]
    lines = [f"{row},{-np.degrees(at):.6f}" for row, at in zip(rows, rest, strict=True)]
    log.write_text("\n".join([f"{head},angle", *lines]))
    case, pieces, _ = opened(path, log)
    compared = case.compare(None, pieces)
    assert compared.marker.unit == "°"
    assert np.nanmax(compared.distance) < np.radians(0.01)


def test_a_check_tells_what_poses_can_show(tmp_path):
    path = posed_models.machine(tmp_path / "arm")
    found = check(Check((logs(tmp_path / "logs", 2),), machine=path))
    seen = {each.name: each for each in found.effects}
    assert seen["gear_backlash"].told and seen["gear_backlash"].limit < 0.01  # rad


def test_a_column_names_the_sessions_of_a_file(tmp_path):
    path = posed_models.machine(tmp_path)
    path.write_text('session = "which"\n' + posed_models.TOML)
    log = posed_models.log(tmp_path / "log.csv", 0, poses=30)
    head, *rows = log.read_text().splitlines()
    labelled = [f"{row},{'rise' if n < 12 else 'fall'}" for n, row in enumerate(rows)]
    log.write_text("\n".join([f"{head},which", *labelled]))
    found = open_machine(path).read(log)
    assert [(each.name, len(each)) for each in found] == [("rise", 12), ("fall", 18)]


def test_things_without_a_name_are_counted(tmp_path):
    path = posed_models.machine(tmp_path)
    model = path.with_name("arm.xml")
    model.write_text(model.read_text().replace('<body name="upper"', "<body"))
    case, *_ = opened(path, posed_models.log(tmp_path / "log.csv", 0))
    assert "mass of number 1" in {each.name for each in case.declared}
    model.write_text(model.read_text().replace('name="at_elbow" ', ""))
    with pytest.raises(SerpentError, match="one has no name"):
        open_machine(path)


def test_a_machine_is_named_by_its_file_or_its_folder(tmp_path):
    path = posed_models.machine(tmp_path / "arm")
    for given in (path, path.parent):
        assert machines.named("arm", given) == str(path)
    assert machines.named("jaw", None) == "jaw"
    with pytest.raises(SerpentError, match=r"Name a machine\.toml"):
        machines.named("arm", path.with_name("arm.xml"))
    with pytest.raises(SerpentError, match="--rig would be ignored beside --machine"):
        Trace((tmp_path,), tmp_path / "out", rig="jaw", machine=path)


def test_another_model_in_the_same_folder_is_another_trace(tmp_path):
    path = posed_models.machine(tmp_path / "arm")
    first = machines.made_of(machines.find(str(path)))
    path.with_name("arm.xml").write_text(posed_models.MJCF.replace("0.8", "0.9"))
    second = machines.made_of(machines.find(str(path)))
    assert first["machine.toml"] == second["machine.toml"] and first["arm.xml"] != second["arm.xml"]


def test_lines_of_keys_are_found():
    text = 'top = 1\n\n[[drive]]\ncolumn = "a"\n[[drive]]\n# column\ncolumn = "b"\n[other]\nx = 1\n'
    assert [line_of(key, text) for key in ("top", "drive[1].column", "drive[0]", "other.x")] == [
        1,
        7,
        3,
        9,
    ]


def test_the_twin_of_a_model_is_written_as_mjcf(tmp_path):
    case, *_ = opened(posed_models.machine(tmp_path / "arm"), logs(tmp_path / "logs", 2))
    at = ParameterVector.nominal(case.declared, {"gravity": np.array([1.0, 0.0, 0.5])})
    case.write(at, tmp_path / "twin.json", {})
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml"))
    np.testing.assert_allclose(model.opt.gravity, [1.0, 0.0, -9.31])
