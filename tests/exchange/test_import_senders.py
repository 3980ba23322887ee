"""Test that messages are read by the names that they give, and that senders are not mixed."""

import numpy as np
import pytest
from recordings import ANGLE, TIME, angle, imported, joint_states, json_mcap, positions

from serpent_twin.errors import SerpentError
from serpent_twin.exchange.writing import summary

MAP = """[[stream]]
topic = "/joint_states"
{more}
fields = [{{ field = "position[{of}]", column = "q", unit = "rad" }}]
"""
CHANGING = [
    (t, "", {"j1": q, "j2": 9.0} if n % 2 else {"j2": 9.0, "j1": q})
    for n, (t, q) in enumerate(zip(TIME, ANGLE, strict=True))
]
WITH_GRIPPER = [
    message
    for t, q in zip(TIME, ANGLE, strict=True)
    for message in ((t, "", {"arm/j1": q, "j2": 0.0}), (t + 0.004, "", {"gripper": 5.0}))
]
TWO_FRAMES = [
    message
    for t, q in zip(TIME, ANGLE, strict=True)
    for message in ((t, "left", {"j1": q}), (t + 0.004, "right", {"j1": 5.0}))
]


@pytest.mark.parametrize(
    ("messages", "of", "more", "left_out"),
    [
        (CHANGING, "j1", "", 0),
        (WITH_GRIPPER, "arm/j1", "", 300),
        (TWO_FRAMES, "j1", 'only = { "header.frame_id" = "left" }', 300),
    ],
)
def test_a_joint_is_read_by_its_name(tmp_path, messages, of, more, left_out):
    """Whatever its place in a message, and whoever else publishes on the topic."""
    file = joint_states(tmp_path / "run.mcap", *messages)
    found, log = imported(tmp_path, [file], MAP.format(of=of, more=more))
    np.testing.assert_allclose(log["q"], angle(log["time"]), atol=1e-6)
    said = f"{left_out} other messages on the topic left out"
    assert (said in summary(found)) == bool(left_out)


@pytest.mark.parametrize(
    ("messages", "of", "said"),
    [
        (CHANGING, "0", r"'position\[0\]' is 'j2' or 'j1'.*position\[j2\]"),
        (WITH_GRIPPER, "0", r"is 'arm/j1' or 'gripper'.*position\[arm/j1\]"),
        (TWO_FRAMES, "j1", r"'left' in 300 messages, 'right' in 300.*only = .*header.frame_id"),
        (CHANGING, "elbow", r"no field 'position\[elbow\]'; there are.*position\[j1\]"),
    ],
)
def test_what_is_another_joint_from_message_to_message_is_refused(tmp_path, messages, of, said):
    file = joint_states(tmp_path / "run.mcap", *messages)
    with pytest.raises(SerpentError, match=said):
        imported(tmp_path, [file], MAP.format(of=of, more=""))


def test_fields_of_different_messages_need_streams_of_their_own(tmp_path):
    file = joint_states(tmp_path / "run.mcap", *WITH_GRIPPER)
    both = (
        MAP.format(of="j2", more="").rstrip()[:-1]
        + ', { field = "position[gripper]", column = "g" }]'
    )
    with pytest.raises(SerpentError, match=r"no message has all of .*gripper.*\[\[stream\]\]"):
        imported(tmp_path, [file], both)
    _, log = imported(
        tmp_path,
        [file],
        MAP.format(of="arm/j1", more="") + MAP.format(of="gripper", more="").replace('"q"', '"g"'),
    )
    np.testing.assert_allclose(log["g"], 5.0)


def two_channels(path, first=0.0, names=({"callerid": "a"}, {"callerid": "b"})):
    one, other = (TIME, positions(ANGLE)), (TIME + 0.004 + first, positions(0 * ANGLE))
    return json_mcap(path, ("/joint_states", *one, names[0]), ("/joint_states", *other, names[1]))


def test_one_of_two_publishers_is_chosen(tmp_path):
    file = two_channels(tmp_path / "run.mcap")
    with pytest.raises(SerpentError, match=r"publisher is 'a' in 300 messages, 'b' in 300"):
        imported(tmp_path, [file], MAP.format(of="0", more=""))
    _, log = imported(tmp_path, [file], MAP.format(of="0", more='only = { publisher = "a" }'))
    np.testing.assert_allclose(log["q"], angle(log["time"]), atol=1e-6)


def test_a_publisher_that_is_not_there_is_answered_by_those_that_are(tmp_path):
    file = two_channels(tmp_path / "run.mcap")
    with pytest.raises(SerpentError, match="publisher is never 'c'; it is 'a', 'b'"):
        imported(tmp_path, [file], MAP.format(of="0", more='only = { publisher = "c" }'))


def test_a_publisher_that_was_started_again_is_no_second_one(tmp_path):
    found, _ = imported(
        tmp_path,
        [two_channels(tmp_path / "run.mcap", first=6.0)],
        MAP.format(of="0", more=""),
    )
    assert len(found[0].columns["time"]) == 2 * len(TIME)


@pytest.mark.parametrize(("every", "suspected"), [(2, True), (6, True), (10**6, False)])
def test_two_publishers_that_nothing_tells_apart_are_suspected(tmp_path, every, suspected):
    values = np.where(np.arange(len(TIME)) % every == 1, -3.0, ANGLE)
    file = json_mcap(tmp_path / "run.mcap", ("/joint_states", TIME, positions(values)))
    found, _ = imported(tmp_path, [file], MAP.format(of="0", more=""))
    assert ("q jumps to and fro" in summary(found)) == suspected


def test_an_encoder_at_rest_whose_last_count_flickers_is_one_publisher(tmp_path):
    counts = np.random.default_rng(0).integers(0, 2, len(TIME))
    file = json_mcap(tmp_path / "run.mcap", ("/joint_states", TIME, positions(1.5e-3 * counts)))
    found, _ = imported(tmp_path, [file], MAP.format(of="0", more=""))
    assert "to and fro" not in summary(found)
