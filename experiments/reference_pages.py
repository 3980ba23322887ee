"""Write the pages of docs/reference/ that list the keys of machine.toml and map.toml, from their schemas."""

import ast
import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
from msgspec import inspect as schema

from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.exchange.map_file import Follows, Map, MappedField, MappedPoint, MappedStream
from serpent_twin.machines.model.description import (
    Description,
    DriveColumn,
    KnownNumber,
    MeasuredColumns,
    TimeColumn,
    Uncertain,
)
from serpent_twin.machines.model.numbers import NUMBERS, NumberKind
from serpent_twin.runs.files import write_whole
from serpent_twin.units import TO_SI

REFERENCE = Path(__file__).resolve().parents[1] / "docs" / "reference"
_HEAD = "Written by `python -m experiments.reference_pages` from the schema that reads the file.\n"
_KEYS = "| key | type | default | meaning |\n| --- | --- | --- | --- |"
_NUMBERS = "| number | of | unit | fitted by default | prior |\n| --- | --- | --- | --- | ---: |"
MACHINE = {
    "Keys of the file": Description,
    "time": TimeColumn,
    "[[drive]]": DriveColumn,
    "[[measured]]": MeasuredColumns,
    "[[uncertain]]": Uncertain,
    "[[known]]": KnownNumber,
}
"""Headings of the page on machine.toml, and the form that each lists"""
MAP = {
    "Keys of the file": Map,
    "[[stream]]": MappedStream,
    "follows": Follows,
    "fields": MappedField,
    "[[stream.points]]": MappedPoint,
}
"""Headings of the page on map.toml, and the form that each lists"""


@dataclass(frozen=True)
class ReferencePages(Checked):
    """Write docs/reference/machine-toml.md and docs/reference/map-toml.md from their schemas."""


def main(config: ReferencePages) -> None:  # noqa: D103 tyro would print it above the config's own
    for name, text in pages().items():
        write_whole(REFERENCE / name, text)
        print(REFERENCE / name)


def pages() -> dict[str, str]:
    """The text of each generated page, by its file's name."""
    return {"machine-toml.md": _machine_page(), "map-toml.md": _map_page()}


def _machine_page() -> str:
    about = (
        "`machine.toml` lies beside a robot's model and says which columns of a log drive the model, and "
        "which columns it is compared with. [Describe a machine](../describe-a-machine.md) shows how to "
        "write one.\n"
    )
    numbers = (
        "## Numbers of a model\n\nPriors are standard deviations of the logarithm of the ratio to the "
        "model's number; that of an *added* number is in its own unit, of a slide in mm in place of °. By "
        "default, calibration fits only what is not zero in the model.\n"
    )
    rows = "\n".join(_number_rows())
    return "\n".join(
        [
            "# Keys of machine.toml\n",
            about,
            _HEAD,
            *_tables(MACHINE),
            _units(),
            numbers,
            _NUMBERS,
            rows,
            "",
        ]
    )


def _map_page() -> str:
    about = (
        "`map.toml` says which fields of a recording become which columns of a log. "
        "[Bring logs in](../bring-logs-in.md) shows how to write one.\n"
    )
    return "\n".join(["# Keys of map.toml\n", about, _HEAD, *_tables(MAP), _units()])


def _tables(forms: dict[str, type[msgspec.Struct]]) -> Iterator[str]:
    for heading, form in forms.items():
        code = f"`{heading}`" if heading != "Keys of the file" else heading
        yield f"## {code}\n\n{_first_line(form)}\n\n{_KEYS}"
        yield "\n".join(_key_row(form, each) for each in schema.type_info(form).fields) + "\n"


def _first_line(form: type) -> str:
    return (inspect.getdoc(form) or "").partition("\n\n")[0]


def _key_row(form: type, key: Any) -> str:
    meaning = " ".join(_meanings(form)[key.name].split())
    cells = (f"`{key.encode_name}`", _kind(key.type), _default(key), meaning)
    return f"| {' | '.join(cells)} |"


