"""What to look for on a machine that a composed law describes."""

import pytest

from serpent_twin.effects.law import HANDLES, READINGS, Law, parse
from serpent_twin.effects.law_causes import LawForm, form_of, look_for
from serpent_twin.effects.law_shape import SHAPES


@pytest.mark.parametrize("handle", HANDLES)
def test_something_is_said_of_every_law(handle):
    readings = [("", ""), *((name, "thing1") for name in READINGS)]
    laws = [Law(handle, "thing1", s, *reading) for s in SHAPES for reading in readings]
    assert all(look_for(law).startswith(("a ", "an ", "some", "play", "rubber", "nylon", "grease",
                                         "lenses", "cameras")) for law in laws)  # fmt: skip


@pytest.mark.parametrize(
    ("law", "form", "words"),
    [
        ("winch_angle of motor5: play motor_angle of motor5", LawForm.PLAY, "play in the gear"),
        ("winch_angle of motor5: above runtime of machine", LawForm.ONCE, "set screw"),
        ("marker_shift of marker3: under runtime of machine", LawForm.ONCE, "knocked"),
        ("joint_torque of joint5: beyond joint_angle of joint5", LawForm.GROWING, "bumper"),
        ("joint_friction of joint2: within joint_angle of joint2", LawForm.THERE, "burr"),
        ("joint_torque of joint5: linear joint_velocity of joint5", LawForm.MOVING, "grease"),
        ("force of link9: periodic runtime of machine", LawForm.SWINGING, "fan"),
        ("load_scale of motor1_load: linear time of session", LawForm.SLOWLY, "fades"),
        ("load_shift of motor1_load: periodic motor_angle of motor1", LawForm.WAVES, "tooth"),
        ("spring of link7: constant", LawForm.ALWAYS, "tether"),
        ("joint_torque of joint5: lag joint_angle of joint5", LawForm.LATE, "relaxes"),
    ],
)
def test_the_form_of_a_law_says_where_to_look(law, form, words):
    assert form_of(parse(law)) == form
    assert words in look_for(parse(law))
