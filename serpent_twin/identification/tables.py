"""Lay out the tables of a diagnosis."""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from serpent_twin.identification.diagnosis import (
    ACCEPTED,
    NOT_EXCITED,
    REJECTED,
    STANDS_IN,
    UNSTABLE,
    Diagnosis,
    Named,
    Tried,
)
from serpent_twin.identification.estimates import Calibrated, ParameterEstimate
from serpent_twin.identification.figures import ranked, stages
from serpent_twin.identification.fitting.fitted import NORMAL_95
from serpent_twin.identification.wording import placed, spaced
from serpent_twin.numerals import capital, counted
from serpent_twin.residual.noise import UNKNOWN
from serpent_twin.runs.report import Table

VERDICTS = (ACCEPTED, STANDS_IN, REJECTED, NOT_EXCITED, UNSTABLE)
MOST_ROWS = 15  # of the calibrated parameters: the others hardly moved


def errors(diagnosis: Diagnosis) -> Table:
    """Held-out errors of each twin, markers and loads, beside the least that any twin can reach."""
    names = [*stages(diagnosis), "noise_floor", "expected"]
    said = {"noise_floor": "noise alone", "expected": "a twin that lacks nothing"}
    marker, load = (
        f"{m.what.removeprefix('the ')} [{m.unit}]" for m in (diagnosis.marker, diagnosis.load)
    )
    kinds = ((marker, diagnosis.error), (load, diagnosis.load_error))
    known = {head: by for head, by in kinds if np.isfinite(by.get("calibrated", np.nan))}
    rows = [(said.get(n, n), *(_cell(n, by) for by in known.values())) for n in names]
    means = {
        marker: "the distance"
        if diagnosis.marker.axes
        else f"the error of {diagnosis.marker.what}",
        load: f"the root mean square of the {diagnosis.load.one} error",
    }
    note = (
        f"Means over held-out segments: of {', and of '.join(means[head] for head in known)}."
        if known
        else ""
    )
    if any(_cell("noise_floor", by) == "–" for by in known.values()):
        note += f" –: {UNKNOWN}."
    return Table(("twin", *known), tuple(row for row in rows if any(row[1:])), note)


def _cell(name: str, error: Mapping[str, float]) -> str:
    """An error; empty if there is none, – for a noise that is unknown."""
    unknown = name == "noise_floor" and name in error and not np.isfinite(error[name])
    return "–" if unknown else _fixed(error.get(name))


def candidates(tried: Sequence[Tried], unit: str = "mm") -> Table:
    """Every candidate, the best first, the accepted ones marked."""
    columns = {
        "candidate": lambda each: spaced(each.name),
        f"error [{unit}]": lambda each: _fixed(each.error),
        "verdict": lambda each: each.verdict,
        "why": lambda each: each.why,
    }
    note = (
        "Held-out error with the candidate; where it was not fitted fully, that of the twin "
        "without it."
    )
    return Table.of(ranked(tried), columns, note, lambda each: each.verdict == ACCEPTED)


def parameters(effects: Sequence[Named], unit: str = "mm", load: str = "% of stall") -> Table:
    """Every number of the effects that were missing, with its interval; what is of an effect stands in the
    row of its first number.
    """
    rows = [
        (None if n else effect, name, estimate)
        for effect in effects
        for n, (name, estimate) in enumerate(effect.parameters.items())
    ]

    def once(told: Callable[[Named], str]) -> Callable[[Any], str]:
        return lambda row: told(row[0]) if row[0] else ""

    columns: dict[str, Any] = {
        "effect": once(lambda effect: capital(placed(effect.name))),
        "number": lambda row: row[1].replace("_", " "),
        "value": lambda row: _value(row[2]),
        "95 % interval": lambda row: interval(row[2]) or "given",
        "unit": lambda row: "" if row[2].unit == "1" else row[2].unit,
        f"gain [{unit}]": once(lambda effect: _fixed(effect.gain)),
    }
    if any(np.isfinite(each.gain_load) for each in effects):
        columns[f"gain [{load}]"] = once(lambda effect: _fixed(effect.gain_load))
    columns["chance"] = once(lambda effect: _chance(effect.probability_of_chance))
    note = (
        "The gain is on held-out sessions. Chance is the probability of no gain at all: of the training "
        "sessions, each predicted by a fit to the others, and of the held-out ones together; of a law that "
        "happens once, of training segments, if the held-out sessions do not suffice."
    )
    return Table.of(rows, columns, note)


def _value(e: ParameterEstimate) -> str:
    """A value, of an inverse quantity also its inverse."""
    if not e.determined:
        return "not determined"
    inverse = f" = 1/{_short(1 / e.value)}" if e.unit.startswith("1/") and e.value else ""
    return f"{_short(e.value)}{inverse}"


def _chance(probability: float) -> str:
    return f"{probability:.0e}" if probability >= 1e-6 else "< 1e-6"


