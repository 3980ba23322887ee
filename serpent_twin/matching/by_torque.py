"""Match torques or currents to the joints whose every angle is read, where no column is a command.

The model says by inverse dynamics which torque the motion needs. What is measured, regressed on that and on
friction, says the sign, and by how much a gear or a torque constant is missing.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.model.known_motion import STANDING
from serpent_twin.matching import by_name
from serpent_twin.matching.matches import Matches
from serpent_twin.matching.robot import FORCE
from serpent_twin.matching.trials import Use
from serpent_twin.matching.units import Meaning, is_of
from serpent_twin.matching.words import COMMAND, EFFORT, POSITION, READING, VELOCITY
from serpent_twin.matching.write import Entry
from serpent_twin.tables.smoothing import cutoff, smoothed

_TELLS = 0.5
"""Least correlation of a measured torque with the model's, beside friction, that tells its sign"""
_AS_IT_IS = 2.0
"""Factor within which a torque is that of the joint: a model may be so much too light"""


@dataclass(frozen=True)
class _Told:
    """What the model says of a measured torque."""

    factor: float
    """Torque that the model needs over what is measured"""
    correlation: float
    """Correlation of both, beside friction and an offset"""


def match(found: Matches) -> list[Entry]:
    """The tables of machine.toml where rows are of torque; none where logs are of another kind: a command is
    among them, an angle is missing, or no torque is measured.
    """
    robot, named = found.robot, found.logged.names
    commands = {each.quantity for each in named.values() if each.direction == COMMAND}
    motors = any(each.kind == FORCE for each in robot.actuators)
    if commands & {POSITION, VELOCITY, "", *([EFFORT] if motors else [])}:
        return []
    efforts = by_name.efforts(robot, named)
    readings = by_name.readings(robot, named, [*efforts.column.values()])
    several = [named[column] for column in efforts.column.values()]
    if not several or (motors and not all(c.is_current or c.direction == READING for c in several)):
        return []  # each may be what its motor was told
    if motors and len(several) < len(robot.joints):
        return []  # some joints swing freely: their motion is simulated
    if not len(readings.column) == len(robot.joints) == robot.model.njnt:
        return []
    columns = readings.column.items()
    known = {j: use for j, column in columns if (use := found.reading_of(j, column))}
    if len(known) < len(columns):
        return []
    found.add(found.readings, readings)
    found.add(found.efforts, efforts)
    return [*_angles(found, known), *_torques(found, known)]


def _angles(found: Matches, motion: Mapping[str, Use]) -> Iterator[Entry]:
    """The tables of the joints' angles."""
    for joint, (column, factor) in motion.items():
        units = found.units.of_reading(joint, column)
        unit, sign = units.believed[0], 1 if factor > 0 else -1
        found.say(column, units.words[unit])
        doubts = [] if units.stated or len(units.believed) == 1 else [f"whether it is in {unit}"]
        why = "; ".join(found.why[column])
        yield Entry("measured", ("joint", joint), column, Meaning(unit, sign), why, doubts)


def _torques(found: Matches, motion: Mapping[str, Use]) -> Iterator[Entry]:
    """The tables of the joints' torques."""
    told = _compared(found, motion)
    for joint, column in found.efforts.items():
        name, hinge = found.logged.names[column], found.robot.joint(joint).hinge
        usual, needs = "N m" if hinge else "N", told[joint]
        unit = name.unit if is_of(name.unit, usual) else usual
        factor = needs.factor / Meaning(unit).factor
        tells = abs(needs.correlation) > _TELLS
        sign, scale, doubts = -1 if tells and factor < 0 else 1, 1.0, list[str]()
        if not tells:
            found.say(column, "its sign is not told: the model needs little torque there")
        elif 1 / _AS_IT_IS < abs(factor) < _AS_IT_IS and not name.is_current:
            found.say(column, f"the model needs {abs(factor):.2g} times as much")
        else:
            scale = float(f"{abs(factor):.3g}")
            doubts = [
                f"by what {column!r} is to be multiplied: the model needs {scale:g} times as much, as where "
                "a gear or a torque constant is missing, if its masses are right"
            ]
        if name.is_current and not tells:
            doubts = [f"the torque constant of {column!r}, with the gear, as scale [{usual}/A]"]
        why = "; ".join(found.why[column])
        meaning = Meaning(unit, sign, scale)
        yield Entry("measured", ("joint", joint), column, meaning, why, doubts, what="torque")


def _compared(found: Matches, motion: Mapping[str, Use]) -> dict[str, _Told]:
    """What the model says of each torque that is measured, by its joint."""
    needed, rates, given = [list[Array]() for _ in range(3)]
    model, logged = found.robot.model, found.logged
    joints = [*motion]
    pose, speed = (
        [int(of[model.joint(name).id]) for name in joints]
        for of in (model.jnt_qposadr, model.jnt_dofadr)
    )
    hz = [
        cutoff([factor * each.values[column] for each in logged.pieces], logged.pieces[0].period)
        for column, factor in motion.values()
    ]
    for each in logged.pieces:
        angle = np.stack([f * each.values[c] for c, f in motion.values()], axis=1)
        moved = smoothed(angle, each.period, hz)
        rows = slice(moved.edge, len(angle) - moved.edge)
        torque = _needed(
            model, pose, speed, moved.angle[rows], moved.rate[rows], moved.acceleration[rows]
        )
        needed.append(torque)
        rates.append(moved.rate[rows])
        given.append(np.stack([each.values[c][rows] for c in found.efforts.values()], axis=1))
    need, rate, measured = (np.concatenate(each) for each in (needed, rates, given))
    out = {}
    for n, joint in enumerate(found.efforts):
        k = joints.index(joint)
        out[joint] = _beside_friction(need[:, k], rate[:, k], measured[:, n])
    return out


def _needed(
    model: mujoco.MjModel, pose: list[int], speed: list[int], q: Array, v: Array, a: Array
) -> Array:
    """Torques of joints by inverse dynamics, (T, J), of their angles, rates and accelerations."""
    data, out = mujoco.MjData(model), np.empty_like(q)
    for t in range(len(q)):
        data.qpos[pose], data.qvel[speed], data.qacc[speed] = q[t], v[t], a[t]
        mujoco.mj_inverse(model, data)
        out[t] = data.qfrc_inverse[speed]
    return out


def _beside_friction(need: Array, rate: Array, measured: Array) -> _Told:
    """What a needed torque and a measured one have in common, (T,) each, beside friction and an offset."""
    others = np.stack([np.ones_like(rate), rate, np.tanh(rate / STANDING)], axis=1)

    def left(values: Array) -> Array:
        return np.asarray(values - others @ np.linalg.lstsq(others, values)[0])

    one, other = left(need), left(measured)
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    common = float(one @ other)
    if size <= 0 or common == 0:
        return _Told(1.0, 0.0)
    return _Told(float(one @ one) / common, common / size)
