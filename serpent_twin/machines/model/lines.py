"""Find the line of a TOML file that an error is about."""

import re
from collections import Counter


def with_line(error: str, text: str) -> str:
    """An error that names a key, with the line where the key is given."""
    found = re.search(r": ((?:\w+)(?:\[\d+\])?(?:\.\w+)*(?:\[\d+\])?) ", error)
    key = found[1] if found else ""
    if strange := re.search(r": \S+ has (\w+)[^;]*, which is unknown there", error):
        key = strange[1] if key == "it" else f"{key}.{strange[1]}"
    line = line_of(key, text)
    return (
        error.replace(f": {found[1]} ", f", line {line}: {found[1]} ", 1)
        if found and line
        else error
    )


def line_of(key: str, text: str) -> int:
    """The line of a TOML text where a key such as `drive[2].column` is given; 0 if it is not found."""
    parts = re.match(r"(\w+)(?:\[(\d+)\])?(?:\.(\w+))?", key)
    if not parts:
        return 0
    table, inner = (parts[1], int(parts[2] or 0)), parts[3]
    here, counts, header = ("", 0), Counter[str](), 0
    for n, line in enumerate(text.splitlines(), 1):
        if heading := re.match(r"\s*\[+\s*([\w.]+)\s*\]+", line):
            here = heading[1], counts[heading[1]]
            counts[heading[1]] += 1
            header = n if here == table else header
        elif given := re.match(r"\s*(\w+)\s*=", line):
            inside = here == table and given[1] == inner
            on_top = here[0] == "" and given[1] == table[0]
            if inside or (on_top and not inner):
                return n
            header = n if on_top else header  # of a table that is written on one line
    return header
