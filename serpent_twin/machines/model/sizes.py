"""Measure how large forces and rates are in a machine's logs, by which effects and priors are sized."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import KNOWN, Range, law_of, place_of
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.from_sites import placed_joints
from serpent_twin.machines.model.numbers import OF_SLIDES
from serpent_twin.machines.model.starts import angle_of, measured_joints, rate_of
from serpent_twin.machines.model.things import OBJECTS, names
from serpent_twin.tables.log import Log

_MOST = 2000  # rows that are looked at
_TURN = 0.1  # [rad] typical of a joint whose motion is not measured
_RATE = 1.0  # [rad/s]
_DIFFERENCE = 1e-6
_LEAST = 1e-9
_STILL = 1e-3  # [rad], [rad/s], [rad/s²] of a joint that does not move
_WIDE = 20.0
"""Bound of a range, as a multiple of the typical value"""


@dataclass(frozen=True)
class Sizes:
    """Typical values at each degree of freedom, (nv,) each, and what each body carries."""

    force: Array
    """What moves it [N m or N]"""
    rate: Array
    """How fast it moves [rad/s or m/s]"""
    turn: Array
    """How far [rad or m]"""
    stiffness: Array
    """Change of the force that it takes to hold it still with its angle, where runs begin [N m/rad or N/m]"""
    moment: Array
    """Moment about all axes that each body's parent gives it at the origin of its frame [N m], (nbody,)"""
    carried: Array
    """Force that each body's parent gives it [N], (nbody,)"""


def sizes(machine: Described, training: Sequence[Log]) -> Sizes:
    """Typical values along the logs; of joints whose motion is prescribed as logged, if their torque is."""
    found = _of_model(machine, training)
    for drive in machine.prescribed:
        if not (of := machine.efforts.get(drive.joint)):
            continue
        dof = machine.model.joint(drive.joint).dofadr[0]
        angle, effort = (
            [run.columns[n] for run in training] for n in (drive.column, of.columns[0])
        )
        rate = [np.gradient(a, run.time) for a, run in zip(angle, training, strict=True)]
        each = (effort, found.force), (rate, found.rate), (angle, found.turn)
        for several, values in each:
            values[dof] = max(np.sqrt(np.nanmean(np.concatenate(several) ** 2)), _STILL)
    return found


