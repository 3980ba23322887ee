"""How a damaged file is refused: in one sentence of our own."""

import re

import pytest

from serpent_twin.errors import SerpentError

FOREIGN = re.compile(
    r"Traceback|Error\b|Errno|Expected `|got `|\$\.|codec|NoneType|object has no|char \d|recursion"
    r"|invalid literal|could not convert|unhashable|int_max_str|surrogates not|\d{60}"
)
"""What Python, numpy, pyarrow and msgspec say of values, and numbers printed in full"""

LONG = "9" * 300


def refused(reader, path, *named):
    """What the reader says of a file that it must refuse."""
    with pytest.raises(SerpentError) as error:
        reader.read(path)
    said = str(error.value)
    told = said.replace(str(path.parent), "")
    assert path.name in said, said
    assert not FOREIGN.search(told) and "\n" not in told and len(told) < 1000, said
    for each in named:
        assert each in said, said
    return said
