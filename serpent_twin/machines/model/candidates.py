"""List the effects that a model's machine may have, sized by the model and by its logs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import KNOWN, Range, law_of
from serpent_twin.machines.machine import Candidate, candidate
from serpent_twin.machines.measured import Recording
from serpent_twin.machines.model.description import MOTION, Described
from serpent_twin.machines.model.motion import LEAD
from serpent_twin.machines.model.sizes import Sizes, sizes

_STILL = 1e-6
"""Motion of a body per motion of a joint [m/rad] below which it stands still"""
_REACH = 1e-3
"""The same below which a place has no lever worth a force [m/rad]"""
_MOST_PLACES = 12
"""Of a kind in a model: with more, an effect is sought in all of them alike only"""
_OF_SLIDES = {"N m": "N", "N m s/rad": "N s/m", "N m/rad": "N/m", "N m/rad³": "N/m³"}
"""Units of a law of hinges, at a slide"""
_WIDE = 20.0
"""Of what is typical, how far a range goes"""
_PLAY, _SPRING, _LOAD, _RUBS = 0.02, 0.1, 0.1, 0.1
"""Typical effects: of the range of a drive, of a joint's stiffness, of the mass that a body carries, of the
force that moves a joint
"""
_LIGHT = 0.01
"""Share of the whole mass that a place is taken to carry at least"""
_LATE = 1 / 3
"""Of a segment's lead, by which a reading may be late"""
_BENT = 0.02
"""Typical of a link under the moments that move it [rad]"""


def candidates(machine: Described, training: Sequence[Recording]) -> dict[str, Candidate]:
    """All laws that find a place in the model."""
    sized = sizes(machine, training)
    found = [candidate("gravity"), *_play(machine, training), *_joints(machine, sized)]
    if machine.about.rows == MOTION:
        found += [candidate("command_delay"), *_late(machine, training), *_tendons(machine)]
        found += _saturated(machine, training)
    found += _bodies(machine, sized)
    return {each.name: _confused(each, found) for each in found}


def _confused(one: Candidate, several: Sequence[Candidate]) -> Candidate:
    """With what it can be confused among the candidates: wherever such an effect is, and itself elsewhere."""
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


def _play(machine: Described, training: Sequence[Recording]) -> Iterator[Candidate]:
    """Play of all drives that set a position alike, and of each."""
    drives = [d for d in machine.about.drive if machine.is_servo(d.actuator)]
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
    """At each hinge or slide: a spring, if the model has none, one that stiffens, and in motion friction."""
    model = machine.model
    single = np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
    joints = np.flatnonzero(single).tolist()
    if len(joints) > _MOST_PLACES:
        return
    for n in (each for each in joints if model.joint(each).name):
        name, dof = model.joint(n).name, model.jnt_dofadr[n]
        slides = model.jnt_type[n] == mujoco.mjtJoint.mjJNT_SLIDE

        def of(effect: str, parameter: str, typical: float, slides: bool = slides) -> Range:
            known = _range(effect, parameter, typical)
            return replace(known, unit=_OF_SLIDES[known.unit]) if slides else known

        if model.jnt_stiffness[n] == 0:
            spring = of("joint_elasticity", "stiffness", _SPRING * float(sized.stiffness[dof]))
            yield candidate(f"joint_elasticity@{name}", stiffness=spring)
        cubic = float(sized.stiffness[dof] / sized.turn[dof] ** 2)
        stiffening = of("joint_stiffening", "cubic", _SPRING * cubic)
        yield candidate(f"joint_stiffening@{name}", cubic=stiffening)
        if machine.about.rows == MOTION:
            force, rate = float(sized.force[dof]), float(sized.rate[dof])
            coulomb = of("hinge_friction", "coulomb", _RUBS * force)
            viscous = of("hinge_friction", "viscous", _RUBS * force / rate)
            yield candidate(f"hinge_friction@{name}", coulomb=coulomb, viscous=viscous)


