"""The configs of all commands and experiments, and their options."""

import functools
import importlib
import inspect
import typing
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from paths import ROOT

from serpent_twin.command_line.options import Checked

CODE = ("serpent_twin", "experiments", "benchmarks")
NEEDED = {
    "Check": {"logs": Path("logs")},
    "Diagnose": {"robot": Path("robot.xml"), "logs": (Path("logs"),)},
    "Plan": {"trace": Path("trace")},
    "Collect": {"out": Path("out")},
    "Estimate": {"model": Path("model"), "out": Path("out")},
    "Follow": {"path": Path("path.csv"), "twin": Path("twin.json"), "out": Path("out")},
    "FollowStudy": {"study": Path("study")},
    "ForceStudy": {"study": (Path("study"),)},
    "Measured": {"data": Path("data")},
    "Pushes": {"data": Path("data")},
    "Merge": {"logs": Path("logs"), "take": Path("take.csv")},
    "ShipTrace": {"trace": Path("trace")},
    "Sweep": {"out": Path("out")},
    "Trace": {"logs": Path("logs"), "out": Path("out")},
    "Train": {"logs": Path("logs"), "out": Path("out")},
}
"""What must be given, by the name of the config"""


@functools.cache
def mains() -> dict[str, Any]:
    """The functions that are run as commands, by module and name."""
    found = {}
    for path in sorted(p for folder in CODE for p in (ROOT / folder).rglob("*.py")):
        if "    cli.run(" not in path.read_text():
            continue
        inside = path.relative_to(ROOT).with_suffix("").parts
        module = importlib.import_module(".".join(inside))
        for name, value in vars(module).items():
            if inspect.isfunction(value) and (name == "main" or name.endswith("_command")):
                found[f"{'.'.join(inside)}:{name}"] = value
    return found


@functools.cache
def configs() -> dict[str, type[Checked]]:
    """The configs that these take, by name."""
    kinds = [hint for main in mains().values() for hint in typing.get_type_hints(main).values()]
    return {k.__name__: k for k in kinds if inspect.isclass(k) and issubclass(k, Checked)}


def made(kind: str, **given: Any) -> Any:
    """The config of that name, with what is given by option, however deep that lies."""
    return configs()[kind](**NEEDED.get(kind, {}) | _placed(configs()[kind], given))


def options(kind: type) -> Iterator[tuple[str, Any, Any]]:
    """Name, type and default of each option of a config, those of the dataclasses in it included."""
    hints = typing.get_type_hints(kind, include_extras=True)
    for each in fields(kind):
        inner = bare(hints[each.name])
        if is_dataclass(inner):
            yield from options(inner)
        else:
            made = each.default_factory
            yield each.name, hints[each.name], each.default if made is MISSING else made()


def bare(hint: Any) -> Any:
    """A type without what `Annotated` says of it."""
    return hint.__origin__ if typing.get_origin(hint) is Annotated else hint


def number(hint: Any) -> type | None:
    """Int or float, if that is what an option takes, or several of."""
    inside = [number(part) for part in typing.get_args(bare(hint))]
    return next((k for k in (bare(hint), *inside) if k in (int, float)), None)


def _placed(kind: type, given: dict[str, Any]) -> dict[str, Any]:
    """Values by field from those by option, with dataclasses made of what lies deeper."""
    hints = {
        name: bare(hint) for name, hint in typing.get_type_hints(kind, include_extras=True).items()
    }
    placed = {f.name: given[f.name] for f in fields(kind) if f.name in given}
    for each in fields(kind):
        if is_dataclass(hints[each.name]):
            before = each.default if each.default_factory is MISSING else each.default_factory()
            deeper = _placed(hints[each.name], given)
            if deeper:
                placed[each.name] = replace(before, **deeper)
    return placed
