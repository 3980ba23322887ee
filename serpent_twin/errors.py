"""What went wrong, said to the person who can mend it."""


class SerpentError(Exception):
    """An error for the user: its text says what was found, where, and what to do."""
