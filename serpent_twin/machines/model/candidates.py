"""List the effects that a model's machine may have, sized by the model and by its logs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import mujoco
import numpy as np

from serpent_twin import effects, stored
from serpent_twin.arrays import Array
from serpent_twin.effects import KNOWN, READING, law_of, ranges
from serpent_twin.errors import SerpentError
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.model.candidates_in_motion import (
    laws_of_state,
    rubbing_tendons,
    saturated,
    stiffening_tendons,
    weak,
)
from serpent_twin.machines.model.candidates_of_all import of_all
from serpent_twin.machines.model.coupled import could_be_coupled
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION, DriveColumn
from serpent_twin.machines.model.rubbing import rubbing
from serpent_twin.machines.model.sizes import (
    Sizes,
    given,
    sized_candidate,
    sized_range,
    sizes,
)
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.machines.model.starts import LEAD
from serpent_twin.machines.model.things import OBJECTS, acts_on, chain_ends, names, winding
from serpent_twin.tables.log import Log

_STILL = 1e-6
"""Motion of a body per motion of a joint [m/rad] below which it stands still"""
_REACH = 1e-3
"""Motion of a place per motion of a joint [m/rad] below which a force there has no useful lever; lever [m]
below which what a link carries does not bend it
"""
_PLAY, _SPRING, _LOAD, _RUBS = 0.02, 0.1, 0.1, 0.1
"""Typical effects: of the range of a drive, of a joint's stiffness, of the mass that a body carries, of the
force that moves a joint
"""
_ROTOR = 0.1
"""Typical inertia of a rotor, of what its joint moves"""
_LIGHT = 0.01
"""Share of the whole mass that a place is taken to carry at least"""
_RUBS_MOST = 10.0
"""Greatest friction of a joint, in multiples of the force that moves it in the model: the friction of a light
carriage may be greater than the force that its motion takes without friction
"""
_LATE = 1 / 3
"""Longest delay of a reading, as a share of a segment's lead"""
_MOST_DOFS = 3
"""Most degrees of freedom of a body that may bend and twist, which takes three more; MuJoCo allows six"""
_BENT = 0.02
"""Typical of a link under the moments that move it [rad]"""


def candidates(machine: Described, training: Sequence[Log]) -> dict[str, Candidate]:
    """All laws that find a place in the model."""
    of = sizes(machine, training)
    found = [candidate("gravity"), *_play(machine, training), *_joints(machine, of)]
    found += stiffening_tendons(machine, of)
    if machine.about.rows == MOTION:
        found += [candidate("command_delay")] * bool(machine.commanded)
        found += [*_late(machine, training), *rubbing_tendons(machine)]
        found += saturated(machine, training, of)
        found += weak(machine, of)
        found += laws_of_state(machine, training, of)
        found += of_all(machine, [_placed(machine, each) for each in found])
        found += of_all(machine, found)
    elif machine.about.held:
        found += [candidate(f"drive_coupling@{name}") for name in could_be_coupled(machine)]
        found += laws_of_state(machine, training, of)
    else:
        found += rubbing(machine)
    found = _wanted(machine, [*found, *_bodies(machine, of)])
    return {each.name: _confused(_placed(machine, each), found) for each in found}


def _wanted(machine: Described, found: Sequence[Candidate]) -> list[Candidate]:
    """Candidates that the description names; all if it names none."""
    wanted = machine.about.candidates
    if machine.about.lead:  # before which segments know no past
        found = [each for each in found if not KNOWN[law_of(each.name)].remembers]
    for pattern in wanted:
        if not any(fnmatchcase(each.name, pattern) for each in found):
            raise SerpentError(
                f"{machine.path}: candidates has {pattern!r}, which is none of the machine's with these "
                f"logs; there are: {stored.names([each.name for each in found], 40)}. Name some of them."
            )
    return [each for each in found if not wanted or any(fnmatchcase(each.name, p) for p in wanted)]


def _placed(machine: Described, one: Candidate) -> Candidate:
    """Set the kind of a candidate's place, if its law may be at several kinds: that of what is measured
    there, or of the model's element of its name.
    """
    law = effects.by_name(law_of(one.name))
    if not one.at or len(law.places) == 1:
        return one
    measured = {each.of for each in machine.about.measured}
    there = (
        kind
        for kind in law.places
        if (
            (kind, one.at) in measured
            if law.stage == READING
            else one.at in names(machine.model, OBJECTS[kind])
        )
    )
    return replace(one, place_kind=next(there, law.places[-1]))  # the last: a column of a sensor


def _confused(one: Candidate, several: Sequence[Candidate]) -> Candidate:
    """Name the candidates that one can be confused with: its own effect elsewhere, and effects that look like
    it anywhere.
    """
    alike = [
        other.name
        for other in several
        if other.name != one.name
        and (
            law_of(other.name) in (law_of(one.name), *one.confused_with)
            or law_of(one.name) in other.confused_with
        )
    ]
    return replace(one, confused_with=tuple(alike))


def _play(machine: Described, training: Sequence[Log]) -> Iterator[Candidate]:
    """Play of all drives that set a position alike, and of each."""
    drives = [d for d in machine.commanded if machine.is_servo(d.actuator)]
    drives += [d for d in machine.prescribed if d.joint in winding(machine.model)]
    if not drives:
        return
    told = np.concatenate(
        [[run.columns[each.column] for each in drives] for run in training], axis=1
    )
    span = np.ptp(told, axis=1)

    def play(name: str, of: float, moved: DriveColumn) -> Candidate:
        known, unit = ranges(KNOWN[law_of(name)])["gap"], "m" if machine.is_length(moved) else "rad"
        gap = replace(known, unit=unit, high=min(known.high, of), typical=_PLAY * of)
        return candidate(name, gap=gap)

    alike = len({machine.is_length(each) for each in drives}) == 1
    if span.any() and alike:
        yield play("gear_backlash", float(span.max()), drives[0])
    for each, of in zip(drives, span.tolist(), strict=True):
        if not of:
            continue
        yield play(f"gear_backlash@{each.of[1]}", of, each)
        if (
            each.actuator
            and machine.about.rows == MOTION
            and acts_on(machine.model, each.actuator)[0] == "joint"
        ):
            yield play(f"free_play@{each.actuator}", of, each)


