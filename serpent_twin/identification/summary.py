"""Say what a trace found in one screen."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from serpent_twin.effects.law import parse
from serpent_twin.effects.law_causes import look_for
from serpent_twin.identification.diagnosis import Diagnosis
from serpent_twin.identification.estimates import Calibrated
from serpent_twin.identification.figures import stages
from serpent_twin.identification.tables import parameters
from serpent_twin.identification.wording import placed, spaced, with_numbers
from serpent_twin.machines.candidate import Candidate
from serpent_twin.numerals import capital, listed
from serpent_twin.residual.noise import in_words
from serpent_twin.runs.report import text_table

_WIDTH = 96
_SHOWN = ("effect", "number", "value", "95 % interval", "unit", "chance")
"""Columns of the report's table of numbers that the screen has"""
_CLEARLY, _NUMBERS = 0.15, 4
"""Least logarithm of a ratio to the model's number that is told, and most numbers"""
_LISTED = 6
"""Limits that are listed: the report has all"""


def summary(diagnosis: Diagnosis, known: Mapping[str, Candidate]) -> str:
    """What is missing, where, how strong and how sure; the error before and after; what to check on the
    machine; what these logs cannot tell.
    """
    parts = (
        _title(diagnosis),
        _table(diagnosis),
        _errors(diagnosis),
        _numbers(diagnosis),
        "\n".join(_marked(_checks(diagnosis, known))),
        "\n".join(_marked(_open(diagnosis))),
    )
    return "\n\n".join(part for part in parts if part)


def _title(diagnosis: Diagnosis) -> str:
    if diagnosis.effects:
        return f"What the model of {diagnosis.arm} lacks:"
    if diagnosis.unexplained.is_:
        return f"{diagnosis.arm}: something is missing that no known effect explains."
    if diagnosis.blind:
        return f"{diagnosis.arm}: these logs cannot show whether anything is missing."
    sure = not (diagnosis.doubt or diagnosis.moved)
    but = ", but numbers of the model are off" if _off(diagnosis) else ""
    return f"{diagnosis.arm}: nothing {'is' if sure else 'was found'} missing{but}."


def _table(diagnosis: Diagnosis) -> str:
    """Each effect with its numbers, their 95 % intervals and how probable it is that they are chance."""
    if not diagnosis.effects:
        return ""
    table = parameters(diagnosis.effects).only(*_SHOWN)
    return textwrap.indent(text_table(table, _WIDTH // 2), "  ")


def _errors(diagnosis: Diagnosis) -> str:
    """The error on held-out sessions, from twin to twin."""
    error, measure = diagnosis.error, diagnosis.marker
    if not np.isfinite(error.get("nominal", np.nan)):
        error, measure = diagnosis.load_error, diagnosis.load
    told = [f"{error[each]:.3g} {measure.unit} {each}" for each in stages(diagnosis)]
    noise = in_words(error["noise_floor"], measure.unit)
    held = ", ".join(diagnosis.held_out)
    return textwrap.fill(
        f"Error on {held or 'held-out segments'}, to which nothing was fitted: {' → '.join(told)} "
        f"({measure.noise}: {noise}).",
        _WIDTH,
    )


def _numbers(diagnosis: Diagnosis) -> str:
    """The model's own numbers that the logs make clearly different, those first that differ most."""
    told = _off(diagnosis)
    return textwrap.fill(f"By the logs, {listed(told[:_NUMBERS])}.", _WIDTH) if told else ""


def _off(diagnosis: Diagnosis) -> list[str]:
    """The model's numbers that the logs make clearly different, in words."""
    off: dict[str, float] = {}
    for each in diagnosis.calibration.values():
        value, was = each.value, each.nominal
        beyond = not value.low <= was <= value.high
        if beyond and value.value * was > 0:
            off[_number(each)] = abs(np.log(value.value / was))
    return sorted((name for name in off if off[name] > _CLEARLY), key=lambda name: -off[name])


def _number(of: Calibrated) -> str:
    unit = "" if of.value.unit == "1" else f" {of.value.unit}"
    return f"{of.name} is {of.value.value:.3g}{unit} (in the model {of.nominal:.3g})"


def _checks(diagnosis: Diagnosis, known: Mapping[str, Candidate]) -> Iterator[str]:
    """What to examine on the machine."""
    for each in diagnosis.effects:
        one = known.get(each.name)
        if one and one.composed:
            yield f"Look for {look_for(parse(one.at))}: {with_numbers(each.name, each.parameters)}."
        elif one:
            yield f"{capital(placed(each.name))}: {one.shows_in}."
        if alike := [
            spaced(r.name) for r in diagnosis.rivals.get(each.name, ()) if not r.told_apart
        ]:
            yield f"These logs do not tell {placed(each.name)} from {' or '.join(alike)}."
    if diagnosis.not_as_built:
        yield diagnosis.not_as_built
    if diagnosis.stand_ins:
        nearest = " and ".join(with_numbers(e.name, e.parameters) for e in diagnosis.stand_ins)
        yield f"Nearest comes {nearest}, as a stand-in."


def _open(diagnosis: Diagnosis) -> Iterator[str]:
    """What is left, and what these logs cannot tell."""
    last = diagnosis.error["corrected" if diagnosis.effects else "calibrated"]
    if last > diagnosis.error.get("nominal", np.inf):
        yield (
            "The twin does worse on these logs than the model as it is: what was fitted to the others "
            "does not hold here. Keep the model, and record logs that are more alike."
        )
    if diagnosis.unexplained.is_:
        yield f"Unexplained: {diagnosis.unexplained.depends_on}"
    elif diagnosis.doubt:
        yield diagnosis.doubt
    yield from _nearly(diagnosis)
    yield from diagnosis.cautions[:2]
    told = diagnosis.identifiability
    if told is None:
        return
    if lost := [placed(each.name) for each in told.effects if not np.isfinite(each.limit)]:
        yield f"These logs would not show at any strength: {_some(lost)}."
    if told.not_sought:
        yield told.not_sought[0]


def _nearly(diagnosis: Diagnosis) -> Iterator[str]:
    """Where nothing was found: the candidate that held-out sessions gain most by, but may owe to chance."""
    doubted = [each for each in diagnosis.candidates if each.doubt is not None]
    if doubted and not diagnosis.effects and not diagnosis.stand_ins:
        best = min(doubted, key=lambda each: each.error)
        yield f"{capital(placed(best.name))} is not sure: {best.why}. More logs may show it."


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more


def _marked(sentences: Iterator[str]) -> Iterator[str]:
    for each in sentences:
        yield textwrap.fill(each, _WIDTH, initial_indent="- ", subsequent_indent="  ")
