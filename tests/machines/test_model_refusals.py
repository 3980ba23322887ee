"""Test that logs and descriptions that cannot be are refused in a sentence, before anything is fitted."""

import re

import log_texts
import moving_models
import numpy as np
import posed_models
import pytest
import swung_models
from refusals import FOREIGN

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine

told, cells = log_texts.told, log_texts.cells


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
        (
            cells("angle", lambda n, v: "nan"),
            "'angle', measured of pivot, has no number in any row",
        ),
        (
            cells("angle", lambda n, v: 0.3),
            "'angle', measured of joint pivot, is the same in every",
        ),
        (cells("goal_deg", lambda n, v: "nan"), "'goal_deg', which drives servo, has no number"),
        (cells("t_ms", lambda n, v: 5.0), "'t_ms' stands still"),
        (cells("t_ms", lambda n, v: v - 500 * (n > 70)), "'t_ms' goes back in row 72"),
        (cells("t_ms", lambda n, v: v / 1000), "4e-05 s apart and last 0.00596 s in all"),
        (earlier("angle", 13), "moves 0.48 s before 'goal_deg' tells it to"),
        (earlier("goal_deg", 22), "moves 0.92 s after 'goal_deg' tells it to"),
        (lines(lambda rows: rows[:2]), "has 1 row, fewer than 8"),
        (lines(lambda rows: rows[:1]), "it has no row of numbers under a header"),
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
        (
            swung_models,
            swap("noise = 0.0005", "noise = 0.0005, of_stall = true"),
            None,
            "measured[0].of_stall states a share of a stall torque",
        ),
        (
            swung_models,
            None,
            swap('ctrlrange="-1 1"', 'ctrlrange="-120 120"'),
            "'servo', whose ctrlrange is -120 … 120 rad where its joint 'pivot' has -2.094 … 2.094 rad",
        ),
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


def test_fewer_measured_values_than_numbers_are_refused(told, tmp_path):
    """A camera that saw two poses of 20, where both joints, masses and drives are uncertain."""
    few = told[posed_models]
    for axis in "xyz":
        few = cells(axis, lambda n, v: v if n < 2 else "nan")(few)
    said = refused(tmp_path, posed_models, few)
    assert re.search(r"\d+ numbers of the model .* to 6 measured values", said), said
