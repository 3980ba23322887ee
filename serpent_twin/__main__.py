"""Run a command of this package, or list them: `python -m serpent_twin [COMMAND]`."""

import difflib
import importlib
import pkgutil
import runpy
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
        source = Path((find_spec(module.name) or __spec__).origin or "")
        if _is_run(source):
            yield module.name.removeprefix(prefix)


def _is_run(source: Path) -> bool:
    """Whether a file is that of a command: it guards what it does when it is run."""
    own = source == Path(__file__)
    return source.is_file() and not own and _GUARD in source.read_text(encoding="utf-8")


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
        "usage: python -m serpent_twin COMMAND [-h] [OPTIONS]",
        "",
    ]
    found = verbs()
    wide = 2 + max(map(len, found))
    for name, text in found.items():
        lines += textwrap.wrap(
            text, _WIDTH, initial_indent=f"  {name:<{wide}}", subsequent_indent=" " * (wide + 2)
        )
    return "\n".join(
        [*lines, "", "Each explains its options with --help. A dot may stand for the space."]
    )


def main(words: tuple[str, ...]) -> None:
    """Run the command that words name, such as `bus doctor --port x`, or print all commands."""
    if not words or words[0] in ("-h", "--help"):
        print(listing())
        return
    for n in (2, 1):
        if (name := _module(words[:n])) and len(words) >= n:
            sys.argv = [name, *words[n:]]
            runpy.run_module(name, run_name="__main__", alter_sys=True)
            return
    raise SerpentError(_unknown(words))


def _module(words: tuple[str, ...]) -> str:
    """The module that words name, parted by blanks or dots; nothing if none is a command."""
    parts = ".".join(words).split(".")
    place = Path(serpent_twin.__path__[0]).joinpath(*parts)
    sources = (place.with_suffix(".py"), place / "__main__.py")
    if not all(map(str.isidentifier, parts)) or not any(map(_is_run, sources)):
        return ""
    return ".".join((serpent_twin.__name__, *parts))


def _unknown(words: tuple[str, ...]) -> str:
    """An error that names the commands nearest to words that name none."""
    there, first = list(verbs()), words[0]
    near = [name for name in there if name.startswith(f"{first}.")]
    near = near or difflib.get_close_matches(first, there, n=1, cutoff=0.5)
    if not near:
        return f"there is no command {first!r}; `python -m serpent_twin` lists them."
    calls = " or ".join(f"python -m serpent_twin {each.replace('.', ' ')}" for each in near)
    return f"there is no command {shlex.join(words[:2])!r}. Try {calls}"


if __name__ == "__main__":
    cli.run(lambda: main(tuple(sys.argv[1:])), argv=[])
