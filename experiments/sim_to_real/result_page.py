"""Write the errors of all routes from simulation to the arm as a page."""

from collections.abc import Mapping
from typing import Any

from experiments.result_page import PageContent
from experiments.sim_to_real.page import lead, sections
from serpent_twin.numerals import counted
from serpent_twin.reporting.report import Section


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    quick = " --quick" if results["settings"]["quick"] else ""
    command = f"python -m experiments.sim_to_real --logs LOGS{quick} --out sim_to_real"
    data = "; ".join(
        f"{name}: {counted(of['windows']['train'], 'window')} to learn from, tested on "
        f"{', '.join(of['test_sessions'])}"
        for name, of in results["arms"].items()
    )
    text = f"{lead(results['arms'])} [From simulation to the arm](../sim-to-real.md) describes the routes."
    return PageContent("Sim to real", command, data, (Section("", text), *sections(results)))
