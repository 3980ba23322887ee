"""Build the diagnosis from the rounds of a trace."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from serpent_twin.effects.discovered import DISCOVERED
from serpent_twin.identification.acceptance import (
    Round,
    Selection,
    accepting,
    doubtful,
    seen,
    why_not,
)
from serpent_twin.identification.bars import Bars, bars
from serpent_twin.identification.cautions import cautions, unstable_fits
from serpent_twin.identification.components import Undetermined
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
from serpent_twin.identification.discovery import FreeCurve, free_curve, steps_alike, stuck
from serpent_twin.identification.estimates import Calibrated, ParameterEstimate
from serpent_twin.identification.fitting.fitted import NORMAL_95, Fit
from serpent_twin.identification.fitting.profile import interval, near_zero
from serpent_twin.identification.fitting.standard_errors import stated
from serpent_twin.identification.held_out import Errors, errors, gain
from serpent_twin.identification.moved import Moved, moved
from serpent_twin.identification.score_test import strengths
from serpent_twin.identification.steps import Tracer
from serpent_twin.identification.unexplained import SUSPECT, unexplained
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case as AnyCase
from serpent_twin.machines.machine import Quantity
from serpent_twin.residual import analyse
from serpent_twin.residual.learned import learn
from serpent_twin.residual.whiteness import whiteness

Case = AnyCase[Any]
FAR = 3.0
"""Times what could be noise, above which accepted effects stand for something else"""
EXPLAINS = 0.85
"""Effects are no stand-ins if they explain at least this share of the squared error above the bar"""
_NARROWER = 0.9
"""Share of its range from which on an interval says nothing of a parameter"""


def build_diagnosis(
    tracer: Tracer, selection: Selection, arm: str, files: Sequence[str]
) -> Diagnosis:
    """The diagnosis: errors, effects with intervals, verdicts, and what is left."""
    case, held_out, rng = selection.case, tracer.held_out, np.random.default_rng([tracer.seed, 7])
    final = selection.final
    points = {"nominal": None, "calibrated": selection.calibrated.point, "corrected": final.point}
    compared = {name: case.compare(point, held_out) for name, point in points.items()}
    found = {name: analyse(compared[name], rng) for name in ("calibrated", "corrected")}
    held = {name: errors(each) for name, each in compared.items()}
    noise = found["corrected"].noise
    # More segments than the search's make what the twin idealises no smaller, and the bar allows for it.
    wider = float(np.sqrt(len(final.used) / len(selection.settled.used)))
    left, training = held["corrected"].marker, tracer.training
    bar = bars(case, final, left, training, held_out, noise, rng, wider)
    error = {name: each.marker for name, each in held.items()}
    load = {name: each.load for name, each in held.items()}
    learned = learn(case.compare(final.point, tracer.training), compared["corrected"], rng)
    suspect = error["corrected"] > SUSPECT * bar.bar
    still = [each.told for each in stuck(case, tracer.training, final)] if suspect else []
    rest = unexplained(found["corrected"], error, load, bar.bar, still)
    shapes = _shapes(case, tracer.training, final)
    told = stated(case, final)
    named = _named(tracer, selection, told, held["calibrated"], held["corrected"])
    nearest = named if rest.is_ and _stands_in(error, bar) else ()
    return Diagnosis(
        arm=arm,
        held_out=tuple(files),
        effects=() if nearest else named,
        stand_ins=nearest,
        candidates=_tried(case, selection, bool(nearest)),
        unexplained=rest,
        error=error | {"noise_floor": noise.mean_floor, "expected": bar.bar},
        load_error=load | {"noise_floor": noise.load_floor},
        cautions=(*cautions(case, selection), *unstable_fits(case, selection, tracer.training)),
        calibration=_calibration(case, told),
        comparisons=compared,
        findings=found,
        learned=learned,
        bars=bar,
        moved=_moved(case, selection),
        rivals=selection.rivals,
        pairs=tuple(pair for each in selection.rounds for pair in each.pairs),
        marker=compared["corrected"].marker,
        load=compared["corrected"].load,
        identifiability=tracer.identifiability if named or rest.is_ else tracer.exact_limits(),
        whiteness=whiteness(compared["corrected"]),
        places={name: each.place for name, each in case.candidates.items()}
        | {name: place for several in shapes.values() for name, place in several.items()},
        curves=_curves(case, tracer.training, final),
        shapes={name: tuple(several) for name, several in shapes.items()},
    )


def _shapes(case: Case, training: Any, final: Fit) -> dict[str, dict[str, Any]]:
    """Alternatives of each composed effect, by its name: the effect with each other shape of its law that
    fits the logs as well, as a name and the entries that say where it is.
    """
    composed = [name for name in final.point.effects if case.candidates[name].composed]
    return {
        name: {
            f"{DISCOVERED}@{law}": {**case.candidates[name].place, "law": law.shape}
            for law in steps_alike(case, training, final, name)
        }
        for name in composed
    }


def _curves(case: Case, training: Any, final: Fit) -> dict[str, FreeCurve]:
    """The composed laws beside free curves, by their effects."""
    composed = [name for name in final.point.effects if case.candidates[name].composed]
    found = {name: free_curve(case, training, final, name) for name in composed}
    return {name: each for name, each in found.items() if each}


def _named(
    tracer: Tracer, selection: Selection, told: Fit, before: Errors, after: Errors
) -> tuple[Named, ...]:
    """The effects found, with standard errors from `told`. A sole effect accounts for all of the gain."""
    case, named = selection.case, []
    alone = len(selection.final.point.effects) == 1
    for name in selection.final.point.effects:
        trial = selection.rounds[accepting(selection.rounds, name)].trials[name]
        assert trial.gain is not None
        whole = alone and not trial.gain.left_out
        gained = gain(before, after, trial.selected) if whole else trial.gain
        named.append(
            Named(
                name=name,
                parameters=estimates(case, told, name, selection.undetermined)
                | _profiled(tracer, case, told, name),
                gain=gained.marker,
                gain_load=gained.load,
                probability_of_chance=gained.probability_of_chance,
                judged_on=gained.where,
            )
        )
    return tuple(named)


def _stands_in(error: Mapping[str, float], bar: Bars) -> bool:
    """Whether the effects that were accepted leave so much that they stand for something else: several times
    what could be noise, and more than a small part of what they were to explain.
    """
    least = float(np.fmax(bar.bar, bar.jitter))
    before, after = (error[name] ** 2 - bar.bar**2 for name in ("calibrated", "corrected"))
    return error["corrected"] > FAR * least and after > (1 - EXPLAINS) * before


def _moved(case: Case, selection: Selection) -> tuple[Moved, ...]:
    """The declared parameters that the twin with all effects has moved too far. Each is compared with
    everything that was tried on top of this twin: named effects, and laws.
    """
    base = selection.settled
    return moved(case, base, [score for each in selection.rounds for score in each.scores(base)])


def estimates(
    case: Case, fit: Fit, name: str, undetermined: Undetermined = MappingProxyType({})
) -> dict[str, ParameterEstimate]:
    """Parameters of an effect with the intervals of a fit, clipped to their ranges; those are not determined
    of which the fit says nothing, or whose interval is hardly narrower than the range.
    """
    out = {}
    for k, (parameter, allowed) in enumerate(case.candidates[name].ranges.items()):
        if allowed.unused:
            continue
        value = float(fit.point.effects[name][k])
        low, high = value, value
        if (name, k) in fit.free.effects:
            _, low, high = fit.interval(name, k, case.candidates[name].model_error)
            if value >= allowed.limit_begins:
                low, high = allowed.limit_begins, allowed.high
        if within := undetermined.get((name, k)):
            low, high = -within, within
        low, high = max(low, allowed.low), min(high, allowed.high)
        determined = not within and bool(high - low < _NARROWER * (allowed.high - allowed.low))
        known = determined or not allowed.fitted
        out[parameter] = ParameterEstimate(value, low, high, allowed.unit, known)
    return out


def _profiled(tracer: Tracer, case: Case, final: Fit, name: str) -> dict[str, ParameterEstimate]:
    """The strengths of an effect that are near zero, with the intervals of the cost's profile; for a vector's
    component, zero is a value as any other.
    """
    out, candidate = {}, case.candidates[name]
    several, strong = list(candidate.ranges.items()), strengths(candidate)
    for k in strong:
        parameter, allowed = several[k]
        component = len(strong) > 1 and allowed.low < 0
        if component or (name, k) not in final.free.effects or not near_zero(case, final, name, k):
            continue
        value = float(final.point.effects[name][k])
        if value < allowed.limit_begins:
            low, high = interval(case, tracer.training, final, name, k, tracer.on_progress)
            out[parameter] = ParameterEstimate(value, low, high, allowed.unit)
    return out


def _tried(case: Case, selection: Selection, stand_in: bool) -> tuple[Tried, ...]:
    """Every candidate's verdict: of the last round in which it was fitted, else of the last."""
    out = {
        name: Tried(name, float("nan"), NOT_EXCITED, 0.0, None, why)
        for name, why in case.unseen.items()
    }
    accepted = {n: accepting(selection.rounds, n) for n in selection.final.point.effects}
    for n, each in enumerate(selection.rounds):
        for name, trial in each.trials.items():
            fitted = name in out and out[name].gain_by_segment is not None
            if n != accepted.get(name, n) or (trial.gain is None and fitted):
                continue
            verdict, why = _verdict(name, each, selection, case)
            if verdict == ACCEPTED and stand_in:
                verdict, why = STANDS_IN, "it comes nearest, but leaves too much to be the cause"
            by_segment = trial.gain.marker_by_segment if trial.gain else None
            doubted = verdict == REJECTED and doubtful(name, trial, case.candidates[name])
            doubt = trial.gain.probability_of_chance if trial.gain and doubted else None
            share = trial.score.share
            out[name] = Tried(name, trial.error, verdict, share, by_segment, why, doubt)
    ordered = sorted(out.values(), key=lambda t: (t.verdict != ACCEPTED, -t.score))
    return tuple(ordered)


