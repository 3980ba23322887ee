"""Split sessions into training, validation and test sets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.readouts.windows import Windows, cut
from serpent_twin.sessions import Session
from serpent_twin.tables.repeated import refuse_repeated


@dataclass(frozen=True)
class Split:
    """Sessions for training, validation and test."""

    train: list[Session]
    """Sessions to learn from"""
    validate: list[Session]
    """Sessions for early stopping and model selection"""
    test: list[Session]
    """Sessions to score on"""

    def windows(self, window: int, drop: int) -> tuple[Windows, Windows, Windows]:
        """Windows of H rows for training, validation and test."""
        return (
            cut(self.train, window, drop),
            cut(self.validate, window, drop),
            cut(self.test, window, drop),
        )

    def names(self) -> dict[str, list[str]]:
        """Names of the sessions of each set."""
        parts = {"train": self.train, "validate": self.validate, "test": self.test}
        return {part: [session.name for session in of] for part, of in parts.items()}

    def all(self) -> list[Session]:
        """All sessions."""
        return [*self.train, *self.validate, *self.test]


def refuse_unseen(train: Windows, validate: Windows, test: Windows) -> None:
    """Refuse windows in which a marker is never measured: it can be neither learned nor scored."""
    for part, windows in (("train", train), ("validate", validate), ("test", test)):
        seen = np.isfinite(windows.marker).all(axis=2).any(axis=0)
        enough = seen.any() if part == "test" else seen.all()
        if not enough:
            lost = ", ".join(str(n + 1) for n in np.flatnonzero(~seen))
            names = ", ".join(session.name for session in windows.sessions)
            raise SerpentError(
                f"Marker {lost}: lost in every row of the sessions that {part} ({names}), the first rows, "
                "which are dropped, left out. Give sessions that show all markers."
            )


def split(
    sessions: Sequence[Session], validate: Sequence[str] = (), test: Sequence[str] = ()
) -> Split:
    """Sessions for training, validation and test: the last is for test, one or two before it for validation.

    Sessions that repeat each other are refused.
    """
    by_name = {session.name: session for session in sessions}
    if unknown := [name for name in (*validate, *test) if name not in by_name]:
        raise SerpentError(
            f"there is no session {', '.join(unknown)}; there are {', '.join(by_name)}."
        )
    if both := set(validate) & set(test):
        raise SerpentError(
            f"{', '.join(sorted(both))} cannot both validate and test; name it once."
        )
    test = test or [name for name in by_name if name not in validate][-1:]
    rest = [name for name in by_name if name not in test]
    validate = validate or rest[-(2 if len(sessions) >= 6 else 1) :]
    train = [name for name in rest if name not in validate]
    if not (train and validate and test):
        raise SerpentError(
            f"{counted(len(sessions), 'session is', 'sessions are')} too few: at least one each must train, "
            f"validate and test. "
            "Collect three or more, or name fewer in --validate and --test."
        )
    refuse_repeated(sessions)
    return Split(*([by_name[name] for name in names] for names in (train, validate, test)))
