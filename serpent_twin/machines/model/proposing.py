"""Propose motions of a model's machine, each simulated by its twin from rest."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import Output, ParameterVector
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import POSES, MeasuredColumns
from serpent_twin.machines.model.full_rate import held
from serpent_twin.machines.model.limits import allowed, require_moving, unmeasured_joints
from serpent_twin.machines.model.log_file import as_logged
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.motion import StartGains
from serpent_twin.machines.model.motions import OF_MOTION, OF_POSES, commands
from serpent_twin.machines.model.poses import Rests
from serpent_twin.machines.model.seen import address
from serpent_twin.machines.model.starts import (
    LEAD,
    angle_of,
    measured_joints,
    rate_of,
    reading_of,
    with_starts,
)
from serpent_twin.machines.proposals import CommandColumn, Proposals, kept_ones
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments
from serpent_twin.units import TO_SI

_POSES, _FEWEST_ROWS, _MOST_ROWS = 20, 4 * LEAD, 2000
"""Rows of a piece: of poses, and of a motion"""
_REST = 0.2
"""Share of a piece of motion at its end, in which the machine comes to rest again"""
_SHARES = (1.0, 0.5, 0.25)
"""Fraction of a drive's range in the logs, to either side, in each turn of tries"""
_STILL = 0.05
"""Fraction of a channel's range in the logs, within which the twin is at rest"""


def propose(
    machine: ModelMachine,
    point: ParameterVector,
    count: int,
    seconds: float,
    rate_hz: float,
    rng: np.random.Generator,
) -> Proposals[Segments]:
    """Up to `count` motions, no longer than the longest log, or lists of poses."""
    described, logged = machine.described, machine.logged
    if described.prescribed:
        raise SerpentError(
            f"{described.path} prescribes the motion of {described.prescribed[0].of[1]}, which no drive "
            "commands. Plan with a machine.toml that names the actuators instead."
        )
    require_moving(described, logged)
    poses = described.about.rows == POSES
    longest = min(round(seconds * rate_hz), logged.rows, _MOST_ROWS)
    rows = _POSES if poses else max(_FEWEST_ROWS, longest)
    rests = (1, 1) if poses else (LEAD, round(_REST * rows))
    shapes = OF_POSES if poses else OF_MOTION

    def make(kind: str, turn: int) -> Array:
        return commands(shapes[kind], logged, _SHARES[turn], rows, rests, rng)

    def keep(targets: Sequence[Array], tried: int) -> list[tuple[Log | None, str]]:
        return _logs(machine, point, np.array(targets), 1 / rate_hz, tried)

    kinds, targets, logs = kept_ones([*shapes], count, make, keep, f"{machine.name}'s")
    clock = described.about.time
    return Proposals(
        kinds,
        tuple(_columns(machine, rate_hz)),
        _as_logged(machine, targets),
        machine.pieces(logs),
        _about(machine),
        (clock.column, clock.seconds) if clock else None,
    )


def _logs(
    machine: ModelMachine, point: ParameterVector, targets: Array, period: float, tried: int
) -> list[tuple[Log | None, str]]:
    """What a twin makes of motions (M, T, D), of which the first has a number, each from rest; nothing, and
    why, where it leaves the limits.
    """
    about, watched = machine.described.about, _watched(machine)
    settling = 0 if about.rows == POSES else targets.shape[1]
    home = np.tile(machine.logged.home, (len(targets), settling, 1))
    told = np.concatenate([home, targets], axis=1)
    found = watched.respond([point], _runs(machine, watched.described, told, period))[0]
    ends, names = allowed(machine.described, machine.logged), [e.name for e in watched.outputs]
    still, out = _STILL * np.ptp(machine.logged.shown, axis=0), []
    for n, each in enumerate(found):
        why = _beyond(each[settling:], ends, names)
        why = why or (_restless(each[settling - LEAD :], still, names) if settling else "")
        log = _log(machine, f"motion {tried + n + 1}", told[n], each, settling, period)
        out.append((None, why) if why else (log, ""))
    return out


def _watched(machine: ModelMachine) -> ModelMachine:
    """Copy of a machine that also measures the joints with a range that its logs lack."""
    described = machine.described
    joints = unmeasured_joints(described).items()
    more = [MeasuredColumns((joint,), unit, joint=joint) for joint, unit in joints]
    measured = (*described.about.measured, *more)
    about = msgspec.structs.replace(described.about, measured=measured)
    return replace(
        machine,
        described=replace(described, about=about),
        outputs=(*machine.outputs, *(Output(each.joint, each.measure, 1.0) for each in more)),
        rests=Rests(),
        gains=StartGains(),
    )


