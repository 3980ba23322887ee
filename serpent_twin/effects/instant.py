"""Define what effects and laws do with one time step of runs: read it, and change what is used of it."""

from collections.abc import Callable, Mapping, Sequence
from types import MethodType
from typing import Any, ClassVar, Self

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import FORCES, HANDLES, POSITIONS, SPRING, Law
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed

_WHEN_READ = "_when_read"
_NOTHING: Mapping[str, Any] = {}


class Instant:
    """A moment whose writable fields are those that its simulation uses; changing others is an error.

    Its arrays are (n, things, …), of n runs and of things that `names` has by their kind.
    """

    given: ClassVar[frozenset[str]] = frozenset()
    """Names of the fields that effects read and do not change"""
    everywhere: ClassVar[frozenset[str]] = frozenset({"dt", "time", "prior_runtime"})
    """Names of the fields that all things share, (n, 1)"""
    followed: ClassVar[tuple[str, ...]] = ()
    """What laws follow here besides clocks, of `law.READINGS`"""
    changed: ClassVar[tuple[str, ...]] = ()
    """What laws change here, of `law.HANDLES`"""
    held_as: ClassVar[Mapping[str, str]] = {}
    """The fields of those quantities that have another name here"""
    kinds: ClassVar[Mapping[str, str]] = {}
    """Kind of thing that each field is of"""
    usual_kind: ClassVar[str] = ""
    """Kind of thing of the fields that `kinds` lacks"""
    has_places: ClassVar[bool] = False
    """Whether effects may be at one thing"""

    names: Mapping[str, Sequence[str]]
    """Names of the things of each kind"""
    time: Array
    """Time since the session began [s], (n, 1)"""
    prior_runtime: Any
    """Time from the beginning of the log to that of the session [s], a scalar or (n, 1)"""

    @classmethod
    def of(cls, when_read: Mapping[str, Callable[[Any], Any]] = _NOTHING, **fields: Any) -> Self:
        """An instant of some fields, and of others that are computed when they are read first, from the
        instant. One is made for every time step, of which effects read little.
        """
        instant = object.__new__(cls)
        own = instant.__dict__
        own.update(fields)
        own[_WHEN_READ] = when_read
        instant.__post_init__()
        return instant

    def __post_init__(self) -> None:
        own = self.__dict__
        for name in own.keys() & self.given:
            own[name] = read_only(own[name])

    def __getattr__(self, name: str) -> Any:
        """A field that nobody has read yet."""
        computed = self.__dict__.get(_WHEN_READ, _NOTHING).get(name)
        if computed is None:
            told = f"{type(self).__name__!r} object has no attribute {name!r}"
            raise AttributeError(told, name=name, obj=self)
        value = computed(self)
        self.__dict__[name] = value = read_only(value) if name in self.given else value
        return value

    def now(self, name: str) -> Any:
        """A field for reading alone: if no effect has changed it, the simulation need not write it."""
        own = self.__dict__
        return own[name] if name in own else own[_WHEN_READ][name](self)

    def whole(self) -> Self:
        """The instant with every field computed, so that it may be read when its simulation has gone on."""
        for name in self.__dict__.get(_WHEN_READ, _NOTHING):
            getattr(self, name)
        return self

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.given:
            there = {**self.__dict__, **self.__dict__.get(_WHEN_READ, _NOTHING)}
            if name in there:
                free = [n for n in there if n not in self.given and n != _WHEN_READ]
                raise SerpentError(
                    f"{name} cannot be changed by an effect here: the simulation would not honour it. "
                    f"Effects change {', '.join(free)}."
                )
        object.__setattr__(self, name, value)

    def reading_of(self, law: Law) -> Array:
        """What a law follows, (n, 1); of a constant, zeros."""
        if (clock := law.clock(self.time, self.prior_runtime)) is not None:
            return clock
        if law.reading not in self.followed:
            there = listed([*self.followed, "time", "runtime"])
            raise SerpentError(f"no law follows the {law.depends_on} here; there are: {there}.")
        return self.follow(law.reading, law.where)

    def change(self, law: Law, sizes: Sequence[Array | float]) -> None:
        """Change what a law changes, by sizes (n, 1) of each component."""
        if law.handle not in self.changed:
            there = listed(self.changed)
            raise SerpentError(f"no law changes {law.handle} here; there are: {there}.")
        if len(sizes) == 1:
            self.add(law.handle, law.place, np.asarray(sizes[0]))
            return
        size = np.empty((len(self.time), len(sizes)))
        for n, each in enumerate(sizes):
            size[:, n : n + 1] = each
        self.add(law.handle, law.place, size)

    def follow(self, reading: str, place: str) -> Array:
        """A quantity at a place, (n, 1)."""
        at = self.column(reading, place)
        if reading in POSITIONS:
            return self.position(at)[:, POSITIONS.index(reading), None]
        return getattr(self, self._held(reading))[:, at : at + 1]

    def add(self, handle: str, place: str, size: Array) -> None:
        """Add a size, (n, components), to a quantity at a place."""
        at, field = self.column(handle, place), self._held(handle)
        changed = np.zeros((len(self.time), len(self.names[self._kind(field)]))) + getattr(
            self, field
        )
        changed[:, at : at + 1] += size
        setattr(self, field, np.maximum(changed, 0.0) if HANDLES[handle].only_more else changed)

    def position(self, body: int) -> Array:
        """Where a body is, as laws follow it [m], (n, 3)."""
        raise NotImplementedError

    def at(self, place: str) -> Any:
        """The moment of one thing alone, arrays (n, 1), or of all that an effect without a place is at;
        raises a `SerpentError` where effects have no place.
        """
        if not place:
            return self
        if not self.has_places:
            told = f"an effect at {place!r} cannot act on this machine. Leave out its place."
            raise SerpentError(told)
        return MomentAtPlace(self, place)

    def where(self, quantity: str, place: str) -> tuple[Any, ...]:
        """The index of a place in a quantity."""
        at = self.column(quantity, place)
        return slice(None), slice(at, at + 1)

    def column(self, quantity: str, place: str) -> int:
        """Which column of a quantity is of a place; raises a `SerpentError` that lists the places."""
        kind = self._kind(field := self._held(quantity))
        if place not in (names := self.names[kind]):
            article = "an" if kind[0] in "aeiou" else "a"
            raise SerpentError(
                f"it needs {field} of {article} {kind}, and {place!r} is none; there are: "
                f"{listed(dict.fromkeys(names)) or 'none'}."
            )
        return list(names).index(place)

    def _held(self, quantity: str) -> str:
        return self.held_as.get(quantity, quantity)

    def _kind(self, field: str) -> str:
        return self.kinds.get(field, self.usual_kind)


