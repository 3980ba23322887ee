"""List the commands of this package: `python -m serpent_twin`."""

import difflib
import importlib
import pkgutil
import shlex
import sys
import textwrap
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import serpent_twin
from serpent_twin.command_line import cli
from serpent_twin.command_line.option_groups import about
from serpent_twin.errors import SerpentError

_GUARD = 'if __name__ == "__main__":\n'
_WIDTH = 79


def verbs() -> dict[str, str]:
    """What each command's `--help` says first, by the module that is run."""
    return {name.removesuffix(".__main__"): _first(name) for name in sorted(_runnable())}


def _runnable() -> Iterator[str]:
    """Names of the modules that are commands, within the package."""
    prefix = f"{serpent_twin.__name__}."
    for module in pkgutil.walk_packages(serpent_twin.__path__, prefix):
        source = (find_spec(module.name) or __spec__).origin or ""
        if source != __file__ and _GUARD in Path(source).read_text(encoding="utf-8"):
            yield module.name.removeprefix(prefix)


def _first(name: str) -> str:
    module = importlib.import_module(f"{serpent_twin.__name__}.{name}")
    main: Callable[..., object] | None = getattr(module, "main", None)
    text = about(main) if main else module.__doc__ or ""
    return text.partition("\n")[0]


def listing() -> str:
    """The commands, a paragraph each, and how to call one."""
    lines = [
        str(serpent_twin.__doc__),
        "",
        "usage: python -m serpent_twin.COMMAND [-h] [OPTIONS]",
        "",
    ]
    found = verbs()
    wide = 2 + max(map(len, found))
    for name, text in found.items():
        lines += textwrap.wrap(
            text, _WIDTH, initial_indent=f"  {name:<{wide}}", subsequent_indent=" " * (wide + 2)
        )
    return "\n".join([*lines, "", "Each explains its options with --help."])


def main(words: tuple[str, ...]) -> None:
    """Print the commands; words on the line are answered by how to call what they mean."""
    if not words or words[0] in ("-h", "--help"):
        print(listing())
        return
    for n in (2, 1):  # such as `bus doctor`
        name, options = ".".join(words[:n]), words[n:]
        if near := difflib.get_close_matches(name, verbs(), n=1, cutoff=(1, 0.5)[n == 1]):
            call = shlex.join(["python", "-m", f"serpent_twin.{near[0]}", *options])
            raise SerpentError(f"a command follows a dot, without a space: {call}")
    raise SerpentError(f"there is no command {words[0]!r}; `python -m serpent_twin` lists them.")


if __name__ == "__main__":
    cli.run(lambda: main(tuple(sys.argv[1:])), argv=[])