def _runs(machine: ModelMachine, watched: Described, told: Array, period: float) -> Segments:
    """Runs in which the drives are told something, (M, T, D), from the middle of what the logs showed of the
    joints; from where the model's runs begin, if the logs lack some.
    """
    shape, begin = told.shape[:2], watched.begin.copy()
    column = {each.column: told[..., n] for n, each in enumerate(machine.logged.drives)}
    for joint, column_of in measured_joints(machine.described).items():
        names = [each.name for each in machine.outputs]
        if column_of in names:
            begin[address(watched.model, joint)] = machine.logged.shown[
                :, names.index(column_of)
            ].mean()
    for joint in measured_joints(watched):
        column |= {
            angle_of(joint): np.full(shape, begin[address(watched.model, joint)]),
            rate_of(joint): np.zeros(shape),
            reading_of(joint): np.full(shape, np.nan),
        }
    column |= {name: np.ones(shape) for name in watched.switches}
    time = np.tile(period * np.arange(shape[1]), (shape[0], 1))
    logs = tuple(Log(None, {}, {"time": each}, str(n)) for n, each in enumerate(time))
    first = np.zeros(len(logs), int)
    return Segments(logs, first, time, column, np.empty((*shape, 0)), planned=True)


def _beyond(found: Array, ends: Array, names: Sequence[str]) -> str:
    """How a response (T, C + J) leaves the limits, (2, C + J); nothing if it does not."""
    if not np.isfinite(found).all():
        return "the twin is unstable, or does not come to rest."
    far = ~((found >= ends[0]) & (found <= ends[1])).all(axis=0)
    if not far.any():
        return ""
    n = int(np.argmax(far))
    least, most = found[:, n].min(), found[:, n].max()
    return (
        f"the twin's {names[n]} reaches {least:.4g} … {most:.4g} [SI], and what the logs showed or its range "
        f"allows {ends[0, n]:.4g} … {ends[1, n]:.4g}."
    )


def _restless(found: Array, still: Array, names: Sequence[str]) -> str:
    """Which part of a response, (T, C + J), is not at rest in the rows of a lead before the motion, or at its
    end not where it was then; nothing if none.
    """
    at_rest = np.concatenate([found[:LEAD], found[-LEAD:]])[:, : len(still)]
    moved = (np.abs(at_rest - found[LEAD, : len(still)]) > still).any(axis=0)
    if not moved.any():
        return ""
    return f"the twin's {names[int(np.argmax(moved))]} does not come to rest where it began."


def _log(
    machine: ModelMachine, name: str, told: Array, found: Array, settling: int, period: float
) -> Log:
    """The log of a response, (T, C + J), as if recorded; where runs start from rest alone with the rows in
    which it comes to rest, as nothing measured.
    """
    described, seen = machine.described, found[:, : len(machine.outputs)].copy()
    drives = [each.column for each in machine.logged.drives]
    seen[:settling] = np.nan
    first = settling if measured_joints(described) else 0
    columns = {
        "time": period * np.arange(len(told) - first),
        **dict(zip(drives, told[first:].T, strict=True)),
        **{name: np.ones(len(told) - first) for name in described.switches},
        **dict(zip([each.name for each in machine.outputs], seen[first:].T, strict=True)),
    }
    run = Log(None, {}, columns | held(described, columns), name)
    return run if described.about.rows == POSES else with_starts(described, [run])[0]


def _columns(machine: ModelMachine, rate_hz: float) -> Iterator[CommandColumn]:
    """What commands the machine, in the units of its logs."""
    logged = machine.logged
    ends = np.sort(_as_logged(machine, np.array([logged.low, logged.high])), axis=0).T.tolist()
    for each, (low, high), step in zip(logged.drives, ends, logged.step.tolist(), strict=True):
        fastest = step * rate_hz / abs(each.scale * TO_SI[each.unit][0])
        yield CommandColumn(each.column, each.unit, low, high, fastest)


def _as_logged(machine: ModelMachine, told: Array) -> Array:
    """What the drives tell the actuators, (…, D), in the units of the logs."""
    each = [
        as_logged(machine.described, drive, told[..., n])
        for n, drive in enumerate(machine.logged.drives)
    ]
    return np.stack(each, axis=-1)


def _about(machine: ModelMachine) -> str:
    """Which limits the motions keep, in sentences."""
    home = _as_logged(machine, machine.logged.home).tolist()
    at = [
        f"{d.column} = {h:.4g} {d.unit}" for d, h in zip(machine.logged.drives, home, strict=True)
    ]
    began = f"Each piece begins and ends at {', '.join(at)}."
    used = "Each column stays within what the training logs used and the actuator allows"
    faster = "no faster than in 99 % of the rows in which it moves there"
    within = "within the joints' ranges and what the logs showed, with a margin of a tenth"
    if machine.described.about.rows == POSES:
        return f"{began} {used}, and changes {faster}. The twin rests in each pose {within}."
    followed = f"The twin followed each piece from rest {within}, and came to rest again."
    return f"{began} {used}, and changes {faster}. {followed}"
