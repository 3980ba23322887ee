"""How is a session of the real arm recorded?"""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np
from tqdm import tqdm

from serpent_twin import run_folder
from serpent_twin.arm import Array
from serpent_twin.bus import BusError, MotorState
from serpent_twin.bus.dynamixel.bus import DynamixelBus
from serpent_twin.bus.dynamixel.setup import ArmSetup, find_setup
from serpent_twin.collect import Collect, metadata, session_path
from serpent_twin.collect.loop import record
from serpent_twin.control import random_targets
from serpent_twin.errors import SerpentError
from serpent_twin.log import Journal
from serpent_twin.mocap import MarkerFrame, Mocap, NoMocap

FURTHER = ("motor1_tick_ms", "recoveries")
"""Columns of every real log: motor 1's own clock, and what the bus overcame since the row before."""
FURTHER_OF_CAMERAS = ("camera_time", "marker_age")
MOST_EVENTS = 200
"""So many of the things overcome are told one by one in a log's metadata; all are counted."""

Show = Callable[[int, str], None]


def record_all(config: Collect, missing: list[int]) -> None:
    """Record the sessions 1, 2, … that are missing, one after the other."""
    setup = arm_of(config)
    if is_pseudo_terminal(setup.port):
        print(f"{setup.port} is a pseudo-terminal: the motors on it are simulated.")
    total = len(missing) * config.steps
    with _sigterm_as_interrupt(), tqdm(total=total, unit="row", disable=not missing) as bar:
        for session in missing:

            def show(rows: int, state: str, session: int = session) -> None:
                bar.set_postfix_str(
                    f"session {session} of {config.sessions}, {state}", refresh=False
                )
                bar.update(rows)

            record_session(config, setup, session, show)


def arm_of(config: Collect) -> ArmSetup:
    """The arm's setup, which must know its port and where the arm is straight."""
    setup = find_setup(config.real.setup, config.real.port)
    if not setup.zero:
        raise SerpentError(
            f"{config.real.setup} holds no zero, so nobody knows where the arm is straight. "
            f"Hang it straight and run python -m serpent_twin.bus.zero --port {setup.port}."
        )
    return setup


def record_session(config: Collect, setup: ArmSetup, session: int, show: Show) -> None:
    """Record one session; however it ends, its rows are sealed, and why it ended is said in them."""
    path = session_path(config, session)
    rng = np.random.default_rng(
        np.random.SeedSequence(config.seed, spawn_key=(session,)).spawn(3)[0]
    )
    targets = random_targets(config.steps, rng)
    bus = DynamixelBus(setup, config.real.lockstep)
    cameras = cameras_of(config)
    further = FURTHER + (FURTHER_OF_CAMERAS if config.real.mocap != "none" else ())
    about = metadata(config, session) | _about(config, setup)
    times: list[float] = []
    ended: dict[str, Any] = {"complete": True}
    with Journal(path, about, further, fsync_every=max(1, round(config.rate_hz))) as journal:
        try:
            with cameras, bus:
                gain, period = config.parameters.controller_gain, 1 / config.rate_hz
                for row in record(bus, cameras, targets, gain, period, _further(bus, further)):
                    journal.append(row)
                    times.append(row["time"])
                    show(1, _state(times, period, bus))
        except (SerpentError, KeyboardInterrupt, OSError) as error:
            ended = {"complete": False, "ended": str(error) or "stopped by hand"}
            if journal.rows and isinstance(error, BusError):
                error.add_note(f"The {journal.rows} rows until then are kept in {path}.")
            raise
        finally:
            if journal.rows:
                loop = {"loop": loop_times(np.array(times), 1 / config.rate_hz, bus.missed)}
                journal.seal(ended | loop | {"bus": _account(bus)})
    run_folder.drop_what_came_again(path)


def loop_times(time: Array, period: float, missed: int) -> dict[str, float]:
    """How evenly rows at `time` [s], (T,), came: jitter is a step's difference from the period [s]."""
    jitter = np.abs(np.diff(time) - period) if len(time) > 1 else np.zeros(1)
    return {
        "period_s": period,
        "jitter_mean_s": float(jitter.mean()),
        "jitter_p99_s": float(np.quantile(jitter, 0.99)),
        "jitter_max_s": float(jitter.max()),
        "missed_deadlines": missed,
    }


def is_pseudo_terminal(port: str) -> bool:
    """Whether a port is no serial line, but another program."""
    return os.path.realpath(port).startswith(("/dev/pts/", "/dev/ttys"))


def _state(times: list[float], period: float, bus: DynamixelBus) -> str:
    jitter = abs(times[-1] - times[-2] - period) if len(times) > 1 else 0.0
    return (
        f"jitter {jitter * 1e3:.1f} ms, missed {bus.missed}, "
        f"recovered {sum(bus.recovery.counts.values())}"
    )


def _further(
    bus: DynamixelBus, names: tuple[str, ...]
) -> Callable[[MotorState, MarkerFrame], dict[str, float]]:
    told = 0

    def columns(state: MotorState, frame: MarkerFrame) -> dict[str, float]:
        nonlocal told
        known, told = told, sum(bus.recovery.counts.values())
        values = {
            "motor1_tick_ms": float(state.registers.realtime_tick[0]),
            "recoveries": float(told - known),
            "camera_time": frame.camera_time,
            "marker_age": frame.age,
        }
        return {name: values[name] for name in names}

    return columns


def _about(config: Collect, setup: ArmSetup) -> dict[str, Any]:
    described = asdict(setup) | {"path": str(setup.path)}
    return {
        "markers": config.real.mocap,
        "setup": described,
        "lockstep": config.real.lockstep,
        "port_is_pseudo_terminal": is_pseudo_terminal(setup.port),
    }


def _account(bus: DynamixelBus) -> dict[str, Any]:
    return {
        "recoveries": dict(bus.recovery.counts),
        "events": bus.recovery.events[:MOST_EVENTS],
        "answers": dict(bus.wire.counts),
    }


def cameras_of(config: Collect) -> Mocap:
    """The cameras asked for, not yet connected."""
    if config.real.mocap == "none":
        return NoMocap()
    from serpent_twin.mocap.frame import Rigid
    from serpent_twin.mocap.natnet.live import NatNetMocap

    return NatNetMocap(config.real.natnet, Rigid.load(config.real.frame))


@contextmanager
def _sigterm_as_interrupt() -> Iterator[None]:
    """Have SIGTERM unwind as Ctrl-C does, so that the arm stops and the log is sealed."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
