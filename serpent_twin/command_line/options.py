"""Check the options of a command: numbers within their bounds, and none that the run would ignore."""

import functools
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass, replace
from math import isfinite
from numbers import Integral, Real
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from msgspec import Meta

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import number
from serpent_twin.stored import within
from serpent_twin.stored.words import expected

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

C = TypeVar("C", bound="DataclassInstance")
GIVEN, ABSENT = True, False
"""What `when` may want of an option that has no values of its own, such as a path."""


Port = Annotated[int, within(1, 65_535)]
Seed = Annotated[int, within(0, 2**63 - 1)]
Workers = Annotated[int, within(0, 1024)]
RateHz = Annotated[float, within(0.01, 100.0, "Hz")]
Sessions = Annotated[int, within(1, 10_000)]
Steps = Annotated[int, within(1, 10_000_000)]
"""Rows of a session: at 4 Hz these are 29 days and 6 GB."""


@dataclass(frozen=True)
class Use:
    """When a field, or a group of options in it, is used; for `Annotated`."""

    hindrance: Callable[[Any], str]
    """Why a run with the config would ignore what is given, as text after the flag; empty if it does not."""
    only: tuple[str, ...] = ()
    """The options of the group that this is about; all without."""
    but: tuple[str, ...] = ()
    """The options of the group that this is not about."""

    def about(self, name: str) -> bool:
        """Whether this is about an option of that name."""
        return name not in self.but and (not self.only or name in self.only)


def when(*, only: tuple[str, ...] = (), but: tuple[str, ...] = (), **wanted: Any) -> Use:
    """A field that is used only while other options of its config have these values.

    True is for a switch that is on, or an option that is given; False for one that is not.
    """

    def hindrance(config: Any) -> str:
        for name, value in wanted.items():
            found = getattr(config, name)
            flag = f"--{name.replace('_', '-')}"
            if value is ABSENT and found:
                return f"would be ignored beside {flag}: leave out one of them."
            if value is GIVEN and not found:
                off = _default(config, name) is True
                return (
                    f"would be ignored with --no-{flag[2:]}: leave out one of them."
                    if off
                    else f"is for {flag}, and this run is without: leave it out, or add {flag}."
                )
            if not isinstance(value, bool) and found != value:
                return (
                    f"is for {flag} {value}, and this run is {flag} {found}: leave it out, or add "
                    f"{flag} {value}."
                )
        return ""

    return Use(hindrance, only, but)


@dataclass(frozen=True)
class Option:
    """One option of a command."""

    name: str
    """Name of the option's field"""
    value: Any
    """Value of the option in this config"""
    default: Any
    """MISSING for one that must be given"""
    whole: bool
    """Whether its numbers are whole ones"""
    limits: tuple[Meta, ...]
    """Bounds of the option's number, or of each of its numbers: `within`"""
    uses: tuple[tuple[Use, Any], ...]
    """When it is used, each with the config that declares it"""

    @property
    def flag(self) -> str:
        """How the command line writes it."""
        off = self.value is False and self.default is True
        return f"--{'no-' * off}{self.name.replace('_', '-')}"

    def refuse_number(self, called: str) -> None:
        """Raise `SerpentError` for a number that is out of bounds, or is none; `called` is its name."""
        for each in _numbers(self.value):
            if (self.whole and not isinstance(each, Integral)) or not _within(each, self.limits):
                wanted = Annotated[(int if self.whole else float, *self.limits)]  # type: ignore
                raise SerpentError(f"{called} is {number(each)}; give {expected(wanted)}.")

    @property
    def given(self) -> bool:
        """Whether it is not as by default."""
        return self.default is MISSING or self.value != self.default

    @property
    def hindrance(self) -> str:
        """Why the run ignores it, as text after the flag; empty if it does not."""
        told = (use.hindrance(config) for use, config in self.uses if use.about(self.name))
        return next(filter(None, told), "")


class Checked:
    """A config that cannot be made of numbers out of bounds, or of options that would be ignored."""

    def __post_init__(self) -> None:
        for option in options_of(self):
            option.refuse_number(option.flag)
        for option in options_of(self):
            if option.given and (why := option.hindrance):
                raise SerpentError(f"{option.flag} {why}")


def options_of(config: Any) -> Iterator[Option]:
    """All options of a config dataclass, those of the dataclasses in it included."""
    return _options(config, defaults={}, inherited=())


def used_only(config: C) -> C:
    """Copy a config, with those of its own options that it ignores set to their defaults."""
    own = {each.name for each in fields(config)}
    ignored = {o.name: o.default for o in options_of(config) if o.given and o.hindrance}
    return replace(config, **{name: value for name, value in ignored.items() if name in own})


def check_arguments(function: Callable[..., Any], **values: Any) -> None:
    """Raise `SerpentError` for an argument that is out of the bounds that a function's signature has."""
    hints = typing.get_type_hints(function, include_extras=True)
    for name, value in values.items():
        said = list(_annotations(hints[name]))
        limits = tuple(one for one in said if isinstance(one, Meta))
        Option(name, value, MISSING, int in said, limits, ()).refuse_number(name)


@dataclass(frozen=True)
class _Declared:
    """Bounds and uses declared by the type of a field."""

    field: Field
    """The field"""
    nested: bool
    """Whether it is a dataclass, with options of its own"""
    whole: bool
    """Whether its numbers are whole ones"""
    limits: tuple[Meta, ...]
    """Their bounds"""
    uses: tuple[Use, ...]
    """When it is used"""


@functools.cache
def _declared(kind: type) -> list[_Declared]:
    hints = typing.get_type_hints(kind, include_extras=True)
    return [_declaration(each, hints[each.name]) for each in fields(kind)]


def _declaration(each: Field, hint: Any) -> _Declared:
    said = list(_annotations(hint))
    limits = tuple(one for one in said if isinstance(one, Meta))
    uses = tuple(one for one in said if isinstance(one, Use))
    bare = hint.__origin__ if typing.get_origin(hint) is Annotated else hint
    return _Declared(each, is_dataclass(bare), int in said, limits, uses)


def _options(
    config: Any, defaults: Mapping[str, Any], inherited: tuple[tuple[Use, Any], ...]
) -> Iterator[Option]:
    for each in _declared(type(config)):
        name = each.field.name
        value, default = getattr(config, name), defaults.get(name, _default_of(each.field))
        uses = (*inherited, *((use, config) for use in each.uses))
        if each.nested:
            known = {} if default is MISSING else vars(default)
            yield from _options(value, known, uses)
        else:
            yield Option(name, value, default, each.whole, each.limits, uses)


def _annotations(hint: Any) -> Iterator[Any]:
    """A type, the types in it, such as those of a tuple, and what `Annotated` says of each."""
    yield hint
    if typing.get_origin(hint) is Annotated:
        yield from hint.__metadata__
        yield from _annotations(hint.__origin__)
        return
    for part in typing.get_args(hint):
        yield from _annotations(part)


def _default_of(each: Field) -> Any:
    return each.default if each.default_factory is MISSING else each.default_factory()


def _default(config: Any, name: str) -> Any:
    return next(_default_of(each) for each in fields(config) if each.name == name)


def _numbers(value: Any) -> Iterator[Real]:
    if isinstance(value, list | tuple):
        for each in value:
            yield from _numbers(each)
    elif isinstance(value, Real) and not isinstance(value, bool):
        yield value


def _within(value: Any, limits: tuple[Meta, ...]) -> bool:
    if isinstance(value, float) and not isfinite(value):
        return False
    return all((m.ge is None or m.ge <= value) and (m.le is None or value <= m.le) for m in limits)
