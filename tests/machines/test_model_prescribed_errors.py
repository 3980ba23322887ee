"""Test what is said of a machine.toml that prescribes what cannot be, or measures what is prescribed."""

import pytest
import swinging_models

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine


@pytest.mark.parametrize(
    "before, after, wanted",
    [
        ('joint = "shoulder"', 'joint = "hip"', "line 7: drive[0].joint is 'hip', which the model"),
        (
            'joint = "shoulder"',
            "",
            "line 6: drive[0] must name exactly one of actuator, joint, tendon",
        ),
        (
            'joint = "shoulder"',
            'joint = "shoulder"\nactuator = "at_shoulder"',
            "line 6: drive[0] must name exactly one of",
        ),
        (
            'unit = "rad"',
            'unit = "mm"',
            "line 9: drive[0].unit is 'mm', of m; joint 'shoulder' is in",
        ),
        ('joint = "shoulder"', 'joint = "wrist"', "drive[0].joint is 'wrist', a ball joint; only"),
        (
            'joint = "elbow"',
            'joint = "shoulder"',
            "line 12: measured[0].joint is 'shoulder', whose motion a drive prescribes",
        ),
        (
            'joint = "elbow"',
            'actuator = "at_shoulder"',
            "measured[0].actuator is 'at_shoulder', which acts on joint shoulder, whose motion",
        ),
        ('joint = "elbow"', 'joint = "wrist"', "measured[0].joint is 'wrist', a ball joint"),
        (
            'joint = "elbow"\ncolumns = ["angle"]\nunit = "rad"',
            'actuator = "at_elbow"\ncolumns = ["angle"]\nunit = "N"',
            "measured[0].unit is 'N', of N; actuator 'at_elbow' is in N m",
        ),
        (
            "[[measured]]",
            '[[drive]]\nactuator = "at_shoulder"\ncolumn = "goal"\n[[measured]]',
            "drive prescribes the motion of joint shoulder, and also tells 'at_shoulder'",
        ),
        (
            "[[measured]]",
            '[[drive]]\njoint = "shoulder"\ncolumn = "b"\nunit = "rad"\n[[measured]]',
            "drive must name each joint once: 'shoulder' has two drives",
        ),
        (
            "[[measured]]",
            '[[drive]]\ntendon = "strap"\ncolumn = "b"\nunit = "mm"\n[[measured]]',
            "of which one follows from the others: joint shoulder, tendon strap",
        ),
        (
            "[[measured]]",
            '[[drive]]\ntendon = "belt"\ncolumn = "b"\nunit = "mm"\n[[measured]]',
            "drive prescribes the motion of tendon belt, and also tells 'pull'",
        ),
        (
            'unit = "rad"',
            'unit = "rad"\noffset = "keyframe"',
            "drive[0].offset is the keyframe's, and no keyframe is named",
        ),
    ],
)
def test_what_cannot_be_prescribed_is_refused_by_line_and_key(tmp_path, before, after, wanted):
    path = swinging_models.machine(tmp_path)
    model = path.with_name("arm.xml")
    more = (
        '<position name="at_elbow" joint="elbow" kp="1"/>'
        '<motor name="pull" tendon="belt"/></actuator>'
        "<tendon>"
        '<fixed name="belt"><joint joint="shoulder" coef="0.1"/></fixed>'
        '<fixed name="strap"><joint joint="shoulder" coef="0.2"/></fixed>'
        "</tendon>"
    )
    hand = '<body><joint name="wrist" type="ball"/><geom size="0.01"/></body></body>'
    text = model.read_text().replace("</actuator>", more)
    model.write_text(text.replace("</body>", hand, 1))
    told = "".join(
        f'[[drive]]\nactuator = "{name}"\ncolumn = "{name}"\n' for name in ("at_elbow", "pull")
    )
    path.write_text(swinging_models.TOML.replace(before, after, 1) + told)
    with pytest.raises(SerpentError) as error:
        open_machine(path)
    assert wanted in str(error.value) and "line " in str(error.value)
