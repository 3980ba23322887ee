"""How does the torque go off, whatever happened before?"""

import contextlib
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from serpent_twin.bus import BusError
from serpent_twin.bus.control_table import TABLE
from serpent_twin.bus.dynamixel.registers import TRIES, MotorRegisters
from serpent_twin.bus.dynamixel.wire import PortLostError


class _Closable(Protocol):
    def close(self) -> None: ...


def switch_off(registers: MotorRegisters) -> None:
    """Torque off, confirmed by every motor; `BusError` names those that did not confirm it.

    A motor that does not hear it at once is also told to stand still.
    """
    left, cause = list(registers.motors), ""
    for _ in range(TRIES):
        try:
            registers.wire.sync_write(TABLE["torque_enable"], dict.fromkeys(registers.ids, 0))
            left = [motor for motor in left if not _is_off(registers, motor)]
            if not left:
                return
            cause = "no answer"
            registers.wire.sync_write(TABLE["goal_velocity"], dict.fromkeys(registers.ids, 0))
        except PortLostError as error:
            cause = str(error)
            _try_to_reopen(registers)
    raise BusError(
        f"{registers.name(left)} did not confirm that the torque is off ({cause}). Their watchdog has "
        "stopped them, but they may still hold: cut the power before you touch the arm."
    )


def close_after(error: BaseException, bus: _Closable) -> None:
    """Close a bus on the way out with `error`, to which what goes wrong now is a note."""
    try:
        bus.close()
    except BusError as second:
        error.add_note(f"Besides, {second}")


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let neither Ctrl-C nor SIGTERM interrupt; a signal that came meanwhile counts afterwards."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    both = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, lambda n, _: came.append(n)) for number in both}
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
    with contextlib.suppress(BusError):
        registers.wire.open()
