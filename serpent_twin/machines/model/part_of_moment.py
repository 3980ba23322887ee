"""Show a moment of many things at one of them."""

from typing import Any, ClassVar, Protocol

from serpent_twin.arrays import Array


class OfPlaces(Protocol):
    """A moment whose arrays are (n, things, ...), of things that have names."""

    everywhere: ClassVar[frozenset[str]]
    """Names of its quantities that all places share, (n, 1)"""

    def column(self, quantity: str, place: str) -> int:
        """Which column of a quantity is of a place; raises a `SerpentError` where there is none."""
        ...


class PartOfMoment:
    """A moment at one place: its arrays are (n, 1, ...), and what is written there is written there."""

    def __init__(self, whole: OfPlaces, place: str) -> None:
        self.__dict__.update(whole=whole, place=place)

    def __getattr__(self, name: str) -> Any:
        """One column of the whole."""
        whole = self.__dict__["whole"]
        try:
            value = getattr(whole, name)
        except AttributeError as error:
            raise AttributeError(str(error), name=name, obj=self) from error
        return value if name in whole.everywhere else value[:, self._column(name)]

    def __setattr__(self, name: str, value: Array) -> None:
        changed = getattr(self.whole, name).copy()
        changed[:, self._column(name)] = value
        setattr(self.whole, name, changed)

    def _column(self, name: str) -> slice:
        at = self.whole.column(name, self.place)
        return slice(at, at + 1)
