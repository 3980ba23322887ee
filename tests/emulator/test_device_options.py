"""Test the device's options, and that impossible ones are refused."""

import json
import time
from itertools import pairwise
from pathlib import Path

import pytest
from sdk_client import LIMIT, OK, Client

from serpent_twin.bus.device import main
from serpent_twin.command_line import cli
from serpent_twin.emulator.child import running
from serpent_twin.emulator.device_options import DeviceOptions, build
from serpent_twin.emulator.faults import KINDS
from serpent_twin.emulator.responder import Responder
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import protocol
from serpent_twin.hardware.control_table import TABLE

# Options


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"realtime": True, "lockstep": True}, "--realtime would be ignored beside --lockstep"),
        ({"rate_hz": 0.0}, "--rate-hz"),
        ({"lockstep": True, "rate_hz": 3.0}, "time step"),
        ({"start_counts": (1, 2)}, "--start-counts has 2 numbers; give 1 or 10"),
        ({"count": 2, "start_counts": (1,) * 3}, "give 1 or 2"),
        ({"count": 11}, "--count"),
        ({"count": 2, "ids": (3, 4, 5)}, "--ids has 3 numbers; give 2"),
        ({"ids": tuple(range(11))}, "--ids has 11 numbers; give at most 10"),
        ({"ids": (7, 7)}, "two motors one id"),
        ({"count": 2, "fault": ("overload=1@3",)}, "motor 3; there are 1 … 2"),
        ({"count": 1, "cameras": 1510}, "--cameras is for the arm"),
        ({"seed": -1}, "--seed"),
        ({"cameras": 65_536}, "--cameras is 65536"),
        ({"cameras": -1}, "--cameras is -1"),
        ({"fault": ("crc",)}, "--fault crc"),
        ({"model": Path("nowhere.xml")}, "nowhere.xml"),
    ],
)
def test_options_that_cannot_be_are_refused(options, match):
    with pytest.raises(SerpentError, match=match):
        build(DeviceOptions(**options))


def test_a_link_does_not_replace_a_file(tmp_path):
    taken = tmp_path / "notes.txt"
    taken.write_text("mine")
    with pytest.raises(SerpentError, match="something else lies there"):
        build(DeviceOptions(link=taken))
    assert taken.read_text() == "mine"


def test_a_link_is_taken_over_only_from_the_dead(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    link = Path("arm")
    first = build(DeviceOptions(link=link)).terminal
    first.plug()
    with pytest.raises(SerpentError, match=r"arm leads to /dev/pts/.*another device"):
        build(DeviceOptions(link=link))
    assert link.readlink() == Path(first.port)
    first.unplug()
    link.symlink_to("/dev/pts/987654")  # as a device leaves it that was killed
    second = build(DeviceOptions(link=link)).terminal
    second.plug()
    assert link.readlink() == Path(second.port)
    second.unplug()
    with pytest.raises(SerpentError, match="nowhere/arm: there is no folder nowhere"):
        build(DeviceOptions(link=Path("nowhere/arm"), transcript=Path("events")))
    assert not Path("events").exists()


def test_a_transcript_replaces_no_file_and_knows_the_turns_that_a_reboot_loses(tmp_path):
    path = tmp_path / "events.jsonl"
    device = build(DeviceOptions(transcript=path, start_counts=(9000,)))
    device._transcript.read()
    device.servos.reboot(4)
    assert device.servos.write(5, TABLE["drive_mode"].address, b"\1") == OK
    device._transcript.read()
    device._transcript.close()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["true_position"] for line in lines] == [[9000] * 10] * 2
    assert lines[1]["present_position"][3:6] == [9000, 9000 % 4096, -9000 % 4096]
    with pytest.raises(SerpentError, match=r"events.jsonl: something lies there already"):
        build(DeviceOptions(transcript=path))
    assert len(path.read_text().splitlines()) == 2


def test_known_forces_push_the_arm_and_the_transcript_states_them(tmp_path):
    table = tmp_path / "push.csv"
    table.write_text("link,begin,end,force_x,force_y,force_z,shape\n9,0.5,2,0,0.6,0,step\n")
    path, bent = tmp_path / "events.jsonl", []
    device = build(DeviceOptions(transcript=path, push=table))
    motors = device.servos.motors
    motors.power(True)
    for _ in range(3):
        device._transcript.read()
        bent.append(motors.twin.joint_angle[0])
        motors.advance(1.0)
    device._transcript.close()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["push_link"] for line in lines] == [0, 9, 0]
    assert [line["push_y"] for line in lines] == [0, 0.6, 0]
    assert (abs(bent[1] - bent[0]) > 0.05).all()
    # friction holds it from going all the way back
    assert abs(bent[2]).sum() < 0.8 * abs(bent[1]).sum()


