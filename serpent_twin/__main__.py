"""Run or list the commands of this package: `serpent-twin`, `python -m serpent_twin`."""

import difflib
import runpy
import shlex
import sys
import textwrap
from pathlib import Path

import serpent_twin
from serpent_twin.command_line import cli, program
from serpent_twin.command_line.verbs import is_command, verbs
from serpent_twin.errors import SerpentError

_WIDTH = 79


def listing() -> str:
    """The commands, a paragraph each, and how to call one."""
    lines = [
        str(serpent_twin.__doc__),
        "",
        f"usage: {program.package()} COMMAND [-h] [OPTIONS]",
        f"begin with: {program.package()} diagnose robot.xml logs/*.csv",
        "",
    ]
    found = verbs()
    wide = 2 + max(map(len, found))
    for name, text in found.items():
        lines += textwrap.wrap(
            text,
            _WIDTH,
            initial_indent=f"  {name:<{wide}}",
            subsequent_indent=" " * (wide + 2),
            break_on_hyphens=False,
        )
    return "\n".join(
        [*lines, "", "Each explains its options with --help. A dot may stand for the space."]
    )


def main(words: tuple[str, ...]) -> None:
    """Run the command that words name, such as `bus doctor --port x`, or print all commands."""
    if not words or words[0] in ("-h", "--help"):
        print(listing())
        return
    if words == ("--version",):
        print(f"{program.CONSOLE} {serpent_twin.__version__}")
        return
    for n in (2, 1):
        if (name := _module(words[:n])) and len(words) >= n:
            with program.started_by(program.package()):
                sys.argv = [name, *words[n:]]
                runpy.run_module(name, run_name="__main__", alter_sys=True)
            return
    raise SerpentError(_unknown(words))


def _module(words: tuple[str, ...]) -> str:
    """The module that words name, parted by blanks or dots; nothing if none is a command."""
    parts = ".".join(words).split(".")
    place = Path(serpent_twin.__path__[0]).joinpath(*parts)
    sources = (place.with_suffix(".py"), place / "__main__.py")
    if not all(map(str.isidentifier, parts)) or not any(map(is_command, sources)):
        return ""
    return ".".join((serpent_twin.__name__, *parts))


def _unknown(words: tuple[str, ...]) -> str:
    """An error that names the commands nearest to words that name none."""
    there, first = list(verbs()), words[0]
    inside = [name for name in there if name.startswith(f"{first}.")]
    near = inside or difflib.get_close_matches(first, there, n=1, cutoff=0.6)
    if not near:
        return f"there is no command {first!r}; `{program.package()}` lists them."
    calls = " or ".join(f"{program.package()} {each.replace('.', ' ')}" for each in near)
    return f"there is no command {shlex.join(words[: 2 if inside else 1])!r}. Try {calls}"


def start() -> None:
    """Run what the command line says: the installed script's entry."""
    cli.run(lambda: main(tuple(sys.argv[1:])), argv=[])


if __name__ == "__main__":
    start()
