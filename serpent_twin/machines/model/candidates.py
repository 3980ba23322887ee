"""List the effects that a model's machine may have, sized by the model and by its logs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from serpent_twin import effects
from serpent_twin.effects import KNOWN, Range
from serpent_twin.machines.machine import Candidate, candidate
from serpent_twin.machines.measured import Recording
from serpent_twin.machines.model.description import MOTION, Described
from serpent_twin.machines.model.sizes import Sizes, sizes

_PART = 0.2
"""Of an effect's range, what is typical at most"""
_STILL = 1e-6
"""Motion of a body per motion of a joint [m/rad] below which it stands still"""
_MOST_PLACES = 12
"""Of a kind in a model: with more, an effect is sought in all of them alike only"""
_PLAY, _SPRING, _LOAD, _RUBS = 0.02, 0.1, 0.1, 0.1
"""Typical effects: of the range of a drive, of a joint's stiffness, of the mass that a body carries, of the
force that moves a joint
"""


def candidates(machine: Described, training: Sequence[Recording]) -> dict[str, Candidate]:
    """All laws that find a place in the model."""
    found = [candidate("gravity"), *_play(machine, training)]
    found += _joints(machine, sizes(machine, training))
    if machine.about.rows == MOTION:
        found.append(candidate("command_delay"))
    if machine.model.opt.gravity.any():
        found += _loads(machine)
    return {each.name: _confused(each, found) for each in found}


def _confused(one: Candidate, several: Sequence[Candidate]) -> Candidate:
    """With what it can be confused among the candidates: wherever such an effect is, and itself elsewhere."""
    alike = [
        other.name
        for other in several
        if other.name != one.name
        and (_kind(other) in (_kind(one), *one.confused_with) or _kind(one) in other.confused_with)
    ]
    return replace(one, confused_with=tuple(alike))


def _kind(each: Candidate) -> str:
    return each.name.partition("@")[0]


def _play(machine: Described, training: Sequence[Recording]) -> Iterator[Candidate]:
    """Play of all drives that set a position alike, and of each."""
    drives = [d for d in machine.about.drive if machine.control_unit(d.actuator)[0] != "1"]
    if not drives:
        return
    told = np.concatenate(
        [[run.columns[each.column] for each in drives] for run in training], axis=1
    )
    span = np.ptp(told, axis=1)
    known = effects.ranges(KNOWN["gear_backlash"])["gap"]

    def gap(of: float) -> Range:
        return replace(known, unit=_unit(machine), high=min(known.high, of), typical=_PLAY * of)

    yield candidate("gear_backlash", gap=gap(float(span.max())))
    if len(drives) <= _MOST_PLACES:
        for each, of in zip(drives, span.tolist(), strict=True):
            yield candidate(f"gear_backlash@{each.actuator}", gap=gap(of))


def _unit(machine: Described) -> str:
    """Of what the drives tell the actuators."""
    kinds = {"m" if machine.is_length(each.actuator) else "rad" for each in machine.about.drive}
    return " or ".join(sorted(kinds))


def _joints(machine: Described, sized: Sizes) -> Iterator[Candidate]:
    """At each hinge: a spring, if the model has none there, and in motion friction."""
    model = machine.model
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE).tolist()
    if len(hinges) > _MOST_PLACES:
        return
    for n in (each for each in hinges if model.joint(each).name):
        name, dof = model.joint(n).name, model.jnt_dofadr[n]
        if model.jnt_stiffness[n] == 0:
            spring = _range("joint_elasticity", "stiffness", _SPRING * float(sized.stiffness[dof]))
            yield candidate(f"joint_elasticity@{name}", stiffness=spring)
        if machine.about.rows == MOTION:
            force, rate = float(sized.force[dof]), float(sized.rate[dof])
            coulomb = _range("hinge_friction", "coulomb", _RUBS * force)
            viscous = _range("hinge_friction", "viscous", _RUBS * force / rate)
            yield candidate(f"hinge_friction@{name}", coulomb=coulomb, viscous=viscous)


def _range(effect: str, parameter: str, typical: float) -> Range:
    """The range of a strength of some typical size."""
    known = effects.ranges(KNOWN[effect])[parameter]
    return replace(known, typical=min(typical, _PART * known.high))


def _loads(machine: Described) -> Iterator[Candidate]:
    """A mass at each measured site, and at the origin of each body that the joints move."""
    model, data = machine.model, mujoco.MjData(machine.model)
    data.qpos[:] = machine.begin
    mujoco.mj_forward(model, data)
    carried = {
        each.site: int(model.site(each.site).bodyid[0])
        for each in machine.about.measured
        if each.site
    }
    for n in range(1, model.nbody):
        along = np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, along, None, n)
        if model.body(n).name and np.abs(along).max(initial=0.0) > _STILL:
            carried[model.body(n).name] = n
    places = list(carried) if len(carried) <= _MOST_PLACES else list(carried)[:1]
    known = effects.ranges(KNOWN["payload"])
    for name in places:
        mass = _range("payload", "mass", _LOAD * float(model.body_subtreemass[carried[name]]))
        place = replace(known["place"], low=0.0, high=0.0, typical=0.0, fitted=False)
        yield candidate(f"payload@{name}", mass=mass, place=place)
