"""Write the section of a report on the effects that were missing."""

from collections.abc import Mapping

from serpent_twin.effects import law_of
from serpent_twin.effects.law import parse
from serpent_twin.effects.law_causes import look_for
from serpent_twin.identification import tables
from serpent_twin.identification.diagnosis import Diagnosis, Named
from serpent_twin.identification.law_figure import composed_law
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.candidate import Candidate
from serpent_twin.numerals import capital, listed
from serpent_twin.runs.report import Section

_FEWEST = 5
"""Traces that gave a name, below which their record says nothing"""


def missing_section(
    diagnosis: Diagnosis, known: Mapping[str, Candidate], record: Mapping[str, tuple[int, int]]
) -> Section | None:
    """What each effect is, how often its name was right on machines whose faults were known, and its size."""
    if not diagnosis.effects:
        return None
    verdicts = {each.name: each.verdict for each in diagnosis.candidates}
    text = "\n\n".join(_about(effect, known, verdicts, record) for effect in diagnosis.effects)
    return Section(
        "What was missing",
        text,
        (
            tables.parameters(diagnosis.effects, diagnosis.marker.unit, diagnosis.load.unit),
            *(composed_law(c, n) for n, c in enumerate(diagnosis.curves.values(), 1)),
        ),
    )


def _about(
    effect: Named,
    known: Mapping[str, Candidate],
    verdicts: Mapping[str, str],
    record: Mapping[str, tuple[int, int]],
) -> str:
    """What an effect is, in which logs it shows, and the verdicts on effects that it can be confused with."""
    candidate = known[effect.name]
    alike = [
        f"{spaced(n)} ({verdicts[n]})" if n in verdicts else spaced(n)
        for n in candidate.confused_with
    ]
    said = (
        f"{capital(spaced(effect.name))}. {candidate.about}",
        f"Look for {look_for(parse(candidate.at))}." if candidate.composed else "",
        f"It shows in {candidate.shows_in}." if candidate.shows_in else "",
        f"It can be confused with {listed(alike)}." if alike else "",
        _record(*record.get(law_of(effect.name), (0, 0))),
    )
    return " ".join(part for part in said if part)


def _record(right: int, given: int) -> str:
    """How often a name was right."""
    if given < _FEWEST:
        return ""
    return (
        f"On independent arms whose faults were known, this name was right in {right} of the {given} traces "
        "that gave it."
    )
