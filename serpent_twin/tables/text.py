"""Read a table that is text: CSV, TSV and the like, also compressed by gzip."""

import gzip
import io
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as csv

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.stored import require_file
from serpent_twin.tables.arrow import values_of
from serpent_twin.tables.dialect import BLANKS, COMMENTS, Dialect, NoHeaderError, find
from serpent_twin.tables.table import MOST_BYTES, Column, DataTable, require_once, require_room

_HEAD = 1_000_000
"""Bytes in which the header is looked for"""
_HEAD_LINES = 200
_CHUNK = 1 << 20
_NULLS = ["", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "null", "NULL", "None", "none", "-", "--"]
CUT = "its last row is cut off, and left out"


def read(path: Path, advice: str) -> DataTable:
    """The table of a text; raises a `SerpentError` that names the line that is wrong."""
    raw, notes = unpacked(path, advice)
    encoding = _encoding(raw)
    try:
        head = raw[:_HEAD].decode(encoding, "replace").removeprefix("\ufeff")
        dialect = find(re.split(r"\r\n|\n|\r", head)[:_HEAD_LINES])
    except NoHeaderError as error:
        raise SerpentError(f"{path} is no table: {error}.") from None
    names = [name for name in dialect.names if name]
    require_once(path, names, advice)
    rows = _Rows(path, dialect, advice)
    table = rows.parsed(raw, encoding)
    cut = rows.cut or bool(notes) or _is_short(raw, encoding, dialect)
    keep = table.num_rows - (cut and not rows.cut)
    columns = {
        name: values_of(table.column(n).slice(0, keep))
        for n, name in enumerate(dialect.names)
        if name
    }
    units = dict(zip(dialect.names, dialect.units, strict=False))
    return DataTable(path, columns, (*notes, *([CUT] if cut else [])), units)


def packed(columns: Mapping[str, Column]) -> bytes:
    """The bytes of a CSV file of columns (T,)."""
    sink = io.BytesIO()
    csv.write_csv(pa.table(dict(columns)), sink)
    return sink.getvalue()


def unpacked(path: Path, advice: str) -> tuple[bytes, tuple[str, ...]]:
    """The bytes of a file, also of one that gzip compressed, and what is to be said of them."""
    require_file(path, MOST_BYTES, advice)
    if not path.name.lower().endswith(".gz"):
        return path.read_bytes(), ()
    parts, size, notes = list[bytes](), 0, ()
    try:
        with gzip.open(path) as file:
            while part := file.read1(_CHUNK):
                parts.append(part)
                if (size := size + len(part)) > MOST_BYTES:
                    raise SerpentError(
                        f"{path} unpacks to more than {MOST_BYTES:,} bytes. {advice}"
                    )
    except EOFError:
        notes = ("the compressed file is cut off: what is there was read",)
    except (OSError, zlib.error) as error:
        raise SerpentError(
            f"{path} is not compressed by gzip: {error}. {advice}".rstrip()
        ) from None
    return b"".join(parts), notes


def _encoding(raw: bytes) -> str:
    """UTF-8 or UTF-16 as the beginning says, else Latin-1, which has ° and µ."""
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    try:
        raw.decode()
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


class _Rows:
    """Rows of a text; `cut` says afterwards whether the last one lacked cells."""

    def __init__(self, path: Path, dialect: Dialect, advice: str) -> None:
        self.path, self.dialect, self.advice = path, dialect, advice
        self.wrong: list[Any] = []
        self.cut = False

    def parsed(self, raw: bytes, encoding: str) -> pa.Table:
        """All whole rows; raises a `SerpentError` where one in the middle has too few or too many cells."""
        separator = self.dialect.separator
        if separator == BLANKS:
            raw, encoding, separator = _without_blanks(raw.decode(encoding)), "utf-8", "\t"
        lines = raw.count(b"\n")
        require_room(self.path, lines, len(self.dialect.names), self.advice)
        try:
            table = csv.read_csv(
                io.BytesIO(raw),
                csv.ReadOptions(
                    use_threads=False,  # else rows that are wrong have no number
                    block_size=min(
                        max(len(raw), _CHUNK), 1 << 30
                    ),  # kinds of columns are of a block
                    skip_rows=self.dialect.skip,
                    column_names=[str(n) for n in range(len(self.dialect.names))],
                    encoding=encoding,
                ),
                csv.ParseOptions(delimiter=separator, invalid_row_handler=self._wrong),
                csv.ConvertOptions(
                    decimal_point=self.dialect.decimal,
                    null_values=_NULLS,
                    strings_can_be_null=True,
                ),
            )
        except (pa.ArrowException, OSError, UnicodeDecodeError, ValueError) as error:
            why = " ".join(str(error).split()).rstrip(".")
            raise SerpentError(f"{self.path} is no table: {why}. {self.advice}".rstrip()) from None
        self._judge(raw.decode(encoding) if self.wrong else "")
        return table

    def _wrong(self, row: Any) -> str:
        if not row.text.lstrip().startswith(COMMENTS):
            self.wrong.append(row)
        return "skip"

    def _judge(self, text: str) -> None:
        """Let the last line lack cells, and refuse any other."""
        if not self.wrong:
            return
        last = text.rstrip("\r\n").replace("\r\n", "\n").rpartition("\n")[2]
        first = self.wrong[0]
        self.cut = len(self.wrong) == 1 and first.text.strip() == last.strip()
        if self.cut and first.actual_columns < first.expected_columns:
            return
        lines = text.splitlines()
        where = next((f", line {n}" for n, line in enumerate(lines, 1) if line == first.text), "")
        raise SerpentError(
            f"{self.path}{where} has {counted(first.actual_columns, 'cell')} where the header names "
            f"{first.expected_columns} columns: {first.text[:60]!r}. Mend the line. {self.advice}".rstrip()
        )


def _without_blanks(text: str) -> bytes:
    """Lines whose cells one tab separates."""
    return re.sub(r"[ \t]+", "\t", re.sub(r"(?m)^[ \t]+|[ \t]+$", "", text)).encode()


def _is_short(raw: bytes, encoding: str, dialect: Dialect) -> bool:
    """Whether the last cell has fewer decimals than all others of its column, and no line ends there."""
    if raw.endswith((b"\n", b"\r")) or dialect.separator == BLANKS:
        return False
    tail = raw[-_HEAD:].decode(encoding, "replace").splitlines()[-_HEAD_LINES:]
    cells = [line.rpartition(dialect.separator)[2].strip() for line in tail[-50:]]
    *others, last = [_decimals(each, dialect.decimal) for each in cells]
    known = {each for each in others if each is not None}
    return len(known) == 1 and (last or 0) < max(known)


def _decimals(cell: str, decimal: str) -> int | None:
    """How many digits follow the decimal sign; None of what is no number."""
    found = re.fullmatch(rf"[+-]?\d*(?:{re.escape(decimal)}(\d*))?", cell)
    return None if found is None or not re.search(r"\d", cell) else len(found[1] or "")
