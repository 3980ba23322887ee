"""Write numbers and lists for a reader: counted nouns, and no number that is longer than what it says."""

import re
from collections.abc import Iterable
from decimal import Decimal
from typing import Any

_LONG = 24
"""Digits from which a number in a text is shortened; hashes, times in ns and the like have less"""


def counted(count: int, noun: str, more: str = "") -> str:
    """A number of things, such as `1 session` or `3 sessions`; `more` is a plural without a plain s."""
    return f"{count} {noun if count == 1 else more or noun + 's'}"


def listed(items: Iterable[object]) -> str:
    """Items as text for a sentence: `3`, `3 and 7`, `1, 2 and 4`; nothing for none."""
    texts = [str(item) for item in items]
    return " and ".join(filter(None, [", ".join(texts[:-1]), *texts[-1:]]))


def capital(text: str) -> str:
    """A text with a capital first letter."""
    return text[:1].upper() + text[1:]


def number(value: Any) -> str:
    """A number, also one that is too large for a float."""
    if isinstance(value, int) and abs(value) < 10**15:
        return str(value)
    return f"{Decimal(value):.3g}" if isinstance(value, int) else f"{value:.6g}"


def shortened(text: str) -> str:
    """A text with very long numbers in it cut short."""
    return re.sub(rf"\d{{{_LONG},}}", lambda m: f"{m[0][:6]}… ({len(m[0])} digits)", text)
