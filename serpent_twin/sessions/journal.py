"""Record a session so that a crash loses no row."""

import fcntl
import os
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.runs.files import sync_folder
from serpent_twin.sessions.parquet import check_metadata
from serpent_twin.sessions.session import COLUMNS, FIELDS, SCHEMA_VERSION
from serpent_twin.sessions.stream import batch_over, header_crc, read_journal, stream_schema


class Journal:
    """The session being recorded, row by row; `seal` makes the session log of it.

    `path` is session_NN.parquet or session_NN.journal; `extra` names further scalar columns.
    Leaving the `with` block without `seal` keeps the journal for `recover`. Rows outlive the program at
    once, and a loss of power once `sync` was called.
    """

    def __init__(
        self,
        path: Path | str,
        metadata: Mapping[str, Any],
        extra: Sequence[str] = (),
    ) -> None:
        self.path = Path(path).with_suffix(".journal")
        self.rows = 0
        self._time = -np.inf
        _refuse_existing(self.path.with_suffix(".parquet"), self.path)
        header = {"schema_version": SCHEMA_VERSION} | dict(metadata)
        schema = stream_schema(check_metadata(header, str(self.path)), (*COLUMNS, *extra))
        self._crc = header_crc(schema)
        self._vector = np.zeros(len(COLUMNS) + len(extra))
        self._slots = _slots(self._vector, extra)
        self._checksum = np.zeros(1, np.uint32)
        self._batch = batch_over(self._vector, self._checksum, schema)
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._size = 0
        fcntl.flock(self._file, fcntl.LOCK_EX)  # shows `recover` that the recorder is alive
        try:
            self._write(schema.serialize())
        except OSError:
            self.close()
            self.path.unlink()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind and not self.rows and self._file >= 0:
            self.discard()
        self.close()

    def append(self, row: Mapping[str, ArrayLike]) -> None:
        """Log one row, keyed like the arrays of a `Session`: time (), motor_position (10,) ….

        Its time must be after that of the row before. A row that a full disk refuses raises
        `OSError` and leaves the rows before it.
        """
        if row.keys() != self._slots.keys():
            odd = sorted(row.keys() ^ self._slots.keys())
            raise SerpentError(f"{self.path}: a row must have exactly its columns; check {odd}.")
        for name, slot in self._slots.items():
            value = np.asarray(row[name], np.float64)
            if value.shape != slot.shape:
                raise SerpentError(
                    f"{self.path}: {name} has shape {value.shape}, expected {slot.shape}."
                )
            slot[...] = value
        if not self._vector[0] > self._time:
            raise SerpentError(
                f"{self.path}: time {self._vector[0]} s is not after the last row's {self._time} s."
            )
        crc = self._checksum[0] = zlib.crc32(self._vector.data, self._crc)
        self._write(self._batch.serialize())
        self._crc, self._time, self.rows = int(crc), self._vector[0], self.rows + 1

    def seal(self, ended: Mapping[str, Any] = {"complete": True}) -> Path:
        """Write session_NN.parquet from the journal, then delete the journal.

        `ended` joins the metadata: whether the session is complete, and what is known at its end.
        """
        content = read_journal(self.path)
        if len(content.rows) != self.rows or content.bytes_dropped:
            raise SerpentError(
                f"{self.path} holds {counted(len(content.rows), 'whole row')}, but {self.rows} were written: "
                "the file was changed meanwhile. It is kept; `recover` saves the rows before that."
            )
        sealed = content.write(self.path.with_suffix(".parquet"), dict(ended))
        self.path.unlink()
        sync_folder(self.path.parent)
        self.close()
        return sealed

    def sync(self) -> None:
        """Force what was written to the disk; may be called beside `append`, from another thread."""
        os.fsync(self._file)

    def discard(self) -> None:
        """Delete a journal without rows."""
        if self.rows:
            raise SerpentError(
                f"{self.path} holds {counted(self.rows, 'row')}, which are kept: seal it."
            )
        self.path.unlink()
        self.close()

    def close(self) -> None:
        """Release the file without sealing it."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _write(self, message: Any) -> None:
        """Write all of it or nothing: a full disk leaves the journal at its last whole row."""
        left = memoryview(message)
        try:
            while len(left):
                left = left[os.write(self._file, left) :]
        except OSError as error:
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, self._size, os.SEEK_SET)
            raise OSError(error.errno, error.strerror, str(self.path)) from error
        self._size += len(message)


def _refuse_existing(*paths: Path) -> None:
    for path in paths:
        if path.exists():
            todo = "move it away" if path.suffix == ".parquet" else "recover it first"
            raise SerpentError(
                f"{path} exists already and is kept: {todo}, or choose another folder."
            )


def _slots(vector: Array, extra: Sequence[str]) -> dict[str, Array]:
    """Views of a row vector (77 + extra,) by the names of a session's arrays."""
    shapes = {name: f.shape for name, f in FIELDS.items()} | dict.fromkeys(extra, ())
    slots, at = {}, 0
    for name, shape in shapes.items():
        size = int(np.prod(shape))
        slots[name] = vector[at : at + size].reshape(shape)
        at += size
    return slots