def _late(machine: Described, training: Sequence[Recording]) -> Iterator[Candidate]:
    """A lag of each actuator, and of all alike; a delay of each reading, where there are others to be late
    against.
    """
    bare = [
        each.actuator
        for each in machine.about.drive
        if machine.model.actuator(each.actuator).dyntype == mujoco.mjtDyn.mjDYN_NONE
    ]
    if bare:
        yield candidate("servo_lag")
    if 1 < len(bare) <= _MOST_PLACES:
        yield from (candidate(f"servo_lag@{name}") for name in bare)
    read = list(dict.fromkeys(each.of[1] for each in machine.about.measured))
    if 1 < len(read) <= _MOST_PLACES:
        longest = _LATE * LEAD * float(np.median(np.diff(training[0].time)))
        known = effects.ranges(KNOWN["sensor_delay"])["delay"]
        delay = replace(known, high=longest, typical=min(known.typical, longest / 3))
        yield from (candidate(f"sensor_delay@{name}", delay=delay) for name in read)


def _tendons(machine: Described) -> Iterator[Candidate]:
    """Friction of each tendon, sized by the stretch that its actuator would answer with as much force."""
    model = machine.model
    by = {int(model.actuator_trnid[n, 0]): n for n in range(model.nu) if _pulls(model, n)}
    if not by or len(by) > _MOST_PLACES:
        return
    for tendon, n in by.items():
        low, high = model.actuator_ctrlrange[n]
        force = _PLAY * abs(model.actuator_gainprm[n, 0]) * max(high - low, _STILL)
        if name := model.tendon(tendon).name:
            yield candidate(
                f"tendon_friction@{name}", force=_range("tendon_friction", "force", float(force))
            )


def _pulls(model: mujoco.MjModel, actuator: int) -> bool:
    return model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON


def _saturated(machine: Described, training: Sequence[Recording]) -> Iterator[Candidate]:
    """Saturation of each actuator that is told a force."""
    model = machine.model
    told = [d for d in machine.about.drive if not machine.is_servo(d.actuator)]
    if len(told) > _MOST_PLACES:
        return
    for each in told:
        n = model.actuator(each.actuator).id
        per = abs(model.actuator_gainprm[n, 0] * model.actuator_gear[n, 0])
        peak = per * max(float(np.abs(run.columns[each.column]).max()) for run in training)
        if peak > 0:
            rate = _range("torque_saturation", "rate", _RUBS / peak)
            yield candidate(f"torque_saturation@{each.actuator}", rate=rate)


def _range(effect: str, parameter: str, typical: float) -> Range:
    """The range of a strength of some typical size."""
    known, wide = effects.ranges(KNOWN[effect])[parameter], _WIDE * typical
    return replace(known, typical=typical, low=-wide if known.low < 0 else known.low, high=wide)


def _bodies(machine: Described, sized: Sizes) -> Iterator[Candidate]:
    """A mass and a force at each measured site, and at the origin of each body that the joints move; and that
    body's bending and twisting.
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

    for each in machine.about.measured:
        if each.site:
            site = model.site(each.site).id
            place(each.site, int(model.site_bodyid[site]), data.site_xpos[site])
    for n in range(1, model.nbody):
        place(model.body(n).name, n, data.xpos[n])
    places = list(lever) if len(lever) <= _MOST_PLACES else list(lever)[:1]
    for name in places:
        carried = max(model.body_subtreemass[carrier[name]], _LIGHT * model.body_subtreemass[0])
        yield from _pulled(machine, name, float(carried), lever[name], sized)
    links = [n for n in range(1, model.nbody) if model.body_jntnum[n] and model.body(n).name]
    if len(links) <= _MOST_PLACES and all(model.joint(n).name for n in range(model.njnt)):
        for n in links:
            moment = float(sized.force[model.body_dofadr[n]])
            more = {
                which: _range("link_flex", which, _BENT / moment)
                for which in ("compliance", "twist")
            }
            yield candidate(f"link_flex@{model.body(n).name}", **more)


def _pulled(
    machine: Described, name: str, carried: float, lever: Array, sized: Sizes
) -> Iterator[Candidate]:
    """A mass, if there is gravity, and a force, at a place that moves so far with each joint."""
    if machine.model.opt.gravity.any():
        nowhere = replace(effects.ranges(KNOWN["payload"])["place"], typical=0.0, fitted=False)
        mass = _range("payload", "mass", _LOAD * carried)
        yield candidate(f"payload@{name}", mass=mass, place=nowhere)
    moved = lever > _STILL
    force = _RUBS * float(np.median(sized.force[moved] / lever[moved]))
    each = {f"along_{axis}": _range("constant_force", f"along_{axis}", force) for axis in "xyz"}
    nowhere = replace(effects.ranges(KNOWN["constant_force"])["place"], typical=0.0, fitted=False)
    yield candidate(f"constant_force@{name}", **each, place=nowhere)
