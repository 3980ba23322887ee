"""Name the extra of this package that installs a dependency which not every user needs."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from serpent_twin.errors import SerpentError


@contextmanager
def requires(extra: str, purpose: str, more: str = "") -> Iterator[None]:
    """Import optional dependencies inside this: one that is missing is a `SerpentError` that names the extra.

    `purpose` is what needs it, as the subject of a sentence; `more` ends that sentence.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if str(error.name).startswith(__package__ or ""):
            raise
        raise _missing(str(error.name), extra, purpose, more) from None


def require(module: str, extra: str, purpose: str, more: str = "") -> None:
    """Raise that error if a module is not installed, which another process will import."""
    if find_spec(module) is None:
        raise _missing(module, extra, purpose, more)


def _missing(module: str, extra: str, purpose: str, more: str) -> SerpentError:
    return SerpentError(
        f"{purpose} needs {module.partition('.')[0]}: pip install 'serpent-twin[{extra}]'{more}."
    )
