"""Read the effects that the arm may have and its nominal twin lacks: those that its machine.toml lists."""

from collections.abc import Mapping

from serpent_twin import machines, stored
from serpent_twin.effects import KNOWN, Effect
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.model.description import ADVICE, Description

_ABOUT = stored.read_toml(machines.PACKAGED, Description, ADVICE)
CATALOGUE: Mapping[str, type[Effect]] = {name: KNOWN[name] for name in _ABOUT.candidates}
"""The arm's candidates by name"""


def candidates() -> dict[str, Candidate]:
    """Every effect of the arm's catalogue."""
    return {name: candidate(name) for name in CATALOGUE}
