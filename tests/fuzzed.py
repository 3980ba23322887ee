"""What could become of good packets?"""

from collections.abc import Iterator, Sequence

import numpy as np


def mutants(packets: Sequence[bytes], number: int, rng: np.random.Generator) -> Iterator[bytes]:
    """Packets with bits flipped, bytes replaced, cut, doubled or inserted, and absurd words."""
    for _ in range(number):
        packet = bytearray(packets[rng.integers(len(packets))])
        for _ in range(rng.integers(1, 4)):
            _mutate(packet, rng)
        yield bytes(packet)


def _mutate(packet: bytearray, rng: np.random.Generator) -> None:
    at = int(rng.integers(len(packet) + 1))
    how = rng.integers(6)
    if how == 0 and at < len(packet):
        packet[at] ^= 1 << int(rng.integers(8))
    elif how == 1:
        packet[at : at + 4] = rng.bytes(4)
    elif how == 2:
        word = rng.choice([0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x00010000])
        packet[at : at + 4] = int(word).to_bytes(4, "little")
    elif how == 3:
        del packet[at:]
    elif how == 4:
        packet[at:at] = packet[: int(rng.integers(64))]
    else:
        packet[at:at] = rng.bytes(int(rng.integers(1, 32)))