def _joints(machine: Described, of: Sizes) -> Iterator[Candidate]:
    """Effects of each hinge or slide: a spring, if the model has none, one that stiffens, and in motion
    friction.
    """
    model = machine.model
    held = [] if machine.about.held else [each.joint for each in machine.prescribed]
    driven = [acts_on(model, each.actuator) for each in machine.commanded]
    for n in single_joints(model).tolist():
        name, dof = model.joint(n).name, model.jnt_dofadr[n]
        if name in machine.efforts:
            yield candidate(f"gear_friction@{name}")
        if name in ("", *held):
            continue
        stiffness, turn, force, rate = (
            float(each[dof]) for each in (of.stiffness, of.turn, of.force, of.rate)
        )
        if model.jnt_stiffness[n] == 0:
            yield sized_candidate(model, f"joint_elasticity@{name}", stiffness=_SPRING * stiffness)
        yield sized_candidate(
            model, f"joint_stiffening@{name}", cubic=_SPRING * (stiffness / turn**2)
        )
        if machine.about.held and model.dof_armature[dof] == 0:
            inertia = _ROTOR * float(model.dof_M0[dof])
            yield sized_candidate(model, f"rotor_inertia@{name}", inertia=inertia)
        if machine.about.moves:
            coulomb = sized_range("hinge_friction", "coulomb", _RUBS * force)
            coulomb = replace(coulomb, high=_RUBS_MOST * force)
            viscous = _RUBS * force / rate
            yield sized_candidate(model, f"hinge_friction@{name}", coulomb=coulomb, viscous=viscous)
            if ("joint", name) in driven:
                yield candidate(f"gear_friction@{name}")


def _late(machine: Described, training: Sequence[Log]) -> Iterator[Candidate]:
    """A lag of each actuator, and of all alike; a delay of each reading, where there are others to be late
    against.
    """
    bare = [
        each.actuator
        for each in machine.commanded
        if machine.model.actuator(each.actuator).dyntype == mujoco.mjtDyn.mjDYN_NONE
    ]
    if bare:
        yield candidate("servo_lag")
    if len(bare) > 1:
        yield from (candidate(f"servo_lag@{name}") for name in bare)
    read = list(dict.fromkeys(each.of[1] for each in machine.about.measured))
    against = len(read) + len(machine.prescribed)
    if against > 1:
        longest = _LATE * LEAD * float(np.median(np.diff(training[0].time)))
        known = ranges(KNOWN["sensor_delay"])["delay"]
        delay = replace(known, high=longest, typical=min(known.typical, longest / 3))
        yield from (candidate(f"sensor_delay@{name}", delay=delay) for name in read)


def _bodies(machine: Described, of: Sizes) -> Iterator[Candidate]:
    """A mass and a force at each measured site, at the far end of each chain of bodies, and at the origin of
    each body that the joints move; and that body's bending and twisting.
    """
    model, data = machine.model, mujoco.MjData(machine.model)
    data.qpos[:] = machine.begin
    mujoco.mj_forward(model, data)
    lever: dict[str, Array] = {}
    carrier: dict[str, int] = {}

    def place(name: str, body: int, at: Array) -> None:
        along = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, along, None, at, body)
        if name and np.abs(along).max(initial=0.0) > _REACH:
            lever[name], carrier[name] = np.linalg.norm(along, axis=0), body

    measured = [model.site(each.site).id for each in machine.about.measured if each.site]
    for site in dict.fromkeys([*measured, *chain_ends(model, data)]):
        place(model.site(site).name, int(model.site_bodyid[site]), data.site_xpos[site])
    for n in range(1, model.nbody):
        place(model.body(n).name, n, data.xpos[n])
    for name in lever:
        carried = max(model.body_subtreemass[carrier[name]], _LIGHT * model.body_subtreemass[0])
        yield from _pulled(machine, name, float(carried), lever[name], of)
    links = [
        n
        for n in range(1, model.nbody)
        if model.body(n).name and 0 < model.body_dofnum[n] <= _MOST_DOFS
    ]
    if all(model.joint(n).name for n in range(model.njnt)):
        for n in (n for n in links if of.moment[n] > _REACH * of.carried[n]):
            bends = _BENT / float(of.moment[n])
            yield sized_candidate(
                model, f"link_flex@{model.body(n).name}", compliance=bends, twist=bends
            )


def _pulled(
    machine: Described, name: str, carried: float, lever: Array, of: Sizes
) -> Iterator[Candidate]:
    """A mass, if there is gravity, and a force, at a place that moves so far with each joint."""
    model = machine.model
    if model.opt.gravity.any():
        mass = sized_range("payload", "mass", _LOAD * carried)
        whole = float(model.body_subtreemass[0])
        mass = replace(mass, high=max(mass.high, whole))  # a light tip may carry a heavy load
        yield sized_candidate(model, f"payload@{name}", mass=mass, place=given("payload", "place"))
    moved = lever > _STILL
    each = _RUBS * float(np.median(of.force[moved] / lever[moved]))
    nowhere = given("constant_force", "place")
    force = {"along_x": each, "along_y": each, "along_z": each}
    yield sized_candidate(model, f"constant_force@{name}", **force, place=nowhere)
