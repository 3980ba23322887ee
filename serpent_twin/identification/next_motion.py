"""List what a next motion should decide, in the order of need."""

from collections.abc import Mapping, Sequence
from typing import Any

from serpent_twin.identification.rivals import Rival

NOT_EXCITED = "not excited"
_DOUBTFUL = 3


def next_motion(
    rivals: Mapping[str, Sequence[Rival]],
    verdicts: Mapping[str, str],
    doubtful: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """The open questions of a trace: rivals of accepted effects that its logs do not tell apart, the most
    alike first; candidates whose gain may be chance, the best first; candidates that its logs did not excite.
    Empty if nothing is open.
    """
    pairs = [
        (each.cosine, name, each.name)
        for name, several in rivals.items()
        for each in several
        if not each.told_apart
    ]
    alike = [
        {"effect": name, "rival": rival, "why": "not told apart"}
        for _, name, rival in sorted(pairs, key=lambda each: -each[0])
    ]
    chance = [
        {"effect": name, "rival": None, "why": "may be chance"} for name in doubtful[:_DOUBTFUL]
    ]
    hidden = [name for name, verdict in verdicts.items() if verdict == NOT_EXCITED]
    return [*alike, *chance] + [
        {"effect": name, "rival": None, "why": NOT_EXCITED} for name in hidden
    ]