def _verdict(name: str, each: Round, selection: Selection, case: Case) -> tuple[str, str]:
    trial = each.trials[name]
    if name in each.accepted:
        if name in selection.final.point.effects:
            assert trial.gain is not None
            return ACCEPTED, f"it improves the fit to {trial.gain.where}, beyond chance"
        return REJECTED, "beside the effects found later it is not worth its parameters"
    if trial.gain is None and trial.score.unstable:
        return (
            UNSTABLE,
            "the simulation of a twin with it became unstable, so that it was not tested",
        )
    if trial.gain is None and not seen(trial):
        return NOT_EXCITED, "a typical strength would move these logs by less than can be seen"
    if why := why_not(name, trial, case.candidates[name]):
        return REJECTED, why
    assert trial.gain is not None
    better = " and ".join(map(spaced, each.accepted)) or each.undone
    return REJECTED, f"{trial.gain}, less than {better}"


def _calibration(case: Case, fit: Fit) -> dict[str, Calibrated]:
    quantities = case.quantities
    return {
        case.declared[k].name: _calibrated(case, fit, quantities[k], k) for k in fit.free.declared
    }


def _calibrated(case: Case, fit: Fit, of: Quantity, k: int) -> Calibrated:
    """A coordinate, and the quantity that it and perhaps others make up, with their joint standard error."""
    value, half = float(fit.point.declared[k]), NORMAL_95 * fit.standard_error((k,))
    names = [each.name for each in case.declared]
    those = [names.index(name) for name in of.of]
    change, off = float(fit.point.declared[those].sum()), NORMAL_95 * fit.standard_error(those)
    low, high = sorted((of.after(change - off), of.after(change + off)))
    return Calibrated(
        ParameterEstimate(value, value - half, value + half, case.declared[k].unit),
        of.name,
        of.nominal,
        of.start,
        ParameterEstimate(of.after(change), low, high, of.unit),
    )
