"""Test that damaged packets and files are read or refused, and never anything else.

Good samples of everything that is read from outside are mutated at random and read again. Each row of the
table counts what was read, what was refused, and what else happened, which is a defect; FOUND keeps an
example of each.
"""

import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tqdm import tqdm

from serpent_twin.arm.geometry import markers
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.emulator.motors import SimulatedMotors
from serpent_twin.emulator.responder import Responder
from serpent_twin.emulator.servos import Servos
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import natnet_packets as packets
from serpent_twin.hardware import natnet_reading as reading
from serpent_twin.hardware import protocol
from serpent_twin.hardware.base_frame import IDENTITY, Rigid
from serpent_twin.hardware.dynamixel.setup import ArmSetup, read_setup, write_setup
from serpent_twin.hardware.dynamixel.turns import LastSeen, read_turns, write_turns
from serpent_twin.hardware.motive import read_take
from serpent_twin.hardware.natnet_reading import PacketError
from serpent_twin.readouts import find, load, windows
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.runs.files import write_json
from serpent_twin.sessions import FIELDS, Journal, read_session, session_files, write_session
from serpent_twin.sessions.check import examine
from serpent_twin.sessions.stream import read_journal
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin import Twin
from serpent_twin.stored import within

_VERSIONS: tuple[packets.Version, ...] = ((3, 1), (4, 0), (4, 1))
_WORDS = (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x00010000)
_VALUES = (
    *("true", "null", "[]", "{}", '""', '"1.0"', "-1", "1e999", "NaN", "1" + 300 * "0"),
    *(2000 * "[", "[1.0]", '{"a": {"a": 1}}', "1e-320", '"\\ud800"'),
)


@dataclass(frozen=True)
class Fuzz(Checked):
    """Mutate packets and files, and count what becomes of them."""

    number: Annotated[int, within(1, 100_000_000)] = 10_000
    """Mutants of each source."""
    seed: Seed = 0
    """Seed of the mutations."""
    out: Path = Path("out/fuzz")
    """Folder for the table and for mutants that were neither read nor refused."""


@dataclass(frozen=True)
class FuzzTarget:
    """Something that is read from outside."""

    name: str
    samples: tuple[bytes, ...]
    read: Callable[[bytes], object]
    """Takes a sample in; raises `SerpentError` or `PacketError` on a bad one"""
    text: bool = False
    """Whether a value of it may be replaced by another of JSON or TOML"""


def mutants(samples: Sequence[bytes], number: int, rng: np.random.Generator) -> Iterator[bytes]:
    """Samples with bits flipped, bytes replaced, cut, doubled or inserted, and absurd words."""
    for _ in range(number):
        sample = bytearray(samples[rng.integers(len(samples))])
        for _ in range(rng.integers(1, 4)):
            _mutate(sample, rng)
        yield bytes(sample)


def _mutate(sample: bytearray, rng: np.random.Generator) -> None:
    at = int(rng.integers(len(sample) + 1))
    how = rng.integers(6)
    if how == 0 and at < len(sample):
        sample[at] ^= 1 << int(rng.integers(8))
    elif how == 1:
        sample[at : at + 4] = rng.bytes(4)
    elif how == 2:
        sample[at : at + 4] = int(rng.choice(_WORDS)).to_bytes(4, "little")
    elif how == 3:
        del sample[at:]
    elif how == 4:
        sample[at:at] = sample[: int(rng.integers(64))]
    else:
        sample[at:at] = rng.bytes(int(rng.integers(1, 32)))


def reworded(sample: bytes, rng: np.random.Generator) -> bytes:
    """A text with one of its values, keys or lines replaced, doubled or left out."""
    parts = sample.decode().split("," if b"," in sample else "\n")
    at = int(rng.integers(len(parts)))
    key, colon, _ = parts[at].rpartition(":" if ":" in parts[at] else "=")
    value = str(rng.choice(_VALUES))
    parts[at : at + 1] = [[f"{key}{colon}{value}"], [], [parts[at]] * 2, [value]][rng.integers(4)]
    return ("," if b"," in sample else "\n").join(parts).encode()


