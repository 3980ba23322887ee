"""Find how a text holds its table: encoding, separator, decimals, and the line that names the columns."""

import csv
import re
from dataclasses import dataclass
from itertools import pairwise

from serpent_twin.tables.times import is_time
from serpent_twin.units import TO_SI

_SEPARATORS = (",", ";", "\t", "|", " ")
BLANKS = " "
"""The separator where any number of blanks or tabs stands between columns"""
COMMENTS = ("#", "%", "//")
"""How a line begins that is no row"""
_EMPTY = {"", "nan", "na", "n/a", "null", "none", "-", "--"}
_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?|[+-]?inf")


class NoHeaderError(ValueError):
    """The lines have no header; says why."""


@dataclass(frozen=True)
class Dialect:
    """How a text holds its table."""

    separator: str
    decimal: str
    names: list[str]
    """Names of the columns; empty for one that has none"""
    units: list[str]
    """Units of the columns, if a line under the names has them; else empty"""
    skip: int
    """Lines before the first row"""


@dataclass(frozen=True)
class _Line:
    number: int
    """Number of the line, from 0"""
    cells: list[str]
    comment: bool

    @property
    def values(self) -> list[bool]:
        """Which cells are numbers or times."""
        return [bool(_NUMBER.fullmatch(each)) or is_time(each) for each in self.cells]

    @property
    def words(self) -> list[bool]:
        """Which cells are neither, nor empty."""
        return [
            not value and cell.lower() not in _EMPTY
            for value, cell in zip(self.values, self.cells, strict=True)
        ]


def find(lines: list[str]) -> Dialect:
    """The dialect of a text's first lines; raises a `NoHeaderError`."""
    several = [found for each in _SEPARATORS if (found := _with(lines, each))]
    several = [each for each in several if len(each.names) > 1 or each.separator == ","]
    if several:
        return max(several, key=lambda each: len(each.names))  # the first of equals
    rows = [_cells(line, ",") for line in lines if line.strip() and not _comment(line)]
    for one, other in pairwise(rows):
        if all(_Line(0, one, False).words) and any(_Line(0, other, False).values):
            raise NoHeaderError(
                f"its header names {len(one)} columns, and the row under it has {len(other)}. Mend the header"
            )
    if not rows:
        raise NoHeaderError("it is empty. Leave it out")
    if all(_Line(0, rows[0], False).words):
        raise NoHeaderError("it has no row of numbers under a header. Leave it out")
    raise NoHeaderError(
        "there is no header line. Write a first line that names the columns, such as t,goal,angle"
    )


def _with(lines: list[str], separator: str) -> Dialect | None:
    """The dialect with a separator, if a line names columns of numbers under it."""
    split = [
        _Line(n, _cells(_bare(line), separator), _comment(line))
        for n, line in enumerate(lines)
        if line.strip()
    ]
    found = [
        n
        for n, (one, other) in enumerate(pairwise(split))
        if not other.comment and _is_header(one, other)
    ]
    if not found:
        return None
    n = next((each for each in found if _goes_on(split[each + 1 :])), found[0])
    one, other = split[n : n + 2]
    names, units = one, list[str]()
    above = split[n - 1] if n else one
    if n and _are_units(one.cells) and len(above.cells) == len(one.cells) and all(above.words):
        names, units = above, [each.strip("[]() ") for each in one.cells]
    cells = [each for line in split[n + 1 :] if not line.comment for each in line.cells]
    commas = separator != "," and any(re.fullmatch(r"[+-]?\d*,\d+(?:[eE].*)?", c) for c in cells)
    points = any(re.fullmatch(r"[+-]?\d*\.\d+(?:[eE].*)?", each) for each in cells)
    padded = names.cells + [""] * (len(other.cells) - len(names.cells))
    decimal = "," if commas and not points else "."
    return Dialect(separator, decimal, padded, units, other.number)


def _is_header(one: _Line, other: _Line) -> bool:
    """Whether a line names what the next one holds."""
    more = len(other.cells) - len(one.cells)
    if more and not (more == 1 and not other.cells[-1]):  # a separator at the end of each row
        return False
    pairs = zip(one.words, other.words, strict=False)
    named = any(word and not text for word, text in pairs)
    return named and any(other.values) and not any(one.values)


def _goes_on(rows: list[_Line]) -> bool:
    """Whether a second row is as the first: a pair of a name and a value above the table is not."""
    first, *others = [each for each in rows if not each.comment]
    if len(others) < 2:
        return True
    return len(others[0].cells) == len(first.cells) and any(others[0].values)


def _are_units(cells: list[str]) -> bool:
    return all(each.strip("[]() ") in {*TO_SI, "", "-"} for each in cells)


def _comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def _bare(line: str) -> str:
    """A line without what makes it a comment."""
    return re.sub(r"^\s*(?:[#%]+|//)\s*", "", line)


def _cells(line: str, separator: str) -> list[str]:
    text = line.strip("\r\n")
    if separator == BLANKS:
        return text.split()
    cells = next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
    return [each.strip().strip("\"'").strip() for each in cells]
