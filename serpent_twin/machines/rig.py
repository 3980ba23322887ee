"""Define what a kind of machine must provide: how its logs are read, and first guesses."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from serpent_twin.arrays import Array

if TYPE_CHECKING:
    from serpent_twin.machines.case import Case


class Log(Protocol):
    """One recording of a machine."""

    @property
    def path(self) -> Path | None:
        """The file that it came from."""
        ...

    @property
    def name(self) -> str:
        """Its name in reports."""
        ...

    @property
    def metadata(self) -> Mapping[str, Any]:
        """The recorder's metadata."""
        ...

    @property
    def readings(self) -> Array:
        """What the machine's own sensors read, row by row, (T, N)."""
        ...


class Rig(Protocol):
    """One kind of machine, and its logs."""

    name: str
    """Its name on the command line"""
    about: str
    """A description for the command line's help"""

    def read(self, folder: Path) -> Sequence[Log]:
        """A folder's sessions; raises a `SerpentError` on logs that are not of this machine."""
        ...

    def open(self, training: Sequence[Any]) -> "Case[Any]":
        """First guesses out of training logs."""
        ...
