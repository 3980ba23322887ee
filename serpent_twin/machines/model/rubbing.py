"""List the dry friction that a model at rest may have, sized by what it does to the poses of a log."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import law_of
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.sizes import given, sized_candidate
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.tables.segments import Segments

_STRENGTH = {"tendon_friction": "force", "hinge_friction": "coulomb"}
_SHOWS = 0.02
"""Change by typical friction (rms), as a fraction of the span of what is measured"""
_TRIES, _FARTHEST = 8, 30.0
"""Strengths that are tried, each at most so many times the one before"""
_FIRST = 1e-3
"""Strength with which the search begins, of the stiffest joint's [1/rad]"""
_WIDE = 30.0
"""Times what is typical, how far a range goes"""


def rubbing(machine: Described) -> Iterator[Candidate]:
    """Friction of all tendons alike, and of each; of all joints alike, and of each."""
    model = machine.model
    for law, names in (
        ("tendon_friction", [model.tendon(n).name for n in range(model.ntendon)]),
        ("hinge_friction", [model.joint(n).name for n in single_joints(model).tolist()]),
    ):
        none = {"viscous": given(law, "viscous")} if law == "hinge_friction" else {}
        if names and all(names):
            yield candidate(law, **none)
        if len(names) > 1 and all(names):
            yield from (candidate(f"{law}@{name}", **none) for name in names)


def sized(machine: ModelMachine, few: Segments) -> ModelMachine:
    """Copy of a machine whose typical friction changes what is seen of some poses by a share of its span."""
    known, at = dict(machine.known), ParameterVector.nominal(machine.declared)
    laws = [law for law in _STRENGTH if law in known]
    free = machine.respond([at], few)[0] if laws else np.empty(0)
    for law in laws:
        typical = _typical(machine, law, few, free)
        of = [name for name in known if law_of(name) == law]
        known |= {name: _of_size(machine.described, known[name], law, typical) for name in of}
    return replace(machine, known=known)


def _of_size(machine: Described, one: Candidate, law: str, typical: float) -> Candidate:
    name = _STRENGTH[law]
    strength = replace(one.ranges[name], typical=typical, high=_WIDE * typical)
    there = sized_candidate(machine.model, one.name, **{**one.ranges, name: strength})
    return replace(one, ranges=there.ranges, variants=there.variants)


def _typical(machine: ModelMachine, law: str, few: Segments, free: Array) -> float:
    """The strength that changes what is seen without friction, (S, T, C), as much as is wanted."""
    at = ParameterVector.nominal(machine.declared)
    span = np.nanmax(few.measured, axis=(0, 1)) - np.nanmin(few.measured, axis=(0, 1))
    span[span == 0] = np.inf  # what does not move shows nothing
    strength = _FIRST * float(np.max(machine.described.model.jnt_stiffness, initial=1.0))
    values = np.zeros(len(machine.known[law].ranges))
    for _ in range(_TRIES):
        values[0] = strength
        held = machine.respond([at.having(law, values)], few)[0]
        shown = float(np.sqrt(np.nanmean(((held - free) / span) ** 2))) / _SHOWS
        if 0.5 < shown < 2.0:
            break
        strength *= float(np.clip(1 / max(shown, 1e-12), 1 / _FARTHEST, _FARTHEST))
    return strength
