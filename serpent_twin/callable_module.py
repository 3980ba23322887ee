"""Let a module be called as the function of the same name that `robots` has."""

import importlib
import sys
from types import ModuleType
from typing import Any


class CallableModule(ModuleType):
    """A module of this package that is a command or a folder, and a function of the public API besides."""

    def __call__(self, *given: Any, **named: Any) -> Any:
        """Call the function of `robots` that has this module's name."""
        robots = importlib.import_module("serpent_twin.robots")
        return getattr(robots, self.__name__.rpartition(".")[-1])(*given, **named)


def make_callable(name: str) -> None:
    """Let a module that is imported, not run, be called."""
    if name != "__main__":
        sys.modules[name].__class__ = CallableModule