def examined(
    source: FuzzTarget, number: int, rng: np.random.Generator, found: Path
) -> Counter[str]:
    """How often mutants of a source were read, refused, or neither."""
    counts: Counter[str] = Counter(read=0, refused=0, other=0)
    for n, mutant in enumerate(mutants(source.samples, number, rng)):
        if source.text and n % 2:
            mutant = reworded(source.samples[n % len(source.samples)], rng)
        became, error = _taken(source, mutant)
        counts[became] += 1
        if error:
            (found / f"{source.name.replace(' ', '_')}_{type(error).__name__}").write_bytes(mutant)
    return counts


def _taken(source: FuzzTarget, mutant: bytes) -> tuple[str, BaseException | None]:
    """Whether a mutant was read or refused; else the error, warnings and errors in callbacks included."""
    unseen: list[BaseException | None] = []
    before, sys.unraisablehook = sys.unraisablehook, lambda seen: unseen.append(seen.exc_value)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            source.read(mutant)
        became, error = "read", None
    except (SerpentError, PacketError):
        became, error = "refused", None
    except Exception as raised:
        became, error = "other", raised
    finally:
        sys.unraisablehook = before
    return ("other", unseen[0]) if unseen else (became, error)


def sources(folder: Path) -> list[FuzzTarget]:
    """All that is read, with good samples; files are written into a folder."""
    return [*_packets(), *_logs(folder), *_texts(folder), *_readouts(folder)]


def _packets() -> Iterator[FuzzTarget]:
    place, names = markers(np.zeros(9)), [f"m{n}" for n in range(9)]
    for version in _VERSIONS:
        streamed = (
            packets.frame_of_data(version, 1, "arm", place, [False] * 9, 1.0, (1, 2, 3)),
            packets.model_definition(version, "arm", names),
            packets.server_info(version, 1_000_000, 1511),
        )
        name = "NatNet " + ".".join(map(str, version))
        yield FuzzTarget(name, streamed, lambda data, version=version: _natnet(data, version))
    responder = Responder(Servos(SimulatedMotors(Twin(), np.random.default_rng(0))))
    asked = [(i, p) for i in range(1, 10) for p in (b"", b"\x84\0\4\0", b"\x68\0\1\0\0\0")]
    group = [(0x82, b"\x84\0\4\0\1\2\3"), (0x83, b"\x68\0\4\0\1\1\0\0\0"), (0x8A, b"\x84\0\4\0\1")]
    wire = [protocol.instruction_packet(1, i, p) for i, p in asked]
    wire += [protocol.instruction_packet(0xFE, i, p) for i, p in group]
    yield FuzzTarget("instruction packets", tuple(wire), lambda data: _answer(responder, data))
    answers = tuple(protocol.status_packet(n, 0, bytes(27)) for n in range(1, 11))
    yield FuzzTarget("status packets", answers, lambda data: protocol.Parser().feed(data))


def _natnet(packet: bytes, version: packets.Version) -> None:
    kind, body = reading.opened(packet)
    if kind == packets.FRAME_OF_DATA:
        reading.frame_of_data(body, version)
    elif kind == packets.MODEL:
        reading.models(body, version)
    else:
        reading.server_info(body)


def _answer(responder: Responder, data: bytes) -> None:
    """Let servos hear bytes as they are, and with a checksum that is right."""
    parser = protocol.Parser()
    whole = data[:-2] + protocol.crc16(data[:-2]).to_bytes(2, "little")
    for packet in [*parser.feed(data), *parser.feed(whole), *parser.give_up()]:
        responder.answer(packet)


