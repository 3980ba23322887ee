"""Lay out the options of a command's config in titled groups, as `--help` shows them."""

import ast
import inspect
import itertools
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, make_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import tyro

from serpent_twin.command_line.program import as_started

_UNSAID = (None, "", ())
"""Defaults that an option's own text explains"""


@dataclass(frozen=True)
class Group:
    """Annotates a field of a config: `--help` lists its options under `TITLE options`."""

    title: str


@dataclass(frozen=True)
class _Option:
    """One option, and where in the config its value belongs."""

    path: tuple[str, ...]
    """Names of the fields that lead to it"""
    kind: Any
    """Its type, as tyro reads it"""
    default: Any
    """`MISSING` for a required one"""
    group: str
    """Title of its group"""

    @property
    def name(self) -> str:
        """Name of the option as its flag has it, with underscores."""
        return self.path[-1]


def about(main: Callable[..., Any]) -> str:
    """The `--help` text of a command, a line a paragraph."""
    text = inspect.getdoc(_config_of(main) or main) or ""
    return as_started("\n\n".join(" ".join(paragraph.split()) for paragraph in text.split("\n\n")))


def grouped(main: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Wrap a command so that its config's options are in groups.

    Options without a group stand under `NAME options`, with what is said of the command besides its first
    paragraph.
    """
    kind = _config_of(main)
    if kind is None:
        plain = tyro.conf.configure(tyro.conf.DisallowNone)(main)
        plain.__doc__ = as_started(main.__doc__ or "")
        return plain
    first, _, rest = about(main).partition("\n\n")
    titles = {name: rest}
    options = list(_options(kind, titles, group=name))
    layout = _layout(options, titles)

    def command(config: Any) -> Any:
        values = {n: value for group in vars(config).values() for n, value in vars(group).items()}
        return main(_built(kind, {each.path: values[each.name] for each in options}))

    command.__doc__ = first
    command.__annotations__ = {"config": Annotated[layout, tyro.conf.arg(name="")]}
    return command


def _config_of(main: Callable[..., Any]) -> type | None:
    """The config dataclass that is a command's one argument, if there is one."""
    hints = get_type_hints(main)
    kinds = [hints.get(name) for name in inspect.signature(main).parameters]
    return kinds[0] if len(kinds) == 1 and is_dataclass(kinds[0]) else None  # type: ignore


def _options(
    kind: type, titles: dict[str, str], group: str, path: tuple[str, ...] = (), of: Any = MISSING
) -> Iterator[_Option]:
    """The options of a config and of the configs in it; `titles` gets what is said of each group."""
    said, hints = _said(kind), get_type_hints(kind, include_extras=True)
    for each in (each for each in fields(kind) if each.init):
        base, *extras = _unpacked(hints[each.name])
        default = _default(each) if of is MISSING else getattr(of, each.name)
        here = (*path, each.name)
        named = each.name.replace("_", " ") if is_dataclass(base) and not path else group
        title = next((extra.title for extra in extras if isinstance(extra, Group)), named)
        if is_dataclass(base):
            titles[title] = titles.get(title) or said.get(each.name, "")
            yield from _options(base, titles, title, here, default)  # type: ignore
        else:
            titles.setdefault(title, "")
            looks = tyro.conf.arg(
                help=said.get(each.name), help_behavior_hint="" if default in _UNSAID else None
            )
            refused = [tyro.conf.DisallowNone] if default is None else []
            yield _Option(here, Annotated[(base, looks, *refused, *extras)], default, title)  # type: ignore


def _unpacked(hint: Any) -> Sequence[Any]:
    return get_args(hint) if get_origin(hint) is Annotated else (hint,)


def _default(of: Field) -> Any:
    return of.default if of.default_factory is MISSING else of.default_factory()


def _said(kind: type) -> dict[str, str]:
    """The text under each field of a class, in one line."""
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    found = {}
    for one, two in itertools.pairwise(body.body if isinstance(body, ast.ClassDef) else []):
        match one, two:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(
                value=ast.Constant(value=str(text))
            ):
                found[name] = as_started(" ".join(text.split()))
    return found


def _layout(options: Sequence[_Option], titles: Mapping[str, str]) -> type:
    """A dataclass of dataclasses for tyro, one a group."""
    groups = []
    for n, (title, text) in enumerate(titles.items()):
        rows = [(o.name, o.kind, field(default=o.default)) for o in options if o.group == title]
        of = make_dataclass("Group", rows, kw_only=True)
        groups.append((f"group_{n}", Annotated[of, tyro.conf.arg(name=title, help=text)]))
    return make_dataclass("Groups", groups)


def _built(kind: type, values: Mapping[tuple[str, ...], Any]) -> Any:
    """A config out of its options' values by their paths."""
    found: dict[str, Any] = {}
    for each in (each for each in fields(kind) if each.init):
        inside = {path[1:]: value for path, value in values.items() if path[0] == each.name}
        nested = () not in inside
        base = _unpacked(get_type_hints(kind)[each.name])[0]
        found[each.name] = _built(base, inside) if nested else inside[()]
    return kind(**found)
