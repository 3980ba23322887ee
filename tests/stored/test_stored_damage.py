"""Test that damaged bytes, and what is no file, are refused in one sentence."""

import os

import numpy as np
from refusals import FOREIGN, refused

from serpent_twin.errors import SerpentError


def test_what_is_no_file_is_refused_and_not_waited_for(reader, path):
    good = path.read_bytes()
    path.unlink()
    path.mkdir()
    refused(reader, path, "folder")
    path.rmdir()
    os.mkfifo(path)
    refused(reader, path, "pipe")
    path.unlink()
    path.write_bytes(good)
    with path.open("r+b") as file:
        file.truncate(10_000_000_000)
    refused(reader, path, "bytes")


def test_mutants_are_read_or_refused(reader, path):
    """Bytes changed, dropped, doubled and put in, by a seed."""
    rng, good = np.random.default_rng(1), reader.text(path).encode()
    signs = [
        b"[",
        b"{",
        b"]",
        b"}",
        b'"',
        b",",
        b":",
        b"-",
        b"9" * 30,
        b"1e999",
        b"null",
        b"true",
        b"NaN",
    ]
    for _ in range(60 if reader.inside else 300):
        mutant = bytearray(good)
        for _ in range(rng.integers(1, 4)):
            where, until = np.sort(rng.integers(0, len(mutant) + 1, 2))
            kind = rng.integers(4)
            if kind == 0 and where < len(mutant):
                mutant[where] = rng.integers(1, 128)
            elif kind == 1:
                del mutant[where:until]
            elif kind == 2:
                mutant[where:where] = mutant[where : min(until, where + 40)]
            else:
                mutant[where:where] = signs[rng.integers(len(signs))]
        reader.put(path, bytes(mutant))
        try:
            reader.read(path)
        except SerpentError as error:
            told = str(error).replace(str(path.parent), "")
            assert path.name in told and not FOREIGN.search(told), told