def _of_model(machine: Described, training: Sequence[Log]) -> Sizes:
    """Typical values of the nominal model along the logs: as its joints are measured, else as it moves by
    itself, as accelerations derived from sites would be noise; for poses, where the search for them begins.
    """
    model, data = machine.model, mujoco.MjData(machine.model)
    stiffness = _stiffness(machine, data)
    joints = {} if placed_joints(machine) else measured_joints(machine)
    if not machine.about.moves:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = machine.begin
        mujoco.mj_inverse(model, data)
        usual = np.full(model.nv, _RATE), np.full(model.nv, _TURN)
        return Sizes(_TURN * stiffness, *usual, stiffness, *_carried(model, data))
    if not joints:
        force, rate, turn, carried = _moved(machine, training)
        force = np.maximum(force, _TURN * stiffness)
        return Sizes(force, rate, turn, np.maximum(stiffness, force / turn), *carried)
    order = [int(model.joint(name).dofadr[0]) for name in joints]
    forces, rates, turns, loads = [], [], [], []
    for run in training:
        angle, rate = (
            np.array([run.columns[of(j)] for j in joints]).T for of in (angle_of, rate_of)
        )
        change = np.gradient(rate, run.time, axis=0)
        for t in range(0, len(run), max(1, len(run) * len(training) // _MOST)):
            data.qpos[order], data.qvel[order], data.qacc[order] = angle[t], rate[t], change[t]
            mujoco.mj_inverse(model, data)
            loads.append(_carried(model, data))
            forces.append(data.qfrc_inverse.copy())
            rates.append(data.qvel.copy())
            turns.append(np.zeros(model.nv))
            turns[-1][order] = angle[t]
    force, rate, turn, carried = map(_rms, (forces, rates, turns, loads))
    turn, rate = np.maximum(turn, _STILL), np.maximum(rate, _STILL)
    force = np.maximum(force, _STILL * model.dof_M0)
    return Sizes(force, rate, turn, np.maximum(stiffness, force / turn), *carried)


def _rms(rows: Sequence[Array]) -> Array:
    """Root mean squares over rows."""
    return np.sqrt(np.mean(np.square(rows), axis=0))


def _carried(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The moment that each body's parent gives it about the origin of the body's frame [N m], whichever way
    its own joints turn, and the force [N], (2, nbody). MuJoCo has moments about the whole tree's centre of
    mass.
    """
    mujoco.mj_rnePostConstraint(model, data)
    force = data.cfrc_int[:, 3:]
    centre = data.subtree_com[model.body_rootid]
    moment = data.cfrc_int[:, :3] + np.cross(centre - data.xpos, force)
    return np.linalg.norm([moment, force], axis=2)


def _moved(machine: Described, training: Sequence[Log]) -> tuple[Array, Array, Array, Array]:
    """Root mean squares of the greatest force, the rate and the way of each degree of freedom, (nv,) each,
    and of what bodies carry, (2, nbody), as the nominal model moves from where runs begin; what does not
    move, or becomes unstable, has usual ones.
    """
    model, data = machine.model, mujoco.MjData(machine.model)
    drives = [(model.actuator(each.actuator).id, each.column) for each in machine.commanded]
    forces, rates, ways, loads = [], [], [], []
    for run in training:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = machine.begin
        steps = max(1, round(run.period / model.opt.timestep))
        for t in range(min(len(run), max(1, _MOST // len(training)))):
            for n, column in drives:
                data.ctrl[n] = run.columns[column][t]
            mujoco.mj_step(model, data, steps)
            parts = np.array([data.qfrc_actuator, data.qfrc_passive, data.qfrc_bias])
            way = np.empty(model.nv)
            mujoco.mj_differentiatePos(model, way, 1.0, machine.begin, data.qpos)
            loads.append(_carried(model, data))
            forces.append(np.abs(parts).max(axis=0))
            rates.append(data.qvel.copy())
            ways.append(way)
    found = [_rms(each) for each in (forces, rates, ways)]
    usual = (_STILL * model.dof_M0, _RATE, _TURN)
    force, rate, way = (
        np.where(np.isfinite(each) & (each > _STILL * other), each, other)
        for each, other in zip(found, usual, strict=True)
    )
    carried = _rms(loads)
    return force, rate, way, np.where(np.isfinite(carried), carried, 0.0)


def _stiffness(machine: Described, data: mujoco.MjData) -> Array:
    model, found = machine.model, np.empty(machine.model.nv)
    for n in range(model.nv):
        forces = []
        for side in (-_DIFFERENCE, _DIFFERENCE):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.ctrl[:] = machine.begin, machine.keyframe_controls
            step = np.zeros(model.nv)
            step[n] = side
            mujoco.mj_integratePos(model, data.qpos, step, 1.0)
            mujoco.mj_forward(model, data)
            forces.append(data.qfrc_smooth[n])
        found[n] = abs(forces[1] - forces[0]) / (2 * _DIFFERENCE)
    return np.maximum(found, _LEAST)


def sized_range(effect: str, parameter: str, typical: float) -> Range:
    """The range of a strength of some typical size."""
    known, wide = effects.ranges(KNOWN[effect])[parameter], _WIDE * typical
    return replace(known, typical=typical, low=-wide if known.low < 0 else known.low, high=wide)


def of_joint(model: mujoco.MjModel, joint: str | int, known: Range) -> Range:
    """A range of a law of hinges, at a hinge or a slide of the model."""
    slides = model.joint(joint).type[0] == mujoco.mjtJoint.mjJNT_SLIDE
    return replace(known, unit=OF_SLIDES.get(known.unit, known.unit)) if slides else known


def given(effect: str, parameter: str, value: float = 0.0) -> Range:
    """The range of a parameter that is not fitted."""
    return replace(effects.ranges(KNOWN[effect])[parameter], typical=value, fitted=False)


def sized_candidate(model: mujoco.MjModel, name: str, **known: float | Range) -> Candidate:
    """An effect of a model's machine, its strengths of typical sizes, or its parameters in ranges."""
    effect, place = law_of(name), place_of(name)
    own = {n: r if isinstance(r, Range) else sized_range(effect, n, r) for n, r in known.items()}
    if place and "joint" in KNOWN[effect].places and place in names(model, OBJECTS["joint"]):
        own = {n: of_joint(model, place, r) for n, r in own.items()}
    return candidate(name, **own)
