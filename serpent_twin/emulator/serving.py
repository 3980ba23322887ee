"""Serve the servos on a terminal: read packets, write answers, advance time."""

import heapq
import select
import time
from collections import Counter
from collections.abc import Callable
from itertools import count

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.emulator.faults import Fault, Faults, Strikes
from serpent_twin.emulator.motors import VOLTAGE_ERROR
from serpent_twin.emulator.natnet_server import SimulatedCameras
from serpent_twin.emulator.orders import Orders
from serpent_twin.emulator.responder import Reply, Responder
from serpent_twin.emulator.servos import Servos
from serpent_twin.emulator.terminal import Terminal
from serpent_twin.emulator.transcript import Transcript
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import xl430
from serpent_twin.hardware.control_table import BAUD_RATES
from serpent_twin.hardware.protocol import Instruction, Packet, Parser

OTHER_MODEL = 1030  # XM430-W210
BROWN_OUT = 55  # [0.1 V] below all that Min Voltage Limit (34) can be
_RESTART = 0.3  # [s] A: how long a servo is silent when it restarts
_BYTE_GAP = 0.02  # [s] a pause that ends a packet; the manual's 1.5 ms is shorter than a busy CPU's
_IDLE = 0.01  # [s] longest time between two readings of the clock
_MOST_LAG = 0.2  # [s] greatest lag of a machine that is too slow, before time is skipped
_BITS = 10  # on the wire for a byte: start, 8, stop
_SPEED_MARGIN = 0.03  # [1] manual: an error of less than 3 % of the baud rate does not matter
_READS = (
    Instruction.SYNC_READ,
    Instruction.FAST_SYNC_READ,
    Instruction.BULK_READ,
    Instruction.FAST_BULK_READ,
)


