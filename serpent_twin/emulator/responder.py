"""Answer instruction packets as servos on one wire do."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from serpent_twin.emulator.control_table import ControlTable
from serpent_twin.emulator.servos import RESET_ALL, Servos
from serpent_twin.hardware import protocol
from serpent_twin.hardware.control_table import BAUD_RATES, FIRST_RAM_ADDRESS, TABLE
from serpent_twin.hardware.protocol import BROADCAST, Error, Instruction, Packet

_DELAY_UNIT = 2e-6  # [s] manual: Return Delay Time (9), 1 unit = 2 µs
_ALL, _READS = 2, 1  # of Status Return Level (68); 0 answers pings alone


@dataclass(frozen=True)
class Reply:
    """One servo's status packet, or its part of a fast read's, on its way."""

    index: int
    """The servo it is from, from 0"""
    data: bytes
    baud: int
    """Bits per second"""
    delay: float = 0.0
    """Return Delay Time [s]"""
    follows: bool = False
    """Whether it goes on a fast read's packet, which only the whole part before it lets it do"""


@dataclass(frozen=True)
class Voice:
    """A servo's registers that set how it answers, which the instruction itself may change."""

    id: int
    level: int
    """Status Return Level"""
    delay: float
    """[s]"""
    baud: int
    """Bits per second"""

    @classmethod
    def of(cls, table: ControlTable) -> "Voice":
        """Read how a servo answers now from its control table."""
        delay = table["return_delay_time"] * _DELAY_UNIT
        return cls(table["id"], table["status_return_level"], delay, BAUD_RATES[table["baud_rate"]])


@dataclass(frozen=True)
class Access:
    """Bytes of one servo's table that an instruction reads or writes."""

    id: int
    address: int
    length: int
    data: bytes = b""


