"""Test that the motors behind the servos run, stop and trip as in the manual."""

import time

import lockstep
import pytest
from dynamixel_sdk import COMM_SUCCESS, GroupSyncWrite
from sdk_client import ALERT, IDS, LIMIT, OK, RANGE, RESULT_FAIL

from serpent_twin.hardware import protocol
from serpent_twin.hardware.control_table import TABLE

device, bus = lockstep.device, lockstep.bus


def test_motors_run_and_hold_at_their_goals(bus):
    start = [bus.read(id, "present_position") for id in IDS]
    bus.goals([20] * 10)
    bus.goals([20] * 10)
    assert bus.read(3, "present_velocity") == pytest.approx(20, abs=1)
    assert bus.read(3, "velocity_trajectory") == 20
    assert bus.read(3, "moving") == 1
    turned = [
        bus.read(id, "present_position") - first for id, first in zip(IDS, start, strict=True)
    ]
    assert turned == pytest.approx([20 * 0.229 / 60 * 4096 * 0.5] * 10, abs=3)
    bus.goals([-20] * 10)
    bus.goals([-20] * 10)
    assert bus.read(3, "present_velocity") == pytest.approx(-20, abs=1)
    bus.goals([0] * 10)
    bus.goals([0] * 10)
    assert bus.read(3, "moving") == 0
    assert bus.read(3, "present_position") == pytest.approx(start[2], abs=3)


def test_moving_has_a_threshold(bus):
    bus.write(1, "torque_enable", 0)
    bus.write(1, "moving_threshold", 25)
    bus.write(1, "torque_enable", 1)
    bus.goals([20] * 10)
    bus.goals([20] * 10)
    assert (bus.read(1, "moving"), bus.read(2, "moving")) == (0, 1)


def test_torque_starts_at_goal_zero(bus):
    bus.goals([20] * 10)
    bus.write(1, "torque_enable", 0)
    assert bus.write(1, "torque_enable", 1) == OK
    assert bus.read(1, "goal_velocity") == 0


def test_an_overload_is_an_alert_until_the_reboot_that_loses_the_turns(bus, device):
    for _ in range(30):
        bus.goals([150] * 10)
    before = bus.read(4, "present_position")
    assert before > 4096
    assert device.trigger("overload", 4) == "overload, motor 4"
    assert bus.read(4, "hardware_error_status") == 1 << 5
    assert bus.read(4, "torque_enable") == 0
    assert bus.write(4, "torque_enable", 1) == ALERT | RESULT_FAIL
    assert bus.write(4, "led", 1) == ALERT
    before = bus.read(4, "present_position")
    assert bus.sdk.reboot(bus.port, 4)[0] == COMM_SUCCESS
    time.sleep(0.35)
    assert bus.read(4, "present_position") == before % 4096
    assert bus.read(4, "realtime_tick") == 0
    assert bus.read(4, "led") == 0
    assert bus.read(4, "operating_mode") == 1  # EEPROM is kept
    assert bus.write(4, "torque_enable", 1) == OK


def test_the_shutdown_mask_decides_what_switches_off(bus, device):
    device.trigger("voltage", 5, 0.2)
    assert bus.read(5, "hardware_error_status") == 1
    assert bus.read(5, "present_input_voltage") == 55
    assert bus.read(5, "torque_enable") == 1
    time.sleep(0.25)
    assert bus.read(5, "present_input_voltage") == 120
    bus.write(6, "torque_enable", 0)
    bus.write(6, "shutdown", 0x35)
    bus.write(6, "torque_enable", 1)
    device.trigger("voltage", 6)
    assert bus.read(6, "torque_enable") == 0


def test_clear_brings_the_position_back_into_one_turn(bus):
    bus.goals([-100] * 10)
    assert bus.read(7, "present_position") < 0
    assert bus.sdk.clearMultiTurn(bus.port, 7) == (COMM_SUCCESS, RESULT_FAIL)
    for _ in range(2):
        bus.goals([0] * 10)
    before = bus.read(7, "present_position")
    assert bus.sdk.clearMultiTurn(bus.port, 7) == (COMM_SUCCESS, OK)
    assert bus.read(7, "present_position") == before % 4096


def test_reverse_mode_reverses_goal_and_readings(bus):
    bus.write(1, "torque_enable", 0)
    assert bus.write(1, "drive_mode", 1) == OK
    bus.write(1, "torque_enable", 1)
    before = bus.read(1, "present_position")
    bus.goals([-30] + [30] * 9)  # all turn the same way, so that no cable pulls
    bus.goals([-30] + [30] * 9)
    assert bus.read(1, "present_velocity") == pytest.approx(-30, abs=1)
    assert bus.read(1, "present_position") < before


