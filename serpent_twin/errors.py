"""What went wrong, said to the person who can mend it."""

import re
from decimal import Decimal
from typing import Any

_LONG = 24
"""Digits from which a number in an error is shortened; hashes, times in ns and the like have less."""


class SerpentError(Exception):
    """An error for the user: its text says what was found, where, and what to do.

    Very long numbers in it are shortened, as they say no more than their size.
    """

    def __init__(self, *said: object) -> None:
        super().__init__(*(shortened(each) if isinstance(each, str) else each for each in said))


class BusError(SerpentError):
    """The bus or a motor on it refused, and says which and what to do."""


def number(value: Any) -> str:
    """A number as an error shows it, also one that is too large for a float."""
    if isinstance(value, int) and abs(value) < 10**15:
        return str(value)
    return f"{Decimal(value):.3g}" if isinstance(value, int) else f"{value:.6g}"


def shortened(text: str) -> str:
    """A text with very long numbers in it cut short."""
    return re.sub(rf"\d{{{_LONG},}}", lambda m: f"{m[0][:6]}… ({len(m[0])} digits)", text)
