"""List the laws that act on a model's state in motion, sized by the model and by its logs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco.batch import Batch

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import KNOWN, Range
from serpent_twin.effects.strands import ALIKE
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.relaxed import relax
from serpent_twin.machines.model.seen import address
from serpent_twin.machines.model.sizes import Sizes, given, of_joint, sized_candidate, sized_range
from serpent_twin.machines.model.springs import Springs, single_joints
from serpent_twin.machines.model.starts import angle_of, left_to_rest, measured_joints
from serpent_twin.machines.model.state_effects import state_driven
from serpent_twin.machines.model.state_moment import JOINT, TENDON
from serpent_twin.machines.model.state_places import springs_at
from serpent_twin.machines.model.things import lengths, tendon_levers
from serpent_twin.tables.log import Log

_MOST = 500  # rows that are looked at
_RUBS, _SLOW = 0.1, 0.2
"""Typical of what a joint rubs more near rest, of the force that moves it; of the speed below which, of its
rate
"""
_FADES, _SLIPS = 0.1, 0.1
"""Typical of a stiffness that is lost in a session; of a stretch that slips in one"""
_GRIPS = (0.6, 0.35, 0.85)
"""Where fits of the tension above which a clamp slips start, of the greatest"""
_LIMITED = (1.0, 0.5, 0.25)
"""Multiples of the reciprocal of the usual force, at which a force limit is scored: a limit far below the
forces of the logs stalls the joint, and one above them does nothing
"""
_CREEPS, _LATE = 0.2, 2.0
"""Time constants of creep, typical and longest, as multiples of a session's duration"""
_WARMS, _WARM = 0.3, 0.5
"""Time constants of warming, typical and longest, as shares of a session's duration: friction that falls more
slowly cannot be distinguished from constant friction
"""
_TOLD, _LEAST = 0.02, 1e-6
"""Typical of the stretch that a tendon's actuator answers with as much force as friction has, of its range;
range of an actuator [m] and lever of a joint [m/rad] that has one
"""
_STIFFENS = 0.5
"""Typical of a tendon's stiffness, by which its typical stretch raises it"""
_LONG = 25.0
"""Session from which on what is slow can show [s]: five of creep's shortest time constants"""


def laws_of_state(machine: Described, training: Sequence[Log], of: Sizes) -> Iterator[Candidate]:
    """Friction of joints that falls with speed, or while they warm up; of tendons, friction by their tension,
    and clamps that slip; creep of tendons and of drives; and what softens.
    """
    model = machine.model
    held = {each.joint for each in machine.prescribed} - {*machine.efforts}
    joints = {name: n for n in single_joints(model) if (name := model.joint(int(n)).name)}
    joints = {name: n for name, n in joints.items() if name not in held}
    force, rate = (
        {name: float(each[model.jnt_dofadr[n]]) for name, n in joints.items()}
        for each in (of.force, of.rate)
    )
    lasts = [float(run.time[-1] - run.time[0]) for run in training]
    seconds, slow_shows = float(np.median(lasts)), max(lasts) >= _LONG
    known = effects.ranges(KNOWN["stribeck"])["velocity"]
    for name in joints:
        fast = rate[name]
        slow = replace(known, low=0.02 * fast, typical=_SLOW * fast, high=fast)
        yield sized_candidate(model, f"stribeck@{name}", extra=_RUBS * force[name], velocity=slow)
    if slow_shows:
        time = _of_session("friction_warming", _WARMS, _WARM, seconds)
        for name in joints:
            yield sized_candidate(
                model, f"friction_warming@{name}", extra=_RUBS * force[name], time=time
            )
    rigid = {
        n: given("cable_friction", n) for n in ("transition_velocity", "by_bend", "presliding")
    }
    rigid |= {
        "coefficient": effects.ranges(KNOWN["cable_friction"])["coefficient"],
        "strand": ALIKE,
    }
    loads = _loads(machine, training)
    kinds = (TENDON, JOINT, "drive")
    for each in sorted(loads, key=lambda each: kinds.index(each.kind)):
        if each.kind == TENDON and each.tension.any():
            yield candidate(f"cable_friction@{each.name}", **rigid)
        if each.stiffness and each.stretch.any() and slow_shows:
            yield from _slow(model, each, seconds)


def _of_session(effect: str, typical: float, most: float, seconds: float) -> Range:
    """The range of an effect's time constant, by shares of a session's duration [s]."""
    known = effects.ranges(KNOWN[effect])["time"]
    return replace(known, typical=typical * seconds, high=most * seconds)


@dataclass(frozen=True)
class _Load:
    """What a spring bears in a machine's logs."""

    kind: str
    name: str
    stiffness: float
    tension: Array
    """[N or N m], in some rows"""
    stretch: Array
    """[m or rad]"""


def _slow(model: mujoco.MjModel, load: _Load, seconds: float) -> Iterator[Candidate]:
    """Creep, slip and softening of what pulls by so much."""
    name, kind = load.name, load.kind
    if kind != JOINT:
        time = _of_session("cable_creep", _CREEPS, _LATE, seconds)
        yield candidate(f"cable_creep@{name}", time=time, strand=ALIKE)
    if kind == TENDON and load.tension.max() > 0:
        yield _slipping(load, seconds)
    if kind != "drive":
        rate = _FADES * 3600.0 / seconds
        yield sized_candidate(
            model, f"stiffness_drift@{name}", rate=rate, carries=_RECOVERS, strand=ALIKE
        )


