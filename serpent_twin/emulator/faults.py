"""Inject faults into a motor bus, by name and rate."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf, isfinite

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.errors import SerpentError


class Strikes(StrEnum):
    """What a fault's rate counts."""

    STATUS = "each status packet, and each motor's part of a fast read's"
    INSTRUCTION = "each instruction packet"
    CYCLE = "each control cycle, that is each group write of goals"
    START = "the start"


@dataclass(frozen=True)
class FaultKind:
    """One thing that can go wrong."""

    name: str
    strikes: Strikes
    help: str
    seconds: float = inf
    """How long it lasts by default [s]"""
    of_motor: bool = True
    """Whether it affects one motor; else all, or the port"""


_KINDS = (
    FaultKind("crc", Strikes.STATUS, "one bit of the packet is flipped"),
    FaultKind("drop", Strikes.STATUS, "the packet is lost"),
    FaultKind("truncate", Strikes.STATUS, "the packet breaks off"),
    FaultKind("garbage", Strikes.STATUS, "random bytes come before the packet or instead of it"),
    FaultKind("late", Strikes.STATUS, "the packet comes SECONDS later; others overtake it", 0.06),
    FaultKind("deaf", Strikes.INSTRUCTION, "no motor receives the packet", of_motor=False),
    FaultKind("missing", Strikes.CYCLE, "a motor is off the wire for SECONDS, or for ever"),
    FaultKind(
        "unplug", Strikes.CYCLE, "the port vanishes, and comes back after SECONDS", 1.0, False
    ),
    FaultKind("overload", Strikes.CYCLE, "a motor trips: error bit 5, torque off until a reboot"),
    FaultKind("voltage", Strikes.CYCLE, "a motor reads 5.5 V for SECONDS: error bit 0", 0.5),
    FaultKind(
        "watchdog", Strikes.CYCLE, "a motor's bus watchdog trips: it stops, goals are locked"
    ),
    FaultKind("reboot", Strikes.CYCLE, "a motor restarts by itself: RAM and turns are lost", 0.3),
    FaultKind("doubled", Strikes.START, "a second motor has the id: every answer comes twice"),
    FaultKind("wrong_model", Strikes.START, "a motor is an XM430-W210, model number 1030"),
)
KINDS = {kind.name: kind for kind in _KINDS}
"""All faults by name."""


@dataclass(frozen=True)
class Fault:
    """A kind of fault, how often it strikes, whom, and for how long."""

    kind: FaultKind
    rate: float = 1.0
    """Probability for each of what it strikes [1]"""
    motor: int | None = None
    """Number of the motor, from 1; None for any"""
    seconds: float = inf

    @classmethod
    def parse(cls, text: str) -> "Fault":
        """Read NAME=RATE[@MOTOR][/SECONDS], such as `late=0.01/0.1` or `overload=0.002@3`."""
        name, _, rest = text.partition("=")
        rest, _, seconds = rest.partition("/")
        rate, _, motor = rest.partition("@")
        try:
            return named(name, float(rate), _number(motor) if motor else None, _seconds(seconds))
        except ValueError:
            raise SerpentError(
                f"--fault {text} does not read as NAME=RATE[@MOTOR][/SECONDS], such as late=0.01/0.1."
            ) from None

    @classmethod
    def order(cls, line: str) -> "Fault":
        """Read `NAME [MOTOR [SECONDS]]`, MOTOR - for any: a fault that is to strike once, now."""
        try:
            words = line.split()
            name, motor, seconds = *words, *("-", "")[len(words) - 1 :]
            return named(name, 1.0, None if motor == "-" else _number(motor), _seconds(seconds))
        except ValueError:
            raise SerpentError(
                f"{line!r} does not read as NAME [MOTOR [SECONDS]], with - as MOTOR for any or none, "
                "such as `overload 3` or `unplug - 2`."
            ) from None


def named(
    name: str, rate: float = 1.0, motor: int | None = None, seconds: float | None = None
) -> Fault:
    """A fault by its kind's name; raises `SerpentError` if there is no such fault, motor or rate."""
    kind = KINDS.get(name)
    if kind is None:
        known = "; ".join(f"{kind.name}: {kind.help}" for kind in _KINDS)
        raise SerpentError(f"there is no fault {name!r}. There are {known}.")
    if not 0 <= rate <= 1:
        raise SerpentError(f"the fault {name} has the rate {rate:g}; give one within 0 … 1.")
    if motor is not None and not 1 <= motor <= N_MOTORS:
        raise SerpentError(f"the fault {name} is for motor {motor}; there are 1 … {N_MOTORS}.")
    if motor is not None and not kind.of_motor:
        raise SerpentError(
            f"the fault {name} affects no single motor; leave out the {motor}, or order it as "
            f"`{name} - SECONDS`."
        )
    seconds = kind.seconds if seconds is None else seconds
    if not seconds > 0:
        raise SerpentError(f"the fault {name} lasts {seconds:g} s; give more than 0.")
    if kind.strikes is Strikes.START and motor is None:
        motor = 1
    return Fault(kind, rate, motor, seconds)


