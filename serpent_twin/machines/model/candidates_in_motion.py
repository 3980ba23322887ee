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
from serpent_twin.machines.measured import Recording
from serpent_twin.machines.model.description import Described
from serpent_twin.machines.model.seen import address
from serpent_twin.machines.model.sizes import Sizes, of_joint, sized_range
from serpent_twin.machines.model.springs import Spring, single_joints
from serpent_twin.machines.model.starts import angle_of, measured_joints
from serpent_twin.machines.model.state_laws import springs_at
from serpent_twin.machines.model.state_moment import JOINT, TENDON

_MOST = 500  # rows that are looked at
_RUBS, _SLOW = 0.1, 0.2
"""Typical of what a joint rubs more near rest, of the force that moves it; of the speed below which, of its
rate
"""
_FADES, _SLIPS = 0.1, 0.1
"""Typical of a stiffness that is lost in a session; of a stretch that slips in one"""
_GRIPS = (0.6, 0.35, 0.85)
"""Where fits of the tension above which a clamp slips start, of the greatest"""
_CREEPS, _LATE = 0.2, 2.0
"""Of a session's duration, a time constant of creep: typical and longest"""
_WARMS, _WARM = 0.3, 0.5
"""And one of warming: what falls more slowly is not told from friction that stays"""
_LONG = 25.0
"""Session from which on what is slow can show [s]: five of creep's shortest time constants"""


def laws_of_state(
    machine: Described, training: Sequence[Recording], sized: Sizes
) -> Iterator[Candidate]:
    """Friction of joints that falls with speed, or while they warm up; of tendons, friction by their tension,
    and clamps that slip; creep of tendons and of drives; and what softens.
    """
    model = machine.model
    joints = [model.joint(int(n)).name for n in single_joints(model)]
    seconds = float(np.median([run.time[-1] - run.time[0] for run in training]))
    yield from (_stribeck(machine, name, sized) for name in joints if name)
    if seconds >= _LONG:
        yield from (_warming(machine, name, sized, seconds) for name in joints if name)
    loads = _loads(machine, training)
    kinds = (TENDON, JOINT, "drive")
    for each in sorted(loads, key=lambda each: kinds.index(each.kind)):
        if each.kind == TENDON and each.tension.any():
            yield _rubbing(each.name)
        if each.stiffness and each.stretch.any() and seconds >= _LONG:
            yield from _slow(each, seconds)


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


def _stribeck(machine: Described, name: str, sized: Sizes) -> Candidate:
    """Friction near rest, of a joint whose speed passes where it falls."""
    dof = int(machine.model.joint(name).dofadr[0])
    force, rate = float(sized.force[dof]), float(sized.rate[dof])
    known = effects.ranges(KNOWN["stribeck"])["velocity"]
    slow = replace(known, low=0.02 * rate, typical=_SLOW * rate, high=rate)
    extra = sized_range("stribeck", "extra", _RUBS * force)
    slow, extra = (of_joint(machine.model, name, each) for each in (slow, extra))
    return candidate(f"stribeck@{name}", extra=extra, velocity=slow)


def _warming(machine: Described, name: str, sized: Sizes, seconds: float) -> Candidate:
    """Friction that is greater while a joint is cold, of a session that lasts so long [s]."""
    force = float(sized.force[int(machine.model.joint(name).dofadr[0])])
    known = effects.ranges(KNOWN["friction_warming"])["time"]
    time = replace(known, typical=_WARMS * seconds, high=_WARM * seconds)
    extra = sized_range("friction_warming", "extra", _RUBS * force)
    return candidate(
        f"friction_warming@{name}", extra=of_joint(machine.model, name, extra), time=time
    )


def _rubbing(name: str) -> Candidate:
    """Friction of a tendon, which sticks and is the same at every angle."""
    known = effects.ranges(KNOWN["cable_friction"])
    fixed = {
        each: replace(known[each], typical=0.0, fitted=False)
        for each in ("transition_velocity", "by_bend", "presliding")
    }
    of = known["coefficient"]
    return candidate(f"cable_friction@{name}", coefficient=of, strand=ALIKE, **fixed)


def _slow(load: _Load, seconds: float) -> Iterator[Candidate]:
    """Creep, slip and softening of what pulls by so much."""
    name, kind = load.name, load.kind
    if kind != JOINT:
        known = effects.ranges(KNOWN["cable_creep"])["time"]
        time = replace(known, typical=_CREEPS * seconds, high=_LATE * seconds)
        yield candidate(f"cable_creep@{name}", time=time, strand=ALIKE)
    if kind == TENDON and load.tension.max() > 0:
        yield _slipping(load, seconds)
    if kind != "drive":
        rate = sized_range("stiffness_drift", "rate", _FADES * 3600.0 / seconds)
        yield candidate(f"stiffness_drift@{name}", rate=rate, carries=_RECOVERS, strand=ALIKE)


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


def _loads(machine: Described, training: Sequence[Recording]) -> list[_Load]:
    """What each named spring of the nominal model bears in the logs at rest; joints that are not measured are
    where runs begin.
    """
    model = machine.model
    rows = [
        (run, t)
        for run in training
        for t in range(0, len(run), len(run) * len(training) // _MOST + 1)
    ]
    batch = Batch(model, len(rows), 1)
    pose, control = batch.bind("qpos"), batch.bind("ctrl")
    springs = [(kind, name, Spring(batch, kind, name)) for kind, name in springs_at(model, {""})]
    pose[...] = machine.begin
    for n, (run, t) in enumerate(rows):
        for joint in measured_joints(machine):
            pose[n, address(model, joint)] = run.columns[angle_of(joint)][t]
        for drive in machine.commanded:
            control[n, model.actuator(drive.actuator).id] = run.columns[drive.column][t]
    batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
    found = []
    for kind, name, spring in springs:
        _, _, stretch, told = spring.state(np.zeros((len(rows), model.nv)))
        tension = np.clip(spring.stiffness * stretch + told, *spring.limits)
        found.append(_Load(kind, name, float(spring.stiffness[0]), tension, stretch))
    return found