def test_the_help_says_what_each_fault_means_and_what_is_not_simulated(capsys):
    with pytest.raises(SystemExit):
        cli.run(main, ["--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for kind in KINDS.values():
        assert f"{kind.name}, {kind.help}" in text
    assert "Not simulated: gains but Position P" in text
    assert "`unplug - 2`" in text


def test_an_answer_is_given_as_it_was_before_what_it_answers():
    servos = build(DeviceOptions(lockstep=True)).servos
    responder = Responder(servos)

    def write(id, name, value):
        params = TABLE[name].address.to_bytes(2, "little") + TABLE[name].pack(value)
        return responder.answer(protocol.Packet(id, protocol.Instruction.WRITE, params, b""))

    (reply,) = write(3, "id", 33)
    assert protocol.Parser().feed(reply.data)[0].id == 3
    (reply,) = write(33, "return_delay_time", 0)
    assert reply.delay == 500e-6
    (reply,) = write(33, "baud_rate", 1)
    assert (reply.baud, reply.delay) == (1_000_000, 0.0)
    assert len(write(33, "status_return_level", 0)) == 1
    assert write(33, "status_return_level", 2) == []
    (reply,) = write(33, "led", 1)
    assert reply.baud == 57_600 and protocol.Parser().feed(reply.data)[0].id == 33


def test_positions_have_their_ranges_and_sense():
    servos = build(DeviceOptions(lockstep=True, start_counts=(5000,))).servos
    servos.table[0]["operating_mode"] = 4
    for value, error in ((1_048_575, OK), (1_048_576, LIMIT), (-1_048_576, LIMIT)):
        goal = TABLE["goal_position"]
        assert servos.write(0, goal.address, goal.pack(value)) == error
    drive = TABLE["drive_mode"].address
    for mode, sense in ((1, -1), (1, -1), (0, 1)):
        assert servos.write(0, drive, bytes([mode])) == OK
        for _ in range(2):
            assert servos.motors.registers().present_position[0] == sense * 5000 % 4096
            servos.reboot(0)


def test_the_straight_arm_reads_what_it_is_told_to():
    device = build(DeviceOptions(start_counts=tuple(range(2000, 12000, 1000))))
    words = device.servos.motors.registers().present_position
    assert words.tolist() == list(range(2000, 12000, 1000))
    device.servos.reboot(9)
    assert device.servos.motors.registers().present_position[9] == 11000 % 4096


def test_one_servo_from_the_box_is_found_and_driven_as_by_published_examples():
    """Id 1 at 57,600 bit/s goes from end to end of position mode, without an arm that would bind."""
    with running("--count", "1", "--baud", "57600") as device:
        client = Client(device.port)
        client.port.setBaudRate(57_600)
        assert list(client.sdk.broadcastPing(client.port)[0]) == [1]
        assert client.read(1, "present_position") == 2048
        assert client.write(1, "torque_enable", 1) == OK
        for goal in (0, 4095):
            assert client.write(1, "goal_position", goal) == OK
            until = time.monotonic() + 5
            while abs(client.read(1, "present_position") - goal) > 20:
                assert time.monotonic() < until
        assert client.read(1, "hardware_error_status") == 0
        with pytest.raises(SerpentError, match="there is only motor 1"):
            device.trigger("overload", 2)
        client.port.closePort()


def test_motors_have_the_ids_that_they_are_given():
    servos = build(DeviceOptions(ids=(11, 3), start_counts=(100, 200))).servos
    assert [table["id"] for table in servos.table] == [11, 3]
    servos.refresh()
    assert [table["present_position"] for table in servos.table] == [100, 200]


def test_a_model_file_is_read_or_what_it_lacks_is_named(tmp_path):
    from serpent_twin.arm import mjcf

    text = mjcf.build().to_xml()
    good, bad = tmp_path / "good.xml", tmp_path / "bad.xml"
    good.write_text(text)
    assert build(DeviceOptions(model=good)).servos.motors.twin.model.nu == 20
    bad.write_text(text.replace("joint4", "elbow"))
    with pytest.raises(SerpentError, match=r"joints must be .* missing or elsewhere: joint4"):
        build(DeviceOptions(model=bad))


def test_realtime_ticks_advance_evenly_between_reads():
    with running("--no-paced") as device:
        client = Client(device.port)
        ticks = [client.read(1, "realtime_tick") for _ in range(60)]
        assert all(0 <= later - sooner < 100 for sooner, later in pairwise(ticks))
        client.port.closePort()