def read_only(value: Any) -> Any:
    """A view of an array that cannot be written to; what is no array, or is read-only, as it is."""
    if not isinstance(value, np.ndarray) or not value.flags.writeable:
        return value
    view = value.view()
    view.setflags(write=False)
    return view


class MomentAtPlace:
    """A moment at one place, or at all places of an effect: its arrays are (n, 1, …) or (n, places, …), and
    what is written here is written there.
    """

    def __init__(self, whole: Instant, place: str) -> None:
        self.__dict__.update(whole=whole, place=place)

    def __getattr__(self, name: str) -> Any:
        """What the whole has at the place."""
        whole = self.__dict__["whole"]
        try:
            value: Any = getattr(whole, name)
        except AttributeError as error:
            raise AttributeError(str(error), name=name, obj=self) from error
        if name in whole.everywhere:
            return value
        where = whole.where(name, self.place)
        if not isinstance(value, MethodType):
            return value[where]
        return lambda *given: value(*given)[where]

    def __setattr__(self, name: str, value: Array) -> None:
        if name in self.whole.everywhere:
            setattr(self.whole, name, value)
            return
        changed = getattr(self.whole, name).copy()
        changed[self.whole.where(name, self.place)] = value
        setattr(self.whole, name, changed)


def force_on(handle: str, size: Array, rotation: Array, middle: Array) -> Array:
    """The force on a body in the base frame [N], (n, 3), by the components of one of `FORCES`, of a body
    that is turned, (n, 3, 3), and whose centre of mass is there [m], (n, 3).
    """
    assert handle in FORCES
    if handle == SPRING:
        return size[:, :3] - size[:, 3:] * middle
    return np.einsum("nxy,ny->nx", rotation, size) if handle == "force_in_body" else size