def test_position_mode_goes_there_no_faster_than_its_profile(bus):
    for id in IDS:
        bus.write(id, "torque_enable", 0)
        bus.write(id, "operating_mode", 4)
        bus.write(id, "torque_enable", 1)
        bus.write(id, "profile_velocity", 30)
    start = [bus.read(id, "present_position") for id in IDS]
    group = GroupSyncWrite(bus.port, bus.sdk, TABLE["goal_position"].address, 4)
    for id, first in zip(IDS, start, strict=True):
        group.addParam(id, list(TABLE["goal_position"].pack(first + 300)))
    group.txPacket()
    assert bus.read(2, "present_velocity") == pytest.approx(30, abs=1)
    for _ in range(12):
        group.txPacket()
    assert [
        bus.read(id, "present_position") - first for id, first in zip(IDS, start, strict=True)
    ] == (pytest.approx([300] * 10, abs=4))


def test_position_mode_loses_the_turns_when_it_starts(bus):
    bus.goals([-50] * 10)
    bus.goals([0] * 10)
    bus.write(1, "torque_enable", 0)
    before = bus.read(1, "present_position")
    assert before < 0
    bus.write(1, "operating_mode", 3)
    assert bus.read(1, "present_position") == before % 4096
    assert bus.write(1, "goal_position", 4096) == LIMIT


def test_factory_reset_keeps_the_id_and_restarts(bus):
    bus.write(9, "torque_enable", 0)
    bus.write(9, "velocity_limit", 50)
    assert bus.sdk.factoryReset(bus.port, 9, 3) == (COMM_SUCCESS, RANGE)
    assert bus.sdk.factoryReset(bus.port, 9, 2) == (COMM_SUCCESS, OK)
    assert bus.ask(protocol.instruction_packet(9, 1), seconds=0.05) == []
    time.sleep(0.35)
    assert bus.read(9, "velocity_limit") == 265
    assert bus.read(9, "operating_mode") == 3


def test_a_factory_reset_of_all_is_a_servo_from_the_box(bus):
    bus.send(protocol.instruction_packet(protocol.BROADCAST, 6, b"\xff"))  # manual: not for all
    assert bus.read(9, "operating_mode") == 1
    assert bus.sdk.factoryReset(bus.port, 9, 0xFF) == (COMM_SUCCESS, OK)
    time.sleep(0.35)
    assert bus.ask(protocol.instruction_packet(9, 1), seconds=0.05) == []
    bus.port.setBaudRate(57_600)
    (answer,) = bus.ask(protocol.instruction_packet(protocol.BROADCAST, 1), seconds=0.3)
    assert answer.id == 1


STORE, RESTORE = b"\x01CTRL", b"\x02CTRL"


def back_up(bus, id, params):
    (answer,) = bus.ask(protocol.instruction_packet(id, 0x20, params))
    return answer.params[0]


def test_a_backup_restores_the_eeprom_and_at_the_start_the_ram(bus):
    assert protocol.instruction_packet(1, 0x20, STORE)[-2:] == b"\x16\xf5"  # manual's example
    assert back_up(bus, 4, STORE) == RESULT_FAIL  # torque on
    bus.write(4, "torque_enable", 0)
    assert back_up(bus, 4, RESTORE) == RESULT_FAIL  # there is none
    assert back_up(bus, 4, b"\x03CTRL") == RANGE
    for name, value in (("velocity_limit", 50), ("startup_configuration", 3)):
        assert bus.write(4, name, value) == OK
    for name, value in (("profile_velocity", 9), ("position_p_gain", 700), ("led", 1)):
        assert bus.write(4, name, value) == OK
    assert bus.read(4, "backup_ready") == 0
    assert back_up(bus, 4, STORE) == OK
    assert bus.read(4, "backup_ready") == 1
    bus.write(4, "velocity_limit", 60)
    bus.write(4, "profile_velocity", 8)
    assert back_up(bus, 4, RESTORE) == OK
    time.sleep(0.35)
    names = ("velocity_limit", "profile_velocity", "position_p_gain", "led", "backup_ready")
    assert [bus.read(4, name) for name in names] == [50, 9, 700, 0, 1]
    assert bus.read(4, "torque_enable") == 1  # Startup Torque On


def test_a_secondary_id_is_written_to_and_does_not_answer(bus):
    for id in (3, 4):
        bus.write(id, "torque_enable", 0)
        assert bus.write(id, "secondary_id", 5) == OK
    led = protocol.instruction_packet(5, 3, bytes([65, 0, 1]))
    assert [packet.id for packet in bus.ask(led, 3, 0.1)] == [5]
    assert [bus.read(id, "led") for id in (2, 3, 4, 5)] == [0, 1, 1, 1]
    bus.write(3, "secondary_id", 100)
    group = GroupSyncWrite(bus.port, bus.sdk, 65, 1)
    group.addParam(100, [0])
    group.txPacket()
    assert [bus.read(id, "led") for id in (3, 4)] == [0, 1]
    threshold = protocol.instruction_packet(100, 3, bytes([24, 0, 50, 0, 0, 0]))
    assert bus.ask(threshold, 1, 0.05) == []
    assert bus.read(3, "moving_threshold") == 10  # EEPROM


def test_a_supply_beyond_a_voltage_limit_is_an_error(bus):
    bus.write(3, "torque_enable", 0)
    assert bus.write(3, "min_voltage_limit", 130) == OK  # the supply has 12 V
    bus.goals([0] * 10)
    assert [bus.read(id, "hardware_error_status") for id in (2, 3)] == [0, 1]
