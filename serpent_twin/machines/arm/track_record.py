"""Keep how often each name that a trace gave was right on independent arms whose faults were known."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from serpent_twin import stored

FILE = Path(__file__).with_name("track_record.json")
"""As experiments.how_often_right writes it"""


@cache
def track_record() -> Mapping[str, tuple[int, int]]:
    """Of each name, how often it was right, and how many traces gave it."""
    if not FILE.exists():
        return {}
    names = stored.read_json(FILE)["names"]
    return {name: (each["right"], each["given"]) for name, each in names.items()}
