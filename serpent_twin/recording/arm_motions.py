"""Propose motions of the arm within its limits, and simulate them on a twin behind a bus."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from serpent_twin.arm.control import (
    TARGET_COLUMNS,
    joint_p_control,
    random_targets,
    target_bounds,
)
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.emulator.cameras import SimulatedMocap
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.hardware.limits import Guard, Limits
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.machines.arm import SessionRig
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.twin_file import contents
from serpent_twin.machines.proposals import CommandColumn, Proposals, kept_ones
from serpent_twin.sessions.session import SCHEMA_VERSION, Session, session_from_rows
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.tables.segments import Segments

_REST = 3.0
"""Seconds at the end of each motion in which the arm returns to straight, so that motions can follow
one another in any order"""
_LIMITS = (
    "Each piece ends with the arm straight. Joint targets keep the range of random targets, and the twin "
    "followed each piece within the limits of joint angles and motor loads at which the real arm is stopped."
)
"""Sentences for a reader on the limits that all motions keep"""
_SMALL = 0.15
"""Amplitude of small reversals, as a share of the range of targets"""


def _random(time: Array, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """The random targets of a usual session, with another hold."""
    return random_targets(len(time), rng, hold=int(rng.integers(3, 13)))


def _one_joint(time: Array, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """One joint to and fro between its limits, the others straight."""
    j, period = int(rng.integers(N_JOINTS)), float(rng.choice([5.0, 10.0, 20.0]))
    out = np.zeros((len(time), N_JOINTS))
    out[:, j] = low[j] + (high[j] - low[j]) * (0.5 - 0.5 * np.cos(2 * np.pi * time / period))
    return out


def _slow_then_fast(time: Array, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """All joints together, ever faster: friction that depends on speed, and delays."""
    phase = 2 * np.pi * (time / 16 + time**2 / 160)
    ends = np.where(rng.random(N_JOINTS) < 0.5, low, high)
    return ends * np.sin(phase)[:, None]


def _small_reversals(time: Array, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Small steps to and fro about a bent pose: backlash and friction."""
    middle = rng.uniform(low, high)
    side = np.sign(np.sin(2 * np.pi * time / float(rng.choice([2.0, 4.0, 8.0]))))
    return middle + _SMALL * (high - low) * side[:, None]


def _long_hold(time: Array, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """One far pose, held under load: creep, slip and payload."""
    pose = np.where(rng.random(N_JOINTS) < 0.5, low, high)
    return np.tile(pose, (len(time), 1))


def _same_pose_again(time: Array, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Two poses in turn: drift, and what depends on the side from which a pose is reached."""
    one, other = rng.uniform(low, high, (2, N_JOINTS))
    return np.where((time // 4 % 2 < 1)[:, None], one, other)


KINDS: Mapping[str, Callable[[Array, Array, Array, np.random.Generator], Array]] = {
    "random targets": _random,
    "one joint": _one_joint,
    "slow, then fast": _slow_then_fast,
    "small reversals": _small_reversals,
    "long hold": _long_hold,
    "the same pose again": _same_pose_again,
}
"""Joint targets [rad], (T, 9), at times [s], (T,), between low and high [rad], (9,), by kind"""


def propose(
    machine: ModelMachine,
    point: ParameterVector,
    count: int,
    seconds: float,
    rate_hz: float,
    rng: np.random.Generator,
) -> Proposals[Segments]:
    """Joint targets [rad], (count, T, 9), of all kinds in turn, and what the twin makes of them."""
    noise = np.array([each.noise for each in machine.outputs])
    design = twin_model.from_dict(contents(machine, point, noise))

    def make(kind: str, turn: int) -> Array:
        return made_targets(kind, seconds, rate_hz, rng)

    def keep(targets: Sequence[Array], tried: int) -> list[tuple[Session | None, str]]:
        return [kept_limits(design, each, rate_hz, n) for n, each in enumerate(targets, tried + 1)]

    kinds, targets, done = kept_ones(list(KINDS), count, make, keep, "the arm's")
    pieces = machine.pieces(SessionRig(machine.described).logs(done))
    return Proposals(kinds, _columns(), targets, pieces, _LIMITS)


def _columns() -> tuple[CommandColumn, ...]:
    """Joint targets and their range [rad], (9,)."""
    ends = zip(TARGET_COLUMNS, *(each.tolist() for each in target_bounds()), strict=True)
    return tuple(CommandColumn(name, "rad", low, high) for name, low, high in ends)


def made_targets(kind: str, seconds: float, rate_hz: float, rng: np.random.Generator) -> Array:
    """Joint targets of a kind [rad], (T, 9), within the range of targets, straight at the end."""
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    low, high = target_bounds()
    targets = np.clip(KINDS[kind](time, low, high, rng), low, high)
    targets[time >= seconds - min(_REST, seconds / 2)] = 0.0
    return targets


def simulated(design: TwinModel, targets: Array, rate_hz: float, number: int) -> Session:
    """The session that a twin makes of joint targets, without noise; raises `BusError` where it leaves the
    limits at which the real arm is stopped: of its joints, and of its motors' loads, hence its cables'
    tensions.
    """
    twin, guard, rows = Twin(design), Guard(Limits()), []
    cameras = SimulatedMocap(twin, np.random.default_rng(0), 0.0, 0.0)
    with SimulatedBus(twin) as bus:
        bus.enable_torque()
        for n, target in enumerate(targets):
            if n:
                bus.wait(1 / rate_hz)
            state = bus.read_state()
            guard.check(state)
            velocity = joint_p_control(target, state.position, design.parameters.controller_gain)
            rows.append(
                {
                    "time": state.time,
                    "motor_position": state.position,
                    "motor_velocity": state.velocity,
                    "motor_load": state.load,
                    "motor_velocity_command": bus.write_velocity(velocity),
                    "joint_target": target,
                    "marker": cameras.read().position,
                }
            )
    about = {"schema_version": SCHEMA_VERSION, "session": number, "rate_hz": rate_hz}
    about["prior_runtime_s"] = 0.0
    return session_from_rows(rows, about)


def kept_limits(
    design: TwinModel, targets: Array, rate_hz: float, number: int
) -> tuple[Session | None, str]:
    """The session of joint targets; None, and why, where it leaves the limits."""
    try:
        return simulated(design, targets, rate_hz, number), ""
    except BusError as error:
        return None, str(error)
