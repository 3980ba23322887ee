"""Count how often an arm's effect is named after each recording."""

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import binomtest

from experiments.confusion.score import NOTHING, UNEXPLAINED, Share, share

Row = Mapping[str, Any]
"""One line of results.jsonl"""


def answer(found: Mapping[str, Any]) -> str:
    """What one trace said."""
    if found["named"]:
        return " + ".join(found["named"])
    return UNEXPLAINED if found["unexplained"] else NOTHING


def right(row: Row, stage: str) -> bool:
    """Whether the effect is named, and nothing else."""
    return row["answers"][stage]["named"] == [row["name"]]


def wrong(row: Row, stage: str) -> bool:
    """Whether an effect is named that is not there."""
    return any(name != row["name"] for name in row["answers"][stage]["named"])


def decided(row: Row, stage: str) -> bool:
    """Whether the effect alone is named, and no rival is left that the logs do not tell from it."""
    return right(row, stage) and not row["answers"][stage]["not_told_apart"]


def share_right(rows: Sequence[Row], stage: str) -> Share:
    """How often the effect is named, and nothing else."""
    return share(rows, lambda row: right(row, stage))


def ahead(rows: Sequence[Row], one: str, other: str, judged: Any = right) -> tuple[int, int, float]:
    """Arms that only one stage has right, arms that only another has, and the probability of so uneven a
    split by chance (McNemar's exact test).
    """
    first = sum(judged(row, one) and not judged(row, other) for row in rows)
    second = sum(judged(row, other) and not judged(row, one) for row in rows)
    both = first + second
    return first, second, float(binomtest(first, both).pvalue) if both else 1.0