def _slipping(load: _Load, seconds: float) -> Candidate:
    """Slip of a tendon's clamp, which is found from grips near the tension at which it begins only."""
    most, starts = float(load.tension.max()), []
    for grip in (share * most for share in _GRIPS):
        excess = float(np.mean(np.maximum(load.tension - grip, 0.0)))
        slips = _SLIPS * float(np.abs(load.stretch).max()) / (excess * seconds)
        starts.append(np.array([slips, grip, ALIKE.typical]))
    known = effects.ranges(KNOWN["clamp_slip"])["grip"]
    grip = replace(known, typical=float(starts[0][1]), high=most)
    rate = replace(sized_range("clamp_slip", "rate", float(starts[0][0])), limit="")
    found = candidate(f"clamp_slip@{load.name}", rate=rate, grip=grip, strand=ALIKE)
    return replace(found, variants=tuple(starts))


_RECOVERS = Range("1", 0.0, 0.0, 0.0, fitted=False)
"""No log says what ran before its session"""


def _loads(machine: Described, training: Sequence[Log]) -> list[_Load]:
    """What each named spring of the nominal model bears in the logs at rest. A joint that nothing measures is
    where runs begin. Where sites place joints, those without a column come to rest between the others: in
    the poses of the sites stiff springs would bear all the errors of the model's lengths.
    """
    model = machine.model
    rows = [
        (run, t)
        for run in training
        for t in range(0, len(run), len(run) * len(training) // _MOST + 1)
    ]
    batch = Batch(model, len(rows), 1)
    pose, control = batch.bind("qpos"), batch.bind("ctrl")
    several = springs_at(model, {""})
    springs = Springs(batch, several)
    pose[...] = machine.begin
    for n, (run, t) in enumerate(rows):
        for joint in measured_joints(machine):
            pose[n, address(model, joint)] = run.columns[angle_of(joint)][t]
        for drive in machine.commanded:
            control[n, model.actuator(drive.actuator).id] = run.columns[drive.column][t]
    relax(batch, left_to_rest(machine, machine.read_joints))
    batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
    stretch, told = springs.state(np.zeros((len(rows), model.nv)))
    tension = np.clip(springs.stiffness * stretch + told, *springs.limits)
    return [
        _Load(kind, name, float(springs.stiffness[0, k]), tension[:, k], stretch[:, k])
        for k, (kind, name) in enumerate(several)
    ]


def rubbing_tendons(machine: Described) -> Iterator[Candidate]:
    """Friction of each tendon with an actuator, sized by the stretch that this would answer with as much
    force.
    """
    model = machine.model
    told = [model.actuator(each.actuator).id for each in machine.commanded]
    pulls = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    by = {int(model.actuator_trnid[n, 0]): n for n in told if pulls[n]}
    for tendon, n in by.items():
        low, high = model.actuator_ctrlrange[n]
        force = _TOLD * abs(model.actuator_gainprm[n, 0]) * max(high - low, _LEAST)
        if name := model.tendon(tendon).name:
            yield sized_candidate(model, f"tendon_friction@{name}", force=float(force))


def stiffening_tendons(machine: Described, of: Sizes) -> Iterator[Candidate]:
    """Stiffening of each tendon with a spring, sized by how far the least force that moves one of its joints
    stretches it.
    """
    model, data = machine.model, mujoco.MjData(machine.model)
    data.qpos[:] = machine.begin
    mujoco.mj_forward(model, data)
    levers = np.abs(tendon_levers(model, data))
    for n in np.flatnonzero(model.tendon_stiffness).tolist():
        lever = levers[n]
        moved, name = lever > _LEAST, model.tendon(n).name
        if not (moved.any() and name):
            continue
        pull = np.min(of.force[moved] / lever[moved])
        stretch = float(pull / model.tendon_stiffness[n])
        rate = sized_range("cable_stiffening", "rate", _STIFFENS / stretch)
        unit = "1/rad" if "rad" in lengths(model, "tendon", name) else rate.unit
        yield candidate(f"cable_stiffening@{name}", rate=replace(rate, unit=unit), strand=ALIKE)


def saturated(machine: Described, training: Sequence[Log], of: Sizes) -> Iterator[Candidate]:
    """Saturation of each actuator that is commanded a force, and of each DC motor of a joint."""
    model, motors = machine.model, state_driven(machine.model)
    told = [
        d for d in machine.commanded if d.actuator in motors or not machine.is_servo(d.actuator)
    ]
    for each in told:
        n = model.actuator(each.actuator).id
        if each.actuator in motors:
            peak = float(of.force[model.jnt_dofadr[model.actuator_trnid[n, 0]]])
        else:
            per = abs(model.actuator_gainprm[n, 0] * model.actuator_gear[n, 0])
            peak = per * max(float(np.abs(run.columns[each.column]).max()) for run in training)
        if peak > 0:
            yield sized_candidate(model, f"torque_saturation@{each.actuator}", rate=_RUBS / peak)


def weak(machine: Described, of: Sizes) -> Iterator[Candidate]:
    """Force limit of each servo of a joint; commands of a force would have the limit in them."""
    model = machine.model
    for each in machine.commanded:
        n = model.actuator(each.actuator).id
        servo = model.actuator_biasprm[n, 1:3].any() and model.actuator_gear[n, 0]
        if servo and model.actuator_trntype[n] == mujoco.mjtTrn.mjTRN_JOINT:
            joint = int(model.actuator_trnid[n, 0])
            usual = float(of.force[model.jnt_dofadr[joint]]) / abs(model.actuator_gear[n, 0])
            limit = of_joint(model, joint, sized_range("force_limit", "reciprocal", 1 / usual))
            found = candidate(f"force_limit@{each.actuator}", reciprocal=limit)
            several = tuple(by * found.variants[0] for by in _LIMITED)
            yield replace(found, variants=several)
