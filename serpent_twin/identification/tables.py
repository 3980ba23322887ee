"""Lay out the tables of a diagnosis."""

from collections.abc import Mapping, Sequence
from math import isfinite

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
from serpent_twin.identification.fitted import NORMAL_95
from serpent_twin.identification.wording import spaced
from serpent_twin.numerals import counted
from serpent_twin.reporting.report import Table
from serpent_twin.residual.noise import UNKNOWN

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
    order = ranked(tried)
    rows = tuple((spaced(t.name), _fixed(t.error), t.verdict, t.why) for t in order)
    marked = frozenset(n for n, each in enumerate(order) if each.verdict == ACCEPTED)
    note = (
        "Held-out error with the candidate; where it was not fitted fully, that of the twin "
        "without it."
    )
    return Table(("candidate", f"error [{unit}]", "verdict", "why"), rows, note, marked)


def parameters(effects: Sequence[Named], unit: str = "mm", load: str = "% of stall") -> Table:
    """Every number of the effects that were missing, with its interval."""
    loads = any(np.isfinite(each.gain_load) for each in effects)
    gain = (f"gain [{unit}]", f"gain [{load}]") if loads else (f"gain [{unit}]",)
    header = ("effect", "parameter", "value", "95 % interval", "unit", *gain)
    rows = []
    for effect in effects:
        gains = (_fixed(effect.gain), _fixed(effect.gain_load))[: len(gain)]
        told = (spaced(effect.name), *gains, _short(effect.probability_of_chance))
        for name, e in effect.parameters.items():
            value = _short(e.value) if e.determined else "not determined"
            rows.append((told[0], name, value, interval(e), e.unit, *told[1:]))
            told = ("",) * len(told)  # once for each effect
    note = (
        "The gain is on held-out sessions. Chance is the probability of no gain at all: of the training "
        "sessions, each predicted by a fit to the others, and of the held-out ones together; of a law that "
        "happens once, of training segments, if the held-out sessions do not suffice."
    )
    return Table((*header, "chance"), tuple(rows), note)


def bars(diagnosis: Diagnosis) -> Table:
    """How large an error may be before it is unexplained."""
    of, unit = diagnosis.bars, diagnosis.marker.unit
    rows = (
        ("noise of the measurement alone", _fixed(of.camera_noise)),
        ("a twin that lacks nothing", _fixed(of.complete_twin)),
        ("what changes from row to row like noise", _fixed(of.jitter)),
        *([("the twin before the change", _fixed(of.before_change))] if of.before_change else []),
        *([("what its effects may neglect", _fixed(of.neglected))] if of.neglected else []),
        ("the bar", _fixed(of.bar)),
    )
    note = (
        "An error is unexplained above twice the bar, or above 1.25 times if it depends on something. The "
        "bar is the error of a twin that lacks nothing; what changes from row to row may raise it as far as "
        "no pose of the machine explains it."
    )
    return Table(("error", unit), rows, note, frozenset({len(rows) - 1}))


def rivals(diagnosis: Diagnosis) -> Table:
    """What looks like the effects that were found, and whether the logs tell them apart."""
    rows = [
        (
            spaced(name),
            spaced(each.name),
            f"{each.cosine:.2f}",
            _fixed(each.gap),
            "" if each.probability is None else _short(each.probability),
            "yes" if each.told_apart else "no",
        )
        for name, several in diagnosis.rivals.items()
        for each in several
    ]
    header = ("effect", "rival", "cosine", f"gap [{diagnosis.marker.unit}]", "chance", "told apart")
    note = (
        "The cosine is between what both change of the residual beyond what calibration can take up: 1 is "
        "the same. The gap is by how much the rival, fitted in the effect's place, is worse on held-out "
        "sessions; chance is the probability that it is not worse. No gap: the rival was not fitted."
    )
    return Table(header, tuple(rows), note)


def pairs(diagnosis: Diagnosis) -> Table:
    """The pairs of candidates that were tried together."""
    rows = [
        (
            " and ".join(map(spaced, each.pair.names)),
            f"{100 * each.pair.share:.1f}",
            f"{100 * each.pair.alone:.1f}",
            each.why_not or "accepted",
        )
        for each in diagnosis.pairs
    ]
    note = (
        "Shares of the residual's squares that the two remove to first order, together and the better of "
        "them alone. Pairs are tried where no candidate is accepted alone."
    )
    return Table(("pair", "together [%]", "alone [%]", "verdict"), tuple(rows), note)


def moved(diagnosis: Diagnosis) -> Table:
    """The declared parameters that are not what was built."""
    rows = [
        (
            each.name,
            _short(each.expected),
            _short(each.value),
            each.unit,
            f"{each.widths:.1f}".replace("-", "−"),
            ", ".join(f"{spaced(n)} ({c:.2f})" for n, c in each.stands_for.items()),
        )
        for each in diagnosis.moved
    ]
    header = ("parameter", "expected", "value", "unit", "tolerances", "effects that look like it")
    note = (
        "Expected is what was declared, or the median of the parts that are built alike. In brackets, the "
        "cosine between what the parameter and the effect change of the residual."
    )
    return Table(header, tuple(rows), note)


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
    declared = any(isfinite(found[name].nominal) for name in names)
    rows = tuple((*_course(found[name], declared), f"{far[name]:.1f}") for name in names)
    widths = "widths of the prior" if told else "standard errors"
    nominal = ("nominal",) if declared else ()
    header = (
        "parameter",
        *nominal,
        "start",
        "value",
        "95 % interval",
        "unit",
        f"moved, in {widths}",
    )
    note = (
        f"The {len(rows)} of {counted(len(found), 'parameter')} that moved most from their start, "
        f"a first guess out of "
        "the training sessions or, where these give none, the declared number."
    )
    return Table(header, rows, note)


def _course(of: Calibrated, declared: bool) -> tuple[str, ...]:
    """Name, nominal value if requested, start, value, interval and unit."""
    value, digits = of.value, _decimals(of.value)
    before = (of.nominal, of.start) if declared else (of.start,)
    numbers = [f"{v:.{digits}f}" if isfinite(v) else "" for v in (*before, value.value)]
    ends = f"{value.low:.{digits}f} … {value.high:.{digits}f}" if value.fitted else ""
    unit = "" if value.unit == "1" else value.unit
    return (of.name, *(text.replace("-", "−") for text in (*numbers, ends)), unit)


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
