"""Read how often each name that a trace gave was right on independent machines whose faults were known."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from serpent_twin import stored

FILE = "track_record.json"
"""Name of the file beside machine.toml that experiments.how_often_right writes"""


@cache
def track_record(folder: Path) -> Mapping[str, tuple[int, int]]:
    """How often each name was right, and how many traces gave it; nothing in a folder without such a file."""
    path = folder / FILE
    if not path.exists():
        return {}
    names = stored.read_json(path)["names"]
    return {name: (each["right"], each["given"]) for name, each in names.items()}