def _logs(folder: Path) -> Iterator[FuzzTarget]:
    path = collect(Collect(folder / "logs", sessions=3, steps=160))[0]
    session = read_session(path)[:40]
    short = write_session(folder / "short.parquet", session)
    yield FuzzTarget(
        "session logs", (short.read_bytes(),), _file(folder / "session_01.parquet", _log)
    )
    with Journal(folder / "torn.journal", session.metadata) as journal:
        for n in range(len(session)):
            journal.append({name: getattr(session, name)[n] for name in FIELDS})
    torn = (folder / "torn.journal").read_bytes()
    yield FuzzTarget("journals", (torn,), _file(folder / "cut.journal", read_journal))
    names = ",".join(f"arm:m{n},arm:m{n},arm:m{n}" for n in range(1, 10))
    rows = [",".join(f"{x:.6f}" for x in marker.ravel()) for marker in session.marker]
    take = [
        "Format Version,1.23,Take Name,arm,Export Frame Rate,4,Length Units,Meters",
        "",
        f",Type,{','.join(['Marker'] * 27)}",
        f",Name,{names}",
        f",ID,{','.join(['1'] * 27)}",
        f",,{','.join(['Position'] * 27)}",
        f"Frame,Time (Seconds),{','.join('XYZ' * 9)}",
        *(f"{n},{n / 4:.6f},{row}" for n, row in enumerate(rows)),
    ]
    csv = "\r\n".join([*take, ""]).encode()
    yield FuzzTarget("Motive takes", (csv,), _file(folder / "take.csv", read_take))


def _log(path: Path) -> None:
    examine(read_session(path))


def _texts(folder: Path) -> Iterator[FuzzTarget]:
    twin = folder / "twin.json"
    twin_model.write(twin, twin_model.NOMINAL_TWIN, {})
    yield FuzzTarget(
        "twin.json", (twin.read_bytes(),), _file(folder / "t.json", twin_model.read), True
    )
    setup = write_setup(ArmSetup("/dev/null", zero=(0,) * 10, path=folder / "arm.toml"))
    yield FuzzTarget("arm.toml", (setup.read_bytes(),), _file(folder / "a.toml", read_setup), True)
    turns = folder / "arm.turns.json"
    write_turns(turns, LastSeen(np.arange(10), np.zeros(10, int), True))
    yield FuzzTarget(
        "turns", (turns.read_bytes(),), _file(folder / "a.turns.json", read_turns), True
    )
    frame = folder / "frame.json"
    IDENTITY.save(frame)
    yield FuzzTarget(
        "frame.json", (frame.read_bytes(),), _file(folder / "f.json", Rigid.load), True
    )


def _readouts(folder: Path) -> Iterator[FuzzTarget]:
    data = windows.cut([read_session(path) for path in session_files(folder / "logs")], 4)
    linear = find("linear")(4)
    linear.fit(data, data, np.random.default_rng(0), lambda *_: None)
    saved = folder / "readout"
    linear.save(saved)

    def of(name: str) -> Callable[[bytes], object]:
        good = (saved / name).read_bytes()

        def read(content: bytes) -> object:
            (saved / name).write_bytes(content)
            try:
                return load(saved)
            finally:
                (saved / name).write_bytes(good)

        return read

    for name in ("readout.json", "learned.npz"):
        text = name.endswith("json")
        yield FuzzTarget(name, ((saved / name).read_bytes(),), of(name), text)


def _file(path: Path, read: Callable[[Path], object]) -> Callable[[bytes], object]:
    def of(content: bytes) -> object:
        path.write_bytes(content)
        return read(path)

    return of


def main(config: Fuzz) -> None:  # noqa: D103 tyro would print it above the config's own
    config.out.mkdir(parents=True, exist_ok=True)
    rng, table = np.random.default_rng(config.seed), {}
    with tempfile.TemporaryDirectory() as folder:
        for source in tqdm(sources(Path(folder)), unit="source"):
            table[source.name] = dict(examined(source, config.number, rng, config.out))
    print(f"{'source':22s} {'read':>9s} {'refused':>9s} {'other':>9s}")
    for name, counts in table.items():
        print(f"{name:22s} " + " ".join(f"{counts[k]:9d}" for k in ("read", "refused", "other")))
    write_json(config.out / "results.json", table)
    if any(counts["other"] for counts in table.values()):
        raise SerpentError(f"some mutants were neither read nor refused: see {config.out}.")


if __name__ == "__main__":
    cli.run(main)
