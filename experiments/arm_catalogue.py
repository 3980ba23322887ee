"""Read the effects that the arm may have and its nominal twin lacks: those that its machine.toml lists."""

from collections.abc import Mapping

from serpent_twin import machines
from serpent_twin.effects import KNOWN, Effect
from serpent_twin.machines.candidate import Candidate, candidate

CATALOGUE: Mapping[str, type[Effect]] = {
    name: KNOWN[name] for name in machines.find(machines.ARM).described.about.candidates
}
"""The arm's candidates by name"""


def candidates() -> dict[str, Candidate]:
    """Every effect of the arm's catalogue."""
    return {name: candidate(name) for name in CATALOGUE}
