"""Take from a diagnosis how weak an effect of each kind it would have found: its stated detection limits."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from experiments.arm_catalogue import CATALOGUE
from serpent_twin.effects import Effect, ranges, strengths
from serpent_twin.identification import Trace
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.detection import identifiability, opening_fit
from serpent_twin.identification.first_guess import guessed
from serpent_twin.identification.run import planned
from serpent_twin.identification.score_test import scores
from serpent_twin.machines.machine import ParameterVector


def stated_limits(diagnosis: Mapping[str, Any]) -> dict[str, float]:
    """The detection limit of each effect of the catalogue that the logs can show at all, in the unit of its
    strength; of an effect with several strengths, their length.
    """
    stated = diagnosis["identifiability"].get("effects", [])
    return {
        each["name"]: each["limit"] * _length(CATALOGUE[each["name"]])
        for each in stated
        if each["name"] in CATALOGUE and each["limit"] is not None and np.isfinite(each["limit"])
    }


def limit_of(traced: Trace, effect: Mapping[str, Any]) -> float:
    """The detection limit that a trace, whose stages are kept, would have stated of a true effect if it had
    known its parameters but for the size of its strength; infinite where no strength would show.
    """
    rig, training, _ = planned(traced)
    case = rig.open(training)
    notes = Checkpoints(traced.out / "stages", case.clock)
    case = guessed(case, training, lambda _: None, notes.numbers)
    pieces = case.pieces(training)
    start = ParameterVector.nominal(case.declared)
    case = case.reweighted(start, pieces)
    opening = notes.fit("opening", lambda: opening_fit(case, pieces))
    like = case.candidates[effect["name"]]
    usual = like.variants[0]
    values = np.array(
        [effect["parameters"].get(n, v) for n, v in zip(like.ranges, usual, strict=True)]
    )
    strong = [list(like.ranges).index(name) for name in effect["strong"]]
    values[strong] *= np.linalg.norm(usual[strong]) / np.linalg.norm(values[strong])
    tested = scores(case, pieces, opening, [replace(like, variants=(values,), whole=True)])
    told = identifiability(case, pieces, opening, tested, lambda _, make: make()).effects
    found = next(each for each in told if each.name == effect["name"])
    each = np.abs(values[strong])
    return float(found.limit * np.linalg.norm(each) / each.max())


def times_limit(effect: Mapping[str, Any], limits: Mapping[str, float]) -> float:
    """How many times its stated detection limit a true effect has; NaN where none is stated."""
    values = [effect["parameters"][name] for name in effect["strong"]]
    return float(np.linalg.norm(values) / limits.get(effect["name"], np.nan))


def _length(kind: type[Effect]) -> float:
    """Length of all strengths of an effect over the largest of them, for which a limit is stated."""
    variant = kind.variants()[0]
    each = np.array([getattr(variant, name) for name in strengths(ranges(kind))])
    return float(np.linalg.norm(each) / np.abs(each).max())
