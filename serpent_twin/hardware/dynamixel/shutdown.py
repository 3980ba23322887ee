"""Switch the torque off, whatever happened before."""

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.dynamixel.registers import TRIES, MotorRegisters
from serpent_twin.hardware.dynamixel.wire import PortLostError
from serpent_twin.hardware.motor_bus import BusError

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a program, a terminal that was closed among them."""


def switch_off(registers: MotorRegisters, patience: float) -> None:
    """Torque off, confirmed by every motor; `BusError` names those that did not confirm it.

    A motor that does not confirm at once is also commanded to stand still, and a lost port is waited for,
    `patience` [s] at most.
    """
    left, cause, tries, until = list(registers.motors), "", 0, time.monotonic() + patience
    while left and (time.monotonic() < until if cause else tries < TRIES):
        try:
            registers.wire.sync_write(TABLE["torque_enable"], dict.fromkeys(registers.ids, 0))
            left = [motor for motor in left if not _is_off(registers, motor)]
            if left:
                registers.wire.sync_write(TABLE["goal_velocity"], dict.fromkeys(registers.ids, 0))
            tries, cause = tries + 1, ""
        except PortLostError as error:
            cause = str(error)
            _try_to_reopen(registers)
    if left:
        raise BusError(
            f"{registers.name(left)} did not confirm that the torque is off ({cause or 'no answer'}). "
            "In silence its watchdog stops it, but it may still hold: cut the power before you touch "
            "the arm."
        )


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let no Ctrl-C, SIGTERM or SIGHUP interrupt; a signal that came meanwhile counts afterwards."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {number: signal.signal(number, lambda n, _: came.append(n)) for number in STOPPING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in came[:1]:
            signal.raise_signal(number)


def _is_off(registers: MotorRegisters, motor: int) -> bool:
    reply = registers.wire.read(registers.ids[motor - 1], TABLE["torque_enable"])
    return reply is not None and reply.data == b"\0"


def _try_to_reopen(registers: MotorRegisters) -> None:
    time.sleep(0.05)
    with contextlib.suppress(BusError):
        registers.wire.open()
