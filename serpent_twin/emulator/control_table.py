"""Map addresses to the bytes of a servo's control table."""

from collections.abc import Sequence

from serpent_twin.hardware.control_table import LAST_ADDRESS, TABLE, Item
from serpent_twin.hardware.protocol import Error

_ITEM_AT = {item.address: item for item in TABLE.values()}
_DEFINED = frozenset(item.address + n for item in TABLE.values() for n in range(item.size))
_POINTER = {  # of each byte of Indirect Data, the register that holds its true address
    item.address: TABLE[item.name.replace("data", "address")]
    for item in TABLE.values()
    if item.name.startswith("indirect_data")
}
_FIRST_INDIRECT = min(_POINTER)

Words = Sequence[tuple[Item, int]]


class ControlTable:
    """One control table: registers by name, and by address as on the wire."""

    def __init__(self) -> None:
        self._bytes = bytearray(LAST_ADDRESS + 1)

    def __getitem__(self, name: str) -> int:
        item = TABLE[name]
        return item.unpack(self._bytes[item.address : item.address + item.size])

    def __setitem__(self, name: str, value: int) -> None:
        item = TABLE[name]
        self._bytes[item.address : item.address + item.size] = item.pack(value)

    def reset(self, first: int) -> None:
        """Give all registers from an address on their defaults."""
        for item in TABLE.values():
            if item.address >= first:
                self[item.name] = item.default

    def patch(self, address: int, data: bytes) -> None:
        """Overwrite bytes in place."""
        self._bytes[address : address + len(data)] = data

    def read(self, address: int, length: int) -> tuple[int, bytes]:
        """Bytes from an address on, and `Error.NONE` or why not.

        A: gaps between registers read 0 within a block, and nothing by themselves. The manual refuses to read
        what is not defined, but the vendor's monitor reads such blocks.
        """
        if length < 1:
            return Error.DATA_LENGTH, b""
        if _leaves_table(address, length) or _DEFINED.isdisjoint(range(address, address + length)):
            return Error.ACCESS, b""
        if address + length <= _FIRST_INDIRECT:
            return Error.NONE, bytes(self._bytes[address : address + length])
        return Error.NONE, bytes(self._bytes[place] for place in self.places(address, length))

    def words(self, address: int, data: bytes) -> tuple[int, Words]:
        """The registers that a write covers whole with their new words, or why it is no such write."""
        if not data:
            return Error.DATA_LENGTH, ()
        if _leaves_table(address, len(data)):
            return Error.ACCESS, ()
        places, words = self.places(address, len(data)), []
        while places:
            item = _ITEM_AT.get(places[0])
            if item is None:
                return Error.ACCESS, ()
            covered = places[: item.size]
            if covered != list(range(item.address, item.address + len(covered))):
                return Error.ACCESS, ()
            if len(covered) < item.size:
                return Error.DATA_LENGTH, ()
            words.append((item, item.unpack(data[-len(places) :][: item.size])))
            places = places[item.size :]
        return Error.NONE, words

    def places(self, address: int, length: int) -> list[int]:
        """True addresses of bytes, without those beyond the table's end: Indirect Data lies at its
        Indirect Address.
        """
        addresses = range(address, min(address + length, LAST_ADDRESS + 1))
        return [self[_POINTER[a].name] if a in _POINTER else a for a in addresses]


def _leaves_table(address: int, length: int) -> bool:
    return address + length > LAST_ADDRESS + 1