def bars(diagnosis: Diagnosis) -> Table:
    """How large an error may be before it is unexplained."""
    of = diagnosis.bars
    rows = {
        "noise of the measurement alone": of.camera_noise,
        "a twin that lacks nothing": of.complete_twin,
        "what changes from row to row like noise": of.jitter,
    }
    rows |= {"the twin before the change": of.before_change} if of.before_change else {}
    rows |= {"what its effects may neglect": of.neglected} if of.neglected else {}
    rows["the bar"] = of.bar
    note = (
        "An error is unexplained above twice the bar, or above 1.25 times if it depends on something. The "
        "bar is the error of a twin that lacks nothing; what changes from row to row may raise it as far as "
        "no pose of the machine explains it."
    )
    columns = {"error": str, diagnosis.marker.unit: lambda name: _fixed(rows[name])}
    return Table.of(rows, columns, note, lambda name: name == "the bar")


def rivals(diagnosis: Diagnosis) -> Table:
    """What looks like the effects that were found, and whether the logs tell them apart."""
    rows = [(name, each) for name, several in diagnosis.rivals.items() for each in several]
    columns = {
        "effect": lambda row: spaced(row[0]),
        "rival": lambda row: spaced(row[1].name),
        "cosine": lambda row: f"{row[1].cosine:.2f}",
        f"gap [{diagnosis.marker.unit}]": lambda row: _fixed(row[1].gap),
        "chance": lambda row: "" if row[1].probability is None else _short(row[1].probability),
        "told apart": lambda row: "yes" if row[1].told_apart else "no",
    }
    note = (
        "The cosine is between what both change of the residual beyond what calibration can take up: 1 is "
        "the same. The gap is by how much the rival, fitted in the effect's place, is worse on held-out "
        "sessions; chance is the probability that it is not worse. No gap: the rival was not fitted."
    )
    return Table.of(rows, columns, note)


def pairs(diagnosis: Diagnosis) -> Table:
    """The pairs of candidates that were tried together."""
    columns = {
        "pair": lambda each: " and ".join(map(spaced, each.pair.names)),
        "together [%]": lambda each: f"{100 * each.pair.share:.1f}",
        "alone [%]": lambda each: f"{100 * each.pair.alone:.1f}",
        "verdict": lambda each: each.why_not or "accepted",
    }
    note = (
        "Shares of the residual's squares that the two remove to first order, together and the better of "
        "them alone. Pairs are tried where no candidate is accepted alone."
    )
    return Table.of(diagnosis.pairs, columns, note)


def moved(diagnosis: Diagnosis) -> Table:
    """The declared parameters that are not what was built."""
    columns = {
        "parameter": lambda each: each.name,
        "expected": lambda each: _short(each.expected),
        "value": lambda each: _short(each.value),
        "unit": lambda each: each.unit,
        "tolerances": lambda each: f"{each.widths:.1f}".replace("-", "−"),
        "effects that look like it": lambda each: ", ".join(
            f"{spaced(name)} ({cosine:.2f})" for name, cosine in each.stands_for.items()
        ),
    }
    note = (
        "Expected is what was declared, or the median of the parts that are built alike. In brackets, the "
        "cosine between what the parameter and the effect change of the residual."
    )
    return Table.of(diagnosis.moved, columns, note)


def calibration(found: Mapping[str, Calibrated], prior: Mapping[str, float]) -> Table:
    """The declared parameters that moved most from their start.

    In units of the prior where each has one, else in standard errors.
    """
    told = bool(found) and all(name in prior for name in found)
    scale = {name: prior[name] if told else _error(c.coordinate) for name, c in found.items()}
    far = {
        name: abs(c.coordinate.value) / scale[name] if scale[name] > 0 else 0.0
        for name, c in found.items()
    }
    names = sorted(found, key=lambda name: -far[name])[:MOST_ROWS]
    columns: dict[str, Any] = {"parameter": lambda name: found[name].name}
    if any(isfinite(found[name].nominal) for name in names):
        columns["nominal"] = lambda name: _number(found[name], found[name].nominal)
    columns |= {
        "start": lambda name: _number(found[name], found[name].start),
        "value": lambda name: _number(found[name], found[name].value.value),
        "95 % interval": lambda name: _ends(found[name]),
        "unit": lambda name: "" if found[name].value.unit == "1" else found[name].value.unit,
        f"moved, in {'widths of the prior' if told else 'standard errors'}": lambda name: (
            f"{far[name]:.1f}"
        ),
    }
    note = (
        f"The {len(names)} of {counted(len(found), 'parameter')} that moved most from their start, "
        f"a first guess out of "
        "the training sessions or, where these give none, the declared number."
    )
    return Table.of(names, columns, note)


def _number(of: Calibrated, number: float) -> str:
    """A number with the decimals of a calibrated value; empty where it is unknown."""
    return f"{number:.{_decimals(of.value)}f}".replace("-", "−") if isfinite(number) else ""


def _ends(of: Calibrated) -> str:
    ends = (_number(of, each) for each in (of.value.low, of.value.high))
    return " … ".join(ends) if of.value.fitted else ""


def _decimals(e: ParameterEstimate) -> int:
    """Decimals that give the interval's half width two significant digits."""
    half = (e.high - e.low) / 2
    return int(np.clip(1 - np.floor(np.log10(half)), 0, 6)) if e.fitted else 3


def _error(e: ParameterEstimate) -> float:
    return (e.high - e.low) / 2 / NORMAL_95


def interval(e: ParameterEstimate) -> str:
    """Ends of the interval; empty where the value was not fitted."""
    return f"{_short(e.low)} … {_short(e.high)}" if e.fitted else ""


def _fixed(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.2f}".replace("-", "−")


def _short(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")
