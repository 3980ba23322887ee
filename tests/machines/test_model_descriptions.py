"""Test that a machine.toml, a model or a log that cannot be is refused, and that the fault is named."""

import posed_models
import pytest

from serpent_twin import machines
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine


@pytest.mark.parametrize(
    "before, after, wanted",
    [
        (
            'rows = "poses"',
            'rows = "walks"',
            'line 3: rows is the text "walks"; it must be "motion" or "poses"',
        ),
        ('unit = "deg"', 'unit = "grad"', 'line 8: drive[0].unit is the text "grad"'),
        (
            'actuator = "at_elbow"',
            'actuator = "elbow"',
            "line 11: drive[1].actuator is 'elbow', which",
        ),
        (
            'site = "tip"',
            'site = "hand"',
            "line 16: measured[0].site is 'hand', which the model lacks",
        ),
        ('"x", "y", "z"', '"x", "y"', "line 17: measured[0].columns must be 3"),
        (
            "noise = 0.3",
            "noisy = 0.3",
            "line 20: measured[0] has noisy, which is unknown there; did you mean noise?",
        ),
        (
            'unit = "mm"',
            'unit = "deg"',
            "line 18: measured[0].unit is 'deg', of rad; site 'tip' is in m",
        ),
        (
            "noise = 0.3",
            '[[uncertain]]\nnumber = "mass"\nof = ["leg"]',
            "line 22: uncertain[0].of is 'leg'",
        ),
        (
            "noise = 0.3",
            '[[measured]]\njoint = "elbow"\ncolumns = ["q"]\nunit = "deg"\n'
            '[[measured]]\nactuator = "at_elbow"\ncolumns = ["tau"]\nunit = "N m"',
            "line 15: measured has quantities of 3 kinds, position, angle and torque; beside the first",
        ),
        ("schema_version = 1", "schema_version = 2", "schema_version is 2"),
        ('"arm.xml"', '"../arm.xml"', "outside the folder"),
        ('"arm.xml"', '"leg.xml"', "there is no such file"),
        ('rows = "poses"', 'rows = "motion"', "no time column is named"),
    ],
)
def test_a_description_that_cannot_be_is_refused_by_line_and_key(tmp_path, before, after, wanted):
    path = posed_models.machine(tmp_path)
    path.write_text(posed_models.TOML.replace(before, after, 1))
    with pytest.raises(SerpentError) as error:
        machines.find(str(path))
    assert wanted in str(error.value)


@pytest.mark.parametrize(
    "before, after, wanted",
    [
        (
            "elbow_deg",
            "elbow",
            "has no column 'elbow_deg'; there are: shoulder_deg, elbow, x, y, z",
        ),
        (
            "shoulder_deg,",
            "shoulder_deg,again,",
            "its header names 6 columns, and the row under it has 5",
        ),
    ],
)
def test_a_log_without_what_the_machine_needs_is_refused(tmp_path, before, after, wanted):
    rig = open_machine(posed_models.machine(tmp_path))
    path = posed_models.log(tmp_path / "log.csv", 0)
    path.write_text(path.read_text().replace(before, after, 1))
    with pytest.raises(SerpentError) as error:
        rig.read(path)
    assert wanted in str(error.value)


def test_degrees_that_are_taken_for_radians_are_told(tmp_path):
    path = posed_models.machine(tmp_path)
    path.write_text(posed_models.TOML.replace('unit = "deg"', 'unit = "rad"'))
    with pytest.raises(SerpentError, match=r"45.58 rad where .* is -3 … 3, as degrees do"):
        open_machine(path).read(posed_models.log(tmp_path / "log.csv", 0))


def test_a_model_that_does_not_come_to_rest_is_refused(tmp_path):
    """A wheel on a motor has no rest."""
    path = posed_models.machine(tmp_path)
    wheel = posed_models.MJCF.replace('stiffness="0.8"', "").replace(
        '<position name="at_elbow" joint="elbow" kp="4" ctrlrange="-3 3"/>',
        '<motor name="at_elbow" joint="elbow" gear="9"/>',
    )
    path.with_name("arm.xml").write_text(wheel)
    rig = open_machine(path)
    with pytest.raises(SerpentError, match=r"does not come to rest in .* poses, first in log"):
        rig.open(rig.read(posed_models.log(tmp_path / "log.csv", 0)))


def test_a_file_of_the_model_outside_its_folder_is_refused(tmp_path):
    path = posed_models.machine(tmp_path / "arm")
    (tmp_path / "hand.xml").write_text("<mujoco/>")
    inside = '<mujoco><include file="../hand.xml"/>'
    path.with_name("arm.xml").write_text(posed_models.MJCF.replace("<mujoco>", inside))
    with pytest.raises(SerpentError, match="outside the folder"):
        open_machine(path)
