"""List what a next motion should decide, in the order of need."""

from collections.abc import Mapping, Sequence
from typing import Any

from serpent_twin.identification.rivals import Rival

NOT_EXCITED = "not excited"
_DOUBTFUL = 3


def next_motion(
    rivals: Mapping[str, Sequence[Rival]],
    verdicts: Mapping[str, str],
    doubtful: Mapping[str, float] | None = None,
) -> list[dict[str, Any]]:
    """The open questions of a trace: rivals of accepted effects that its logs do not tell apart, the most
    alike first; candidates whose gain may be chance, with its probability, the best first; candidates that
    its logs did not excite. Empty if nothing is open.
    """

    def entry(effect: str, rival: str | None, why: str, chance: float | None) -> dict[str, Any]:
        asked = {"effect": effect, "rival": rival, "why": why}
        return asked | {"probability_of_chance": chance}

    open_ = [(n, each) for n, several in rivals.items() for each in several if not each.told_apart]
    found = [
        entry(name, each.name, "not told apart", each.probability)
        for name, each in sorted(open_, key=lambda pair: -pair[1].cosine)
    ]
    for name, chance in list((doubtful or {}).items())[:_DOUBTFUL]:
        found.append(entry(name, None, "may be chance", chance))
    hidden = [name for name, verdict in verdicts.items() if verdict == NOT_EXCITED]
    return found + [entry(name, None, NOT_EXCITED, None) for name in hidden]