class Device:
    """Servos behind a terminal.

    In lockstep (`period` [s]) the motors' time stands still but for one period after each group
    write of goals, and the bus watchdog with it; else it follows the wall clock. The wire follows
    the wall clock in both: late packets, silences, an unplugged port. `paced` lets packets take
    their time at the servos' baud rate, and return delays. `counts` holds what came and went.
    """

    def __init__(
        self,
        servos: Servos,
        terminal: Terminal,
        faults: Faults,
        transcript: Transcript,
        period: float | None = None,
        paced: bool = True,
        cameras: SimulatedCameras | None = None,
    ) -> None:
        self.servos, self.terminal, self.faults = servos, terminal, faults
        self.counts: Counter[str] = Counter()
        self._transcript, self._period, self._paced = transcript, period, paced
        self._cameras, self._idle = cameras, _IDLE if cameras is None else 0.5 / cameras.rate_hz
        self._responder = Responder(servos, self._listens)
        self._parser = Parser()
        self._step = servos.motors.twin.model.opt.timestep
        self._epoch = self._last_byte = time.monotonic()
        self._steps = 0
        self._later: list[tuple[float, int, Callable[[], None]]] = []
        self._order = count()
        self._silent_until, self._low_until = np.zeros(N_MOTORS), np.zeros(N_MOTORS)
        self._nominal = servos.motors.voltage.copy()
        self._doubled: set[int] = set()
        self._speed = 0  # [bit/s]
        self._stopping = False

    def serve(self, orders: Orders, until_eof: bool = False) -> None:
        """Answer until `stop`, or until there can be no more orders.

        The port is announced to `orders`, and again after it was plugged in again.
        """
        self._orders = orders
        self._epoch = time.monotonic()
        for fault in self.faults.events(Strikes.START):
            self.strike(fault)
        try:
            self._plug()
            while not (self._stopping or (until_eof and orders.fileno() < 0)):
                self._turn()
        finally:
            self.terminal.unplug()
            self._transcript.close()
            if self._cameras:
                self._cameras.close()

    def stop(self, *_: object) -> None:
        """End `serve`; may be a signal's handler."""
        self._stopping = True

    def tally(self) -> dict[str, int | dict[str, int]]:
        """Instruction packets, control cycles and replies; bytes that were no packet; faults by name;
        how often the machine was `too_slow` and the arm was `torn`.
        """
        dropped, faults = dict(self._parser.dropped), dict(self.faults.counts)
        return {**self.counts, "dropped": dropped, "faults": faults}

    def obey(self, line: str) -> str:
        """Inject a fault once, as a person orders it; returns the answer to them."""
        try:
            fault = Fault.order(line)
            self.faults.require_motor(fault)
        except SerpentError as error:
            return f"error: {error}"
        if fault.kind.strikes in (Strikes.STATUS, Strikes.INSTRUCTION):
            self.faults.arm(fault)
            return f"done: {fault.kind.name} will strike the next packet"
        fault = self.faults.aimed(fault)
        if fault.kind.name == "unplug" and not self.terminal.plugged:
            return "error: the port is unplugged already; wait until it is back."
        self.strike(fault)
        return f"done: {fault.kind.name}" + (f", motor {fault.motor}" if fault.motor else "")

    def strike(self, fault: Fault) -> None:
        """Let a fault of a motor or of the port happen now; none unplugs a port that is unplugged."""
        if fault.kind.name == "unplug" and not self.terminal.plugged:
            return
        self.faults.note(fault.kind.name, fault.motor)
        index = (fault.motor or 1) - 1
        match fault.kind.name:
            case "missing":
                self._silence(index, fault.seconds)
            case "unplug":
                self.terminal.unplug()
                self._after(fault.seconds, self._plug)
            case "overload":
                self.servos.motors.trip(index, xl430.OVERLOAD)
            case "voltage":
                self._brown_out(index, fault.seconds)
            case "watchdog":
                self.servos.trip_watchdog(index)
            case "reboot":
                self.servos.reboot(index)
                self.servos.restarted.discard(index)
                self._silence(index, fault.seconds)
            case "doubled":
                self._doubled.add(index)
            case "wrong_model":
                self.servos.table[index]["model_number"] = OTHER_MODEL

    def _turn(self) -> None:
        """Wait for something to happen, and do it."""
        all_sources = (self.terminal, self._orders, *([self._cameras] if self._cameras else ()))
        sources = [source for source in all_sources if source.fileno() >= 0]
        ready = select.select(sources, [], [], self._patience())[0]
        now = time.monotonic()
        packets = self._receive(now) if self.terminal in ready else []
        if not packets and now - self._last_byte > _BYTE_GAP:
            packets = self._parser.give_up()
        for packet in packets:
            if self.terminal.plugged:  # an earlier packet may have caused an unplug
                self._take(packet)
        self._pass_time()  # with packets too: a busy host does not stop the cameras
        if self._orders in ready:
            self._orders.read(self.obey)
        if self._cameras and self._cameras in ready:
            self._cameras.poll()
        self._keep_dates()
        if self.terminal.plugged:
            self.terminal.flush(time.monotonic())

    def _patience(self) -> float:
        """Time until the next task is due [s]."""
        dates = [self.terminal.next_due, self._later[0][0] if self._later else None]
        soonest = min((date for date in dates if date is not None), default=np.inf)
        return float(np.clip(soonest - time.monotonic(), 0.0, self._idle))

    def _receive(self, now: float) -> list[Packet]:
        data = self.terminal.read()
        found = self._parser.give_up() if now - self._last_byte > _BYTE_GAP else []
        self._last_byte = now
        return found + self._parser.feed(data)

    def _take(self, packet: Packet) -> None:
        """Execute an instruction packet, and send its status packets."""
        self.counts["packets"] += 1
        self._speed = self.terminal.speed()
        if self.faults.deafens():
            return
        if self._period is None:
            self._advance(self._steps_due())
        replies = self._responder.answer(packet)
        self._silence_restarted()
        if packet.instruction in _READS and self._responder.touches(packet, "present_position"):
            self._transcript.read()
        if self._responder.sets_goals(packet):
            self._cycle()
        self._send(replies, packet)

    def _cycle(self) -> None:
        """Log a control cycle's goals, advance the motors in lockstep, and inject the cycle's faults."""
        self.counts["cycles"] += 1
        self._transcript.goal()
        if self._period is not None:
            self._advance(round(self._period / self._step))
        for fault in self.faults.events(Strikes.CYCLE):
            self.strike(fault)

    def _send(self, replies: list[Reply], packet: Packet) -> None:
        due = time.monotonic() + self._wire_time(packet.wire, self._speed)
        held_up, broken = 0.0, False  # a fast read's packet so far
        for reply in replies:
            if broken and reply.follows:
                continue
            for _ in range(2 if reply.index in self._doubled else 1):
                due += reply.delay if self._paced else 0.0
                due += self._wire_time(reply.data, reply.baud)
                data, delay = self.faults.strike(reply.data, reply.index + 1)
                broken = len(data) != len(reply.data)
                held_up = delay + (held_up if reply.follows else 0.0)
                self.counts["replies"] += bool(data)
                self.terminal.send(data, due + held_up)

    def _wire_time(self, data: bytes, baud: int) -> float:
        return len(data) * _BITS / baud if self._paced and baud else 0.0

    def _listens(self, index: int) -> bool:
        """Whether a servo is on the wire, at the speed that the port is set to."""
        rate = BAUD_RATES[self.servos.table[index]["baud_rate"]]
        awake = time.monotonic() >= self._silent_until[index]
        return awake and abs(self._speed - rate) < _SPEED_MARGIN * rate

    def _silence_restarted(self) -> None:
        while self.servos.restarted:
            self._silence(self.servos.restarted.pop(), _RESTART)

    def _silence(self, index: int, seconds: float) -> None:
        until = time.monotonic() + seconds
        self._silent_until[index] = max(self._silent_until[index], until)

    def _pass_time(self) -> None:
        if self._period is not None:
            return
        self._advance(self._steps_due())
        for index in self.servos.watch():
            self.faults.note("watchdog", index + 1)
        self._transcript.state()
        if self._cameras:
            self._cameras.send(self.servos.motors.twin.markers[0], self.servos.motors.time)

    def _steps_due(self) -> int:
        """Time steps by which the motors are behind the wall clock."""
        due = int((time.monotonic() - self._epoch) / self._step) - self._steps
        left_out = due - round(_MOST_LAG / self._step)
        if left_out > 0:
            self.counts["too_slow"] += 1
            self._epoch += left_out * self._step
            due -= left_out
        self._steps += due
        return due

    def _advance(self, steps: int) -> None:
        """Let time pass; an arm whose simulation becomes unstable is re-strung, and all motors trip."""
        if steps < 1:
            return
        try:
            self.servos.advance(steps * self._step)
        except SerpentError:
            self.counts["torn"] += 1
            self.servos.motors.restring()

    def _brown_out(self, index: int, seconds: float) -> None:
        self._low_until[index] = max(self._low_until[index], time.monotonic() + seconds)
        self.servos.motors.voltage[index] = BROWN_OUT
        self.servos.motors.trip(index, VOLTAGE_ERROR)
        self._after(seconds, lambda: self._recover(index))

    def _recover(self, index: int) -> None:
        if time.monotonic() >= self._low_until[index]:
            self.servos.motors.voltage[index] = self._nominal[index]

    def _plug(self) -> None:
        self.terminal.plug()
        while self._parser.waiting:
            self._parser.give_up()
        self._orders.tell_port(self.terminal)

    def _after(self, seconds: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._later, (time.monotonic() + seconds, next(self._order), action))

    def _keep_dates(self) -> None:
        while self._later and self._later[0][0] <= time.monotonic():
            heapq.heappop(self._later)[2]()
