"""Make a command of a module."""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tyro
from threadpoolctl import threadpool_limits
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from serpent_twin.command_line.option_groups import grouped
from serpent_twin.command_line.program import as_started
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import shortened

_LONGEST = 255
"""Letters of a file's name"""


def run(
    main: Callable[..., Any] | Mapping[str, Callable[..., Any]],
    argv: list[str] | None = None,
    error_status: int = 1,
) -> None:
    """Run `main` as a command: its signature is the command line, tyro's way.

    Several functions by name are subcommands, described by the docstring of the module run.
    A `SerpentError` or a full disk is printed as one sentence and exits with `error_status`, 1 but for
    commands whose answer is a status; Ctrl-C exits 130; anything else is a defect of ours and keeps its
    traceback.
    """
    _open_streams()
    argv = sys.argv[1:] if argv is None else argv
    how: Any = {"args": argv, "prog": _program(), "registry": _numbers(argv)}
    how["config"] = (tyro.conf.OmitArgPrefixes,)
    try:
        with threadpool_limits(1, "blas"):  # with small matrices, threads only wait for busy cores
            if callable(main):
                tyro.cli(grouped(main, _name(main)), **how)
            else:
                description = sys.modules["__main__"].__doc__
                commands = {name: grouped(each, name) for name, each in main.items()}
                tyro.extras.subcommand_cli_from_dict(commands, description=description, **how)
            sys.stdout.flush()  # so that a closed pipe is noticed here
    except SerpentError as error:
        fail(" ".join([str(error), *getattr(error, "__notes__", ())]), error_status)
    except BrokenPipeError:  # the reader of our output, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        fail(_system_error(error), error_status)
    except KeyboardInterrupt:
        print(
            "\nStopped. What was written stays; the same command goes on from there.",
            file=sys.stderr,
        )
        sys.exit(130)


def fail(sentence: str, status: int = 1) -> None:
    """Print an error to the user and leave with an exit status."""
    print(f"error: {shortened(as_started(sentence))}", file=sys.stderr)
    sys.exit(status)


def _open_streams() -> None:
    """Lead standard streams that were closed to nowhere: the next file opened would take their place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
            setattr(sys, name, open(number, "r" if number == 0 else "w", closefd=False))  # noqa: SIM115


def _module() -> str | None:
    """The module run, such as `serpent_twin.log`."""
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    return spec.name.removesuffix(".__main__") if spec else None


def _program() -> str | None:
    """How the user starts the module run, such as `python -m serpent_twin.log`."""
    module = _module()
    return as_started(f"python -m {module}") if module else None


def _name(main: Callable[..., Any]) -> str:
    """What people call the command, such as `log`."""
    module = _module()
    return module.rpartition(".")[-1] if module else main.__name__


def _numbers(argv: Sequence[str]) -> ConstructorRegistry:
    """Parse numbers of a command line, with this package's error messages instead of Python's."""
    registry = ConstructorRegistry()

    @registry.primitive_rule
    def number(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec | None:
        kind = next((kind for kind in (int, float) if info.type in (kind, kind | None)), None)
        if kind is None:
            return None

        def read(words: list[str]) -> float:
            try:
                return kind(words[0])
            except ValueError:
                if _is_path(words[0]):
                    raise  # of an option that takes files, too
                what = "a whole number" if kind is int else "a number"
                raise SerpentError(
                    f"{_flag(words[0], argv)} is {words[0]!r}; give {what}."
                ) from None

        return PrimitiveConstructorSpec(
            nargs=1,
            metavar=kind.__name__.upper(),
            instance_from_str=read,
            is_instance=lambda value: value is None or isinstance(value, int | float),
            str_from_instance=lambda value: [str(value)],
        )

    return registry


def _is_path(word: str) -> bool:
    path = Path(word)
    named = len(path.parts) > 1 or path.suffix[1:2].isalpha()
    return named or (len(word) < _LONGEST and path.exists())


def _flag(word: str, argv: Sequence[str]) -> str:
    """The option of a command line to which a word belongs."""
    flag = "it"
    for each in argv:
        if each.startswith("--"):
            flag = each.partition("=")[0]
        if each == word or each.endswith(f"={word}"):
            return flag
    return flag


def _system_error(error: OSError) -> str:
    where = f" at {error.filename}" if error.filename else ""
    return (
        f"the system refused{where}: {error.strerror or error}. "
        "What was already written is kept; mend the cause and run the same command again."
    )
