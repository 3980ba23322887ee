"""What to look for on a machine that a composed law describes."""

import pytest

from serpent_twin.effects.law import HANDLES, READINGS, Law, parse
from serpent_twin.effects.law_causes import Form, form_of, look_for
from serpent_twin.effects.law_shape import SHAPES


@pytest.mark.parametrize("handle", HANDLES)
def test_something_is_said_of_every_law(handle):
    readings = [("", ""), *((name, "thing1") for name in READINGS)]
    laws = [Law(handle, "thing1", s, *reading) for s in SHAPES for reading in readings]
    assert all(look_for(law).startswith(("a ", "an ", "some", "play", "rubber", "grease", "lenses",
                                         "cameras")) for law in laws)  # fmt: skip


@pytest.mark.parametrize(
    ("law", "form", "words"),
    [
        ("winch_angle of motor5: play motor_angle of motor5", Form.PLAY, "play in the gear"),
        ("winch_angle of motor5: above runtime of machine", Form.ONCE, "set screw"),
        ("marker_shift of marker3: under runtime of machine", Form.ONCE, "knocked"),
        ("joint_torque of joint5: beyond joint_angle of joint5", Form.GROWING, "bumper"),
        ("joint_friction of joint2: within joint_angle of joint2", Form.THERE, "burr"),
        ("joint_torque of joint5: linear joint_velocity of joint5", Form.MOVING, "grease"),
        ("force of link9: periodic runtime of machine", Form.SWINGING, "fan"),
        ("load_scale of motor1_load: linear time of session", Form.SLOWLY, "fades"),
        ("load_shift of motor1_load: periodic motor_angle of motor1", Form.WAVES, "tooth"),
        ("spring of link7: constant", Form.ALWAYS, "tether"),
    ],
)
def test_the_form_of_a_law_says_where_to_look(law, form, words):
    assert form_of(parse(law)) == form
    assert words in look_for(parse(law))