def help_text() -> str:
    """All faults with what they mean, by what their rate counts."""
    return " ".join(
        f"Of {strikes}: "
        + "; ".join(_meaning(kind) for kind in _KINDS if kind.strikes is strikes)
        + "."
        for strikes in Strikes
    )


def _meaning(kind: FaultKind) -> str:
    usual = f" ({kind.seconds:g} by default)" if isfinite(kind.seconds) else ""
    return f"{kind.name}, {kind.help}{usual}"


def _number(text: str) -> int:
    if not text.isdecimal():
        raise ValueError
    return int(text)


def _seconds(text: str) -> float | None:
    if text and not isfinite(float(text)):
        raise ValueError
    return float(text) if text else None


class Faults:
    """Draws faults with its own generator; counts them by name and passes them to `tell`."""

    def __init__(
        self,
        faults: Iterable[Fault],
        rng: np.random.Generator,
        tell: Callable[[str, int | None], None] = lambda name, motor: None,
        motors: int = N_MOTORS,
    ) -> None:
        self.counts: Counter[str] = Counter()
        self._faults = tuple(faults)
        self._armed: list[Fault] = []
        self._rng, self._tell, self._motors = rng, tell, motors
        for fault in self._faults:
            self.require_motor(fault)

    def require_motor(self, fault: Fault) -> None:
        """Raise `SerpentError` if a fault is for a motor that is not there."""
        if (fault.motor or 1) > self._motors:
            raise SerpentError(
                f"the fault {fault.kind.name} is for motor {fault.motor}; there "
                f"{'is only motor 1' if self._motors == 1 else f'are 1 … {self._motors}'}."
            )

    def note(self, name: str, motor: int | None) -> None:
        """Count a fault, and pass it to `tell`."""
        self.counts[name] += 1
        self._tell(name, motor)

    def arm(self, fault: Fault) -> None:
        """Let a fault of the wire strike the next packet that it can."""
        self._armed.append(fault)

    def events(self, strikes: Strikes) -> list[Fault]:
        """The motor faults that happen now; one that is for any motor is given one."""
        return [
            self.aimed(fault)
            for fault in self._faults
            if fault.kind.strikes is strikes and self._happens(fault)
        ]

    def aimed(self, fault: Fault) -> Fault:
        """A fault with a motor, drawn if it has none and needs one."""
        if not fault.kind.of_motor:
            return fault
        return replace(fault, motor=fault.motor or int(self._rng.integers(self._motors)) + 1)

    def deafens(self) -> bool:
        """Whether the instruction packet that is here now is lost."""
        return any(self._on_wire(Strikes.INSTRUCTION, None))

    def strike(self, packet: bytes, motor: int | None) -> tuple[bytes, float]:
        """A status packet of a motor, from 1, as it arrives, perhaps as nothing; and its delay [s]."""
        delay = 0.0
        for fault in self._on_wire(Strikes.STATUS, motor):
            if fault.kind.name == "late":
                delay += fault.seconds
            else:
                packet = spoil(fault.kind.name, packet, self._rng)
        return packet, delay

    def _on_wire(self, strikes: Strikes, motor: int | None) -> list[Fault]:
        """The faults that strike this packet."""
        armed = [f for f in self._armed if f.kind.strikes is strikes and f.motor in (None, motor)]
        self._armed = [fault for fault in self._armed if fault not in armed]
        found = [f for f in self._faults if f.kind.strikes is strikes and f.motor in (None, motor)]
        found = armed + [fault for fault in found if self._happens(fault)]
        for fault in found:
            self.note(fault.kind.name, motor)
        return found

    def _happens(self, fault: Fault) -> bool:
        return bool(self._rng.random() < fault.rate)


def spoil(name: str, packet: bytes, rng: np.random.Generator) -> bytes:
    """A packet after the fault crc, drop, truncate or garbage."""
    match name:
        case "crc":
            place = int(rng.integers(len(packet))) if packet else 0
            bit = 1 << int(rng.integers(8))
            return (
                packet[:place]
                + bytes(b ^ bit for b in packet[place : place + 1])
                + packet[place + 1 :]
            )
        case "truncate":
            return packet[: int(rng.integers(len(packet)))] if packet else packet
        case "garbage":
            noise = rng.bytes(int(rng.integers(1, 2 * len(packet) + 2)))
            return noise + packet if rng.random() < 0.5 else noise
    return b""