class Responder:
    """The protocol over `Servos`. `listens` says of a servo, from 0, whether it is on the wire.

    A servo that is not on the wire neither receives nor answers. After a silent one the others
    answer a group read in their turn; behind a silent one a fast read's packet breaks off.
    """

    def __init__(self, servos: Servos, listens: Callable[[int], bool] = lambda _: True) -> None:
        self.servos = servos
        self.listens = listens

    def answer(self, packet: Packet) -> list[Reply]:
        """Execute an instruction packet; returns its status packets, in order."""
        for index in filter(self.listens, range(len(self.servos.table))):
            self.servos.hear(index)
        self.servos.refresh()
        match packet.instruction:
            case Instruction.SYNC_READ | Instruction.BULK_READ:
                return [r for access in accesses(packet) for r in self._read_all(access)]
            case Instruction.FAST_SYNC_READ | Instruction.FAST_BULK_READ:
                return self._fast_read(accesses(packet))
            case Instruction.SYNC_WRITE | Instruction.BULK_WRITE:
                self._write_all(accesses(packet))
                return []
            case Instruction.STATUS:
                return []
        replies = [self._single(index, packet) for index in self.addressed(packet.id)]
        if packet.instruction == Instruction.WRITE:
            address = int.from_bytes(packet.params[:2], "little")
            self._write_secondary(Access(packet.id, address, 0, packet.params[2:]))
        return [reply for reply in replies if reply]

    def sets_goals(self, packet: Packet) -> bool:
        """Whether a packet is a group write of goal velocities or positions: a control cycle."""
        writes = packet.instruction in (Instruction.SYNC_WRITE, Instruction.BULK_WRITE)
        return writes and self.touches(packet, "goal_velocity", "goal_position")

    def touches(self, packet: Packet, *names: str) -> bool:
        """Whether a group instruction reads or writes one of the registers."""
        wanted = {TABLE[name].address for name in names}
        return any(
            not wanted.isdisjoint(self.servos.table[index].places(access.address, access.length))
            for access in accesses(packet)
            for index in self.servos.with_id(access.id)
        )

    def addressed(self, id: int) -> Iterator[int]:
        """The servos on the wire that a packet to an id, or to all, is meant for."""
        indices = range(len(self.servos.table)) if id == BROADCAST else self.servos.with_id(id)
        return filter(self.listens, indices)

    def _single(self, index: int, packet: Packet) -> Reply | None:
        """One servo's answer to a packet to it or to all, or none."""
        voice = Voice.of(self.servos.table[index])
        if packet.instruction == Instruction.PING:
            return self._reply(index, voice, Error.NONE, self._who(index))
        error, data = self._do(index, packet)
        needs = _READS if packet.instruction == Instruction.READ else _ALL
        if packet.id == BROADCAST or voice.level < needs:
            return None
        return self._reply(index, voice, error, data)

    def _do(self, index: int, packet: Packet) -> tuple[int, bytes]:
        servos, params = self.servos, packet.params
        address = int.from_bytes(params[:2], "little")
        match packet.instruction:
            case Instruction.READ:
                return servos.table[index].read(address, int.from_bytes(params[2:4], "little"))
            case Instruction.WRITE:
                return servos.write(index, address, params[2:]), b""
            case Instruction.REG_WRITE:
                return servos.reg_write(index, address, params[2:]), b""
            case Instruction.ACTION:
                return servos.action(index), b""
            case Instruction.REBOOT:
                servos.reboot(index)
                return Error.NONE, b""
            case Instruction.FACTORY_RESET if packet.id == BROADCAST and params == RESET_ALL:
                return Error.NONE, b""  # manual: not activated for all at once
            case Instruction.FACTORY_RESET:
                return servos.factory_reset(index, params[0] if params else 0), b""
            case Instruction.CLEAR if params == protocol.CLEAR_POSITION:
                return servos.clear_turns(index), b""
            case Instruction.CLEAR:
                return Error.DATA_RANGE, b""
            case Instruction.CONTROL_TABLE_BACKUP:
                return servos.back_up(index, params), b""
        return Error.INSTRUCTION, b""

    def _reply(self, index: int, voice: Voice, error: int, data: bytes = b"") -> Reply:
        packet = protocol.status_packet(voice.id, error | self.servos.alert(index), data)
        return Reply(index, packet, voice.baud, voice.delay)

    def _who(self, index: int) -> bytes:
        table = self.servos.table[index]
        return TABLE["model_number"].pack(table["model_number"]) + bytes(
            [table["firmware_version"]]
        )

    def _read_all(self, access: Access) -> list[Reply]:
        tables = ((index, self.servos.table[index]) for index in self.addressed(access.id))
        return [
            self._reply(index, voice, *table.read(access.address, access.length))
            for index, table in tables
            if (voice := Voice.of(table)).level >= _READS
        ]

    def _write_all(self, wanted: list[Access]) -> None:
        for access in wanted:
            for index in self.addressed(access.id):
                self.servos.write(index, access.address, access.data)
            self._write_secondary(access)

    def _write_secondary(self, access: Access) -> None:
        """Write to servos by their secondary id, which is not answered and leaves the EEPROM alone."""
        if access.address >= FIRST_RAM_ADDRESS:
            for index in filter(self.listens, self.servos.with_secondary_id(access.id)):
                self.servos.write(index, access.address, access.data)

    def _fast_read(self, wanted: list[Access]) -> list[Reply]:
        speakers: list[int] = []
        blocks: list[tuple[int, int, bytes]] = []
        for access in wanted:
            index = next(self.addressed(access.id), None)
            if index is None:
                break
            error, data = self.servos.table[index].read(access.address, access.length)
            error |= self.servos.alert(index)
            speakers.append(index)
            blocks.append(
                (error, access.id, data.ljust(min(access.length, protocol.MAX_LENGTH), b"\0"))
            )
        size = sum(access.length for access in wanted)
        if not blocks or size + 4 * len(wanted) >= protocol.MAX_LENGTH:
            return []
        parts = protocol.fast_status_parts(blocks, len(wanted), size)
        return [
            Reply(index, part, Voice.of(self.servos.table[index]).baud, follows=n > 0)
            for n, (index, part) in enumerate(zip(speakers, parts, strict=True))
        ]


def accesses(packet: Packet) -> list[Access]:
    """Reads or writes of a group instruction, servo by servo, without a part that is cut off and
    without the second read of an id.
    """
    match packet.instruction:
        case Instruction.SYNC_READ | Instruction.FAST_SYNC_READ:
            return _once(_sync(packet.params, 0))
        case Instruction.SYNC_WRITE:
            return list(_sync(packet.params, int.from_bytes(packet.params[2:4], "little")))
        case Instruction.BULK_READ | Instruction.FAST_BULK_READ:
            return _once(_bulk(packet.params, carries_data=False))
        case Instruction.BULK_WRITE:
            return list(_bulk(packet.params, carries_data=True))
    return []


def _once(wanted: Iterator[Access]) -> list[Access]:
    by_id: dict[int, Access] = {}
    for access in wanted:
        by_id.setdefault(access.id, access)
    return list(by_id.values())


def _sync(params: bytes, size: int) -> Iterator[Access]:
    """Address and length once, then ids, each with `size` bytes of data."""
    address, length = (int.from_bytes(params[n : n + 2], "little") for n in (0, 2))
    for at in range(4, len(params) - size, 1 + size):
        yield Access(params[at], address, length, params[at + 1 : at + 1 + size])


def _bulk(params: bytes, carries_data: bool) -> Iterator[Access]:
    """Id, address, length and perhaps data, again and again."""
    at = 0
    while at + 5 <= len(params):
        address, length = (int.from_bytes(params[at + n : at + n + 2], "little") for n in (1, 3))
        end = at + 5 + (length if carries_data else 0)
        if end > len(params):
            return
        yield Access(params[at], address, length, params[at + 5 : end])
        at = end
