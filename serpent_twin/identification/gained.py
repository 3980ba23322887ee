"""Say what a candidate gains on logs that it was not fitted to, by those of them that can show it."""

from dataclasses import replace
from typing import Any

from serpent_twin.identification.acceptance import weakness
from serpent_twin.identification.discovery import composed_law
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.held_out import Errors, Gain, chance, gain
from serpent_twin.identification.laws_to_fit import sensor_of
from serpent_twin.identification.left_out import better_left_out
from serpent_twin.identification.score_test import Score
from serpent_twin.machines.case import Case

_LASTING = ("above", "under", "within")
"""Laws of the machine's runtime that are the same in a whole session, but for one or two"""


def happens_once(name: str) -> bool:
    """Whether a candidate is a law that changes at an instant of the machine's life, or for a while: sessions
    after it, and those before it, cannot show the change.
    """
    law = composed_law(name)
    return law is not None and law.reading == "runtime" and law.shape in _LASTING


def gained(
    case: Case[Any],
    score: Score,
    fits: tuple[Fit, Fit],
    errors: tuple[Errors, Errors],
    selected: float | None = None,
) -> Gain:
    """What the second of two twins gains over the first: on held-out logs, by their errors. `selected` is the
    probability of chance by the logs that chose the candidate among others, if others chose it.

    A law that shows in one sensor alone is judged by that sensor, since all others say nothing of it. One
    that happens once is judged by training segments that were left out, if held-out logs are better with it
    but do not suffice: these may lie after it, and a calibration has taken that state for what was built.
    Where they show a part of it, both together say how likely chance is.
    """
    on_held_out = _gained(case, score, *errors, selected)
    if not happens_once(score.name) or on_held_out.relative <= 0 or not weakness(on_held_out):
        return on_held_out
    each = better_left_out(case, *fits, sensor_of(case, score))
    by_chance = chance(each) if selected is None else selected
    return replace(
        on_held_out,
        by_block=each,
        probability_of_chance=min(by_chance, on_held_out.probability_of_chance),
        everywhere=on_held_out.whole,
        left_out=True,
    )


def _gained(
    case: Case[Any], score: Score, before: Errors, after: Errors, selected: float | None
) -> Gain:
    """Gain on held-out logs."""
    if (sensor := sensor_of(case, score)) is None:
        return gain(before, after, selected)
    measures = [each.measure for each in case.machine.outputs]
    pose = [n for n, each in enumerate(measures) if each == measures[0]]
    markers = sorted({n // measures[0].dimension for n in pose if sensor[n]})
    loads = [n for n, shown in enumerate(sensor[len(pose) :]) if shown]
    alone = gain(before.at(markers, loads), after.at(markers, loads), selected)
    return replace(alone, everywhere=gain(before, after).relative, of_one_sensor=True)
