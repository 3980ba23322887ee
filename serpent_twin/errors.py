"""Define the errors that a command prints, with what the user can do."""

from serpent_twin.numerals import shortened


class SerpentError(Exception):
    """An error for the user: its text says what was found, where, and what to do.

    Very long numbers in it are shortened, as they say no more than their size.
    """

    def __init__(self, *said: object) -> None:
        super().__init__(*(shortened(each) if isinstance(each, str) else each for each in said))


class BusError(SerpentError):
    """The bus or a motor on it refused, and says which and what to do."""