@cache
def _meanings(form: type) -> dict[str, str]:
    """The docstring under each field of a form, those of its bases included."""
    found: dict[str, str] = {}
    for base in reversed(form.__mro__):
        if issubclass(base, msgspec.Struct) and base.__struct_fields__:
            found |= _own_meanings(base)
    return found


def _own_meanings(form: type) -> dict[str, str]:
    (body,) = (
        each.body
        for each in ast.parse(inspect.getsource(form)).body
        if isinstance(each, ast.ClassDef)
    )
    return {
        field.target.id: text.value.value
        for field, text in pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
    }


def _kind(kind: Any) -> str:
    """A type of the schema in words."""
    if isinstance(kind, schema.Metadata):
        unit = (kind.extra_json_schema or {}).get("title", "")
        return f"{_kind(kind.type)} [{unit}]" if unit else _kind(kind.type)
    if isinstance(kind, schema.UnionType):
        return " or ".join(
            _kind(each) for each in kind.types if not isinstance(each, schema.NoneType)
        )
    if isinstance(kind, schema.LiteralType):
        few = [f'"{each}"' if isinstance(each, str) else str(each) for each in kind.values]
        return " or ".join(few) if len(few) < 4 else _LISTED[kind.values]
    if isinstance(kind, schema.VarTupleType):
        return _list(kind)
    if isinstance(kind, schema.StructType):
        return "table"
    return _WORDS[type(kind)]


def _list(kind: Any) -> str:
    item = _kind(kind.item_type)
    fixed = f"{kind.min_length} " if kind.min_length and kind.min_length == kind.max_length else ""
    return f"list of {fixed}{item}s" if not item.startswith("list") else f"list of {fixed}lists"


_WORDS = {
    schema.StrType: "text",
    schema.IntType: "whole number",
    schema.FloatType: "number",
    schema.BoolType: "true or false",
    schema.DictType: "table",
}


class _Lists(dict[tuple[Any, ...], str]):
    """What the values of a literal are called."""

    def __missing__(self, values: tuple[Any, ...]) -> str:
        return "unit" if set(values) <= set(TO_SI) else "number of a model"


_LISTED = _Lists()


def _default(key: Any) -> str:
    if key.required:
        return "required"
    value = key.default_factory() if key.default is msgspec.NODEFAULT else key.default
    if value is None or value in ("", (), {}):
        return ""
    return f"`{_in_toml(value)}`"


def _in_toml(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_in_toml, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _units() -> str:
    names = ", ".join(f"`{unit}`" for unit in TO_SI)
    about = "`1` is that of a control such as a current."
    return f"## Units\n\nA unit is one of {names}. {about}\n"


def _number_rows() -> Iterator[str]:
    """A row for each kind of number; along three axes, one for all that are alike."""
    rows = {name: _number_row("{}", kind) for name, kind in NUMBERS.items()}
    alike: dict[tuple[str, str], list[str]] = {}
    for name, row in rows.items():
        of = re.sub(r" [xyz]{1,2}$", "", name)
        alike.setdefault((of, row), []).append(name)
    for (_, row), names in alike.items():
        axes = "".join(f", `{name.split()[-1]}`" for name in names[1:])
        yield row.replace("`{}`", f"`{names[0]}`{axes}")


def _number_row(name: str, kind: NumberKind) -> str:
    if not kind.uncertain:
        return f"| `{name}` | {kind.of} | {kind.unit} | `[[known]]` alone | |"
    prior = f"{kind.prior:g} {kind.unit}" if kind.added else f"{kind.prior:g}"
    added = ", added" if kind.added else ""
    otherwise = "torque" if kind.held else "no"
    fitted = (
        ("yes" if kind.at_rest else "in motion") if kind.fitted and not kind.added else otherwise
    )
    return f"| `{name}` | {kind.of} | {kind.unit}{added} | {fitted} | {prior} |"


if __name__ == "__main__":
    cli.run(main)
