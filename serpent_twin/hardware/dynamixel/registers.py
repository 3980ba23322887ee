"""Read and write registers of real motors, with retries and verification."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.hardware.control_table import MODEL_NUMBER, TABLE
from serpent_twin.hardware.dynamixel.wire import StatusPacket, Wire
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import Words

TRIES = 5
"""How often one question is put before a motor counts as silent."""
REFUSALS = {
    1: "could not process the instruction",
    2: "does not know the instruction",
    3: "received the packet with a bad CRC",
    4: "refuses the value as out of range, or is stopped by its watchdog",
    5: "refuses the length of the data",
    6: "refuses the value as beyond its limit",
    7: "refuses access: read-only, undefined, or EEPROM while the torque is on",
}
"""Error numbers of a status packet (Protocol 2.0)."""


@dataclass(frozen=True)
class Presence:
    """Whether a motor answers, and what is wrong with it, if anything."""

    answers: bool
    problem: str


class MotorRegisters:
    """Registers by name for motors 1 … n with ids on a wire; every answer is waited for and checked."""

    def __init__(self, wire: Wire, ids: Sequence[int]) -> None:
        self.wire, self.ids = wire, tuple(ids)

    def get(self, motor: int, name: str) -> int:
        """The word in register `name` of a motor, numbered from 1."""
        item = TABLE[name]
        reply = self._insist(motor, f"reading {name}", lambda id_: self.wire.read(id_, item))
        return item.unpack(reply.data)

    def put(self, motor: int, name: str, value: int) -> None:
        """Write a register; returns when the motor has confirmed it."""
        item = TABLE[name]
        self._insist(
            motor, f"writing {value} to {name}", lambda id_: self.wire.write(id_, item, value)
        )

    def ensure(self, motor: int, name: str, value: int) -> bool:
        """Write a register unless it holds the value, and read it back; returns whether it changed."""
        if self.get(motor, name) == value:
            return False
        self.put(motor, name, value)
        for _ in range(TRIES):
            if (found := self.get(motor, name)) == value:
                break
            self.wire.drain()  # a late answer to an earlier request looks like one to this
        else:
            raise BusError(
                f"motor {motor} confirmed {value} for {name}, but holds {found}. "
                "Check its supply and run serpent_twin.bus.doctor."
            )
        return True

    def get_all(self, name: str) -> Words:
        """Register `name` of all motors, (n,)."""
        return np.array([self.get(motor, name) for motor in self.motors], np.int64)

    @property
    def motors(self) -> range:
        """The motors' numbers, from 1."""
        return range(1, len(self.ids) + 1)

    def answers(self, motor: int) -> bool:
        """Whether a motor answers a ping now."""
        return bool(self.wire.ping(self.ids[motor - 1]))

    def reboot(self, motors: Iterable[int], patience: float) -> None:
        """Restart motors and wait until they answer again, `patience` [s] at most."""
        motors = list(motors)
        for motor in motors:
            self._insist(motor, "rebooting", self.wire.reboot)
        self.await_answers(motors, patience)

    def await_answers(self, motors: Iterable[int], patience: float) -> None:
        """Wait until motors answer, or raise `BusError` that names those that do not."""
        until, silent = time.monotonic() + patience, list(motors)
        while silent := [motor for motor in silent if not self.answers(motor)]:
            if time.monotonic() > until:
                raise BusError(
                    f"{self.name(silent)} did not come back within {patience:g} s. {_CHECK}"
                )

    def handshake(self) -> None:
        """Ask for all motors; raises one `BusError` that lists every one missing, doubled or wrong."""
        presences = [self.presence(motor) for motor in self.motors]
        problems = [presence.problem for presence in presences if presence.problem]
        if problems:
            raise BusError(
                f"{self.wire.port}: {'; '.join(problems)}. {_CHECK} "
                "serpent_twin.bus.doctor lists what is on the bus."
            )

    def name(self, motors: Iterable[int]) -> str:
        """Motors for a sentence, with their ids where these differ."""
        names = [f"{m}" if self.ids[m - 1] == m else f"{m} (id {self.ids[m - 1]})" for m in motors]
        return f"motor {', '.join(names)}"

    def name_all(self, which: np.ndarray) -> str:
        """The motors for a sentence that a mask, (n,), picks."""
        return self.name(int(n) + 1 for n in np.flatnonzero(which))

    def presence(self, motor: int) -> Presence:
        """Check with retries that a motor is present, alone on its id, and of the right model."""
        answers, garbled = self._ping_patiently(self.ids[motor - 1])
        name = self.name([motor])
        if not answers:
            return Presence(False, f"{name} {_GARBLED if garbled else 'is missing'}")
        if len(answers) > 1 and self._is_doubled(self.ids[motor - 1]):
            return Presence(True, f"{name} is doubled: two motors answer to its id")
        model = int.from_bytes(answers[0].data[:2], "little")
        if model != MODEL_NUMBER:
            found = f"{name} is model {model}, not an XL430-W250 ({MODEL_NUMBER})"
            return Presence(True, found)
        return Presence(True, "")

    def _is_doubled(self, motor_id: int) -> bool:
        """Whether two answers come every time: once may be a late one."""
        for _ in range(TRIES):
            self.wire.drain()
            if len(self.wire.ping(motor_id)) < 2:
                return False
        return True

    def _ping_patiently(self, motor_id: int) -> tuple[list[StatusPacket], bool]:
        garbled = False
        for _ in range(TRIES):
            corrupt = self.wire.counts["corrupt"]
            if answers := self.wire.ping(motor_id):
                return answers, garbled
            garbled |= self.wire.counts["corrupt"] > corrupt
        return [], garbled

    def _insist(
        self, motor: int, what: str, ask: Callable[[int], StatusPacket | None]
    ) -> StatusPacket:
        refusal = 0
        for _ in range(TRIES):
            reply = ask(self.ids[motor - 1])
            refusal = reply.error & 0x7F if reply else refusal
            if reply and refusal == 0:
                return reply
            if refusal not in (0, 3):  # a bad CRC is worth another try
                break
        if refusal:
            raise BusError(
                f"{self.name([motor])} {REFUSALS.get(refusal, f'answers error {refusal}')} ({what})."
            )
        raise BusError(f"{self.name([motor])} does not answer ({what}, {TRIES} tries). {_CHECK}")


_GARBLED = "gives garbled answers only: two motors share its id, or a contact is bad"
_CHECK = "Check cable, supply and ids."
