"""Find the tables that make up each log in a folder: one a run, or several, such as states and commands."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from serpent_twin import tables
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed
from serpent_twin.tables import DataTable, lerobot

LEAVE_OUT = "Leave it out."


@dataclass(frozen=True)
class LogTables:
    """The tables of one log, the one with the most measured columns first."""

    name: str
    """Name of the log, if it is not its first file's: with the folder, where several files have one name"""
    tables: tuple[DataTable, ...]

    @property
    def path(self) -> Path:
        """Its first file."""
        return self.tables[0].path


def find(source: Path, needed: Sequence[str], measured: Sequence[str]) -> list[LogTables]:
    """The logs of a folder, by name (run_2 before run_10), or that of a file.

    Tables that have only some of the needed columns are put together. Raises a `SerpentError` that says what
    is missing where.
    """
    paths = table_paths(source)
    found = [tables.read(path, LEAVE_OUT) for path in paths]
    whole = [(each,) for each in found if _has(each, needed) == {*needed}]
    partial = [each for each in found if _has(each, needed) != {*needed}]
    several = whole + (together(source, partial, needed) if partial else [])
    ordered = [tuple(sorted(each, key=lambda one: -len(_has(one, measured)))) for each in several]
    ordered.sort(key=lambda each: tables.by_number(_within(each[0].path, source)))
    stems = Counter(tables.stem(each[0].path) for each in ordered)
    return [LogTables(_name(each[0].path, source, stems), each) for each in ordered]


def table_paths(source: Path) -> list[Path]:
    """The tables of a folder; if it has none, those of its subfolders."""
    if source.exists() and not source.is_dir():
        return [source]
    if not source.is_dir():
        raise SerpentError(
            f"There is no folder {source}, nor such a file. Name a log of the machine, or the folder of "
            "its logs."
        )
    data = lerobot.root_of(source)
    root = source / "data" if data == source.absolute() or data == source else source
    for several in (root.iterdir(), root.rglob("*")):
        files = [each for each in several if each.is_file() and not _hidden(each, source)]
        found = [each for each in files if tables.reads(each)]
        found = [each for each in found if not tables.is_plain(each)] or found
        if found:
            return sorted(found, key=lambda each: tables.by_number(_within(each, source)))
    known = f"{', '.join(tables.ENDINGS)}, texts also with .gz"
    other = next((each for each in sorted(files) if tables.ending(each)), None)
    there = f" {other} {tables.otherwise(other)}." if other else ""
    raise SerpentError(
        f"There is no table in {source} or its subfolders ({known}).{there} Name the folder with the "
        "machine's logs."
    )


def _hidden(path: Path, source: Path) -> bool:
    """Whether a file is in a folder that begins with a point, or describes a data set."""
    inside = path.relative_to(source).parts
    about = path.parent.name == "meta" and (path.parent / "info.json").is_file()
    return about or any(part.startswith(".") for part in inside)


def _within(path: Path, source: Path) -> str:
    return path.relative_to(source).as_posix() if path != source else path.name


def _name(path: Path, source: Path, stems: Counter[str]) -> str:
    """A log's name, with its folders if there are several of that name; nothing if it is its file's."""
    stem = tables.stem(path)
    if stems[stem] > 1:
        return Path(_within(path, source)).with_name(stem).as_posix()
    return "" if stem == path.stem else stem


def _has(table: DataTable, several: Sequence[str]) -> set[str]:
    return {name for name in several if name in table}


def together(
    source: Path, partial: Sequence[DataTable], needed: Sequence[str]
) -> list[tuple[DataTable, ...]]:
    """Tables that have some of the needed columns each, those of one run put together."""
    kinds: dict[frozenset[str], list[DataTable]] = {}
    for each in partial:
        kinds.setdefault(frozenset(_has(each, needed)), []).append(each)
    if {*needed} != {name for kind in kinds for name in kind} or frozenset() in kinds:
        odd = kinds.get(frozenset(), partial)[0]
        missing = next(name for name in needed if name not in odd)
        odd.column(missing, "Name the column in machine.toml as the log has it.")
    runs: dict[tuple[str, ...], list[DataTable]] = {}
    for several in kinds.values():
        others = [each for each in partial if each not in several]
        own = {word for word in _common(source, several) if word not in _common(source, others)}
        for each in several:
            words = tuple(word for word in _words(source, each) if word not in own)
            runs.setdefault(words, []).append(each)
    for several in runs.values():
        has = [name for each in several for name in _has(each, needed)]
        if {*has} != {*needed}:
            raise SerpentError(
                f"{listed(each.path.name for each in several)} in {source} lack"
                f"{'s' if len(several) == 1 else ''} {listed(n for n in needed if n not in has)}, and no "
                "other file's name says that it is of the same run. Name the files of a run alike, such as "
                "run_1_states.csv and run_1_commands.csv."
            )
        if twice := [name for name, count in Counter(has).items() if count > 1]:
            raise SerpentError(
                f"{listed(each.path.name for each in several)} in {source} all have {twice[0]!r}. Leave one "
                "of them out, or rename it."
            )
    return [tuple(each) for each in runs.values()]


def _words(source: Path, table: DataTable) -> list[str]:
    """The words and numbers of a file's name and folders."""
    path = Path(_within(table.path, source))
    name = path.with_name(tables.stem(path)).as_posix().lower()
    return [each for each in re.split(r"[^a-z0-9]+|(?<=[a-z])(?=\d)", name) if each]


def _common(source: Path, several: Sequence[DataTable]) -> set[str]:
    words = [{*_words(source, each)} for each in several]
    return set.intersection(*words) if words else set()
