"""What went wrong, said to the person who can mend it."""


class SerpentError(Exception):
    """An error for the user: its text says what was found, where, and what to do."""


class BusError(SerpentError):
    """The bus or a motor on it refused, and says which and what to do."""
