"""How does a module become a command?"""

import os
import sys
from collections.abc import Callable, Mapping
from typing import Any

import tyro

from serpent_twin.errors import SerpentError
from serpent_twin.option_groups import grouped


def run(
    main: Callable[..., Any] | Mapping[str, Callable[..., Any]], argv: list[str] | None = None
) -> None:
    """Run `main` as a command: its signature is the command line, tyro's way.

    Several functions by name are subcommands, described by the docstring of the module run.
    A `SerpentError` or a full disk is printed as one sentence and exits 1, Ctrl-C exits 130;
    anything else is a defect of ours and keeps its traceback.
    """
    try:
        if callable(main):
            tyro.cli(
                grouped(main, _name(main)),
                args=argv,
                prog=_program(),
                config=(tyro.conf.OmitArgPrefixes,),
            )
        else:
            description = sys.modules["__main__"].__doc__
            commands = {name: grouped(each, name) for name, each in main.items()}
            tyro.extras.subcommand_cli_from_dict(
                commands,
                args=argv,
                prog=_program(),
                description=description,
                config=(tyro.conf.OmitArgPrefixes,),
            )
        sys.stdout.flush()  # so that a reader who left is noticed here
    except SerpentError as error:
        fail(" ".join([str(error), *getattr(error, "__notes__", ())]))
    except BrokenPipeError:  # the reader of our output, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        fail(_system_error(error))
    except KeyboardInterrupt:
        print(
            "\nStopped. What was written stays; the same command goes on from there.",
            file=sys.stderr,
        )
        sys.exit(130)


def fail(sentence: str) -> None:
    """Print an error to the user and leave with exit status 1."""
    print(f"error: {sentence}", file=sys.stderr)
    sys.exit(1)


def _program() -> str | None:
    """How the user starts the module run, such as `python -m serpent_twin.log`."""
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    return f"python -m {spec.name.removesuffix('.__main__')}" if spec else None


def _name(main: Callable[..., Any]) -> str:
    """What people call the command, such as `log`."""
    program = _program()
    return program.rpartition(".")[-1] if program else main.__name__


def _system_error(error: OSError) -> str:
    where = f" at {error.filename}" if error.filename else ""
    return (
        f"the system refused{where}: {error.strerror or error}. "
        "What was already written is kept; mend the cause and run the same command again."
    )
